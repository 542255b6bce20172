"""Reports of measured parts, and of the methods beside each other: sections, tables, pictures, results.json."""
