"""A recording taken live: journals that lose nothing, readings joined by time, the operator led by the plan."""
