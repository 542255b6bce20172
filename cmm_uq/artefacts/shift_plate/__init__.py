"""Two axes calibrated by a plate that is shifted and turned."""
