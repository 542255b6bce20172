"""What a laser digitizer scans: the balls of a bar, and planes."""
