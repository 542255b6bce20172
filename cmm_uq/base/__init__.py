"""What every room stands on: errors, units, text, points, files and what is written of them."""
