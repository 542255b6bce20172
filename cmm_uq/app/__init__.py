"""The command line, the commands, the same from Python, and pages in a browser."""
