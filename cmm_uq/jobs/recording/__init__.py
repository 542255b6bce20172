"""How a recording is read, and what is joined to it: certified values, temperatures, a short gauge, predictions."""
