"""Tables of lengths and of runs along axes: which columns are which by their figures, and which labels name lines and runs."""
