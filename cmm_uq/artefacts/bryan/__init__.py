"""Bryan gauge: a bar whose one ball stays on the table."""
