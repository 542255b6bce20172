"""The digital calibration certificate (DCC) of PTB as typed data, read from XML and written as XML; knows no job."""
