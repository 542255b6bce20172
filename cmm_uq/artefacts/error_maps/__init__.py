"""The machine's error maps as a recording: taken at several temperatures, compared with each other."""
