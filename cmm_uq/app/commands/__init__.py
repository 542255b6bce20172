"""The commands, each callable from Python: from what was read to written files."""
