"""Commands of the laboratory: recordings taken live, batches, schedules, records, and what is due."""
