"""Instruments without hardware: each answers as its manual says, on a real pseudo-terminal or socket, and can misbehave."""
