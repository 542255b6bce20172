"""From bytes to cells: encodings, columns by where they stand, figures and their units."""
