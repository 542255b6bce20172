"""The digital calibration certificate (DCC) of what a report states."""
