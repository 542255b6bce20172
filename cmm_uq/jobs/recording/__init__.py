"""What is joined to a recording: certified values, temperatures, a short gauge, predictions."""
