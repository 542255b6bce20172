"""Step gauge: faces at certified distances along one line."""
