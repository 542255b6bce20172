"""When a machine is to be calibrated again: interval methods, interim checks, trends; reads no files and draws nothing."""
