"""What every reader shares: limits, files read whole, text, numbers, cells of CSV, TOML.

What goes beyond a limit is refused while it is read, before it can take memory or time; see docs/limits.md.
"""
