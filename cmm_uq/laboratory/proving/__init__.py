"""Proof of the diagnosis on a laboratory's own set-ups: sealed cases, what was found of them, and how it is judged."""
