"""The commands of a laboratory over time: records, due dates, schedules, live recordings."""
