"""Ball plate or hole plate."""
