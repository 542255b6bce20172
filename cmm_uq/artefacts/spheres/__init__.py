"""One sphere probed all around, and spheres on a turning table."""
