"""The digital calibration certificate (DCC) of PTB as typed data, read from XML and written as XML; knows no job."""

from cmm_uq.dcc.certificate import Certificate
from cmm_uq.dcc.reading import read
from cmm_uq.dcc.writing import written

__all__ = ["Certificate", "read", "written"]
