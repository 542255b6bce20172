"""What light measures: balls of a bar and planes that a laser digitizer scans, points that a tracker sees."""
