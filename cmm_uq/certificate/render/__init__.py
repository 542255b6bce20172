"""A document as HTML and as PDF: two views of the same texts."""
