"""What a measurement can tell before anyone makes it: which set-ups determine what, and which would tell more."""
