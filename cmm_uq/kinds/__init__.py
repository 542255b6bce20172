"""The kinds of measurement, one folder each: all that is particular to a ballbar, a plate, an axis read in shifted places."""
