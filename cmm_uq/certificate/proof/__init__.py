"""The report of a proof on the user's own plan."""
