"""A laboratory over time: records, recalibration, schedules, live recordings, proof of the diagnosis."""
