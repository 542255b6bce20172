"""The page of a diagnosis: found, where, how sure, what it costs, what to do next."""
