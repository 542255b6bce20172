"""Results for other programs: results.json and the files beside it."""
