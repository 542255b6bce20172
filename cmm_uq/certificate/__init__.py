"""What leaves the house: a document of words, tables and plots, rendered as HTML and PDF, and results.json."""
