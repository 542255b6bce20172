"""The digital calibration certificate (DCC) of PTB as typed data, read from XML and written as XML; knows no job."""

from cmm_uq.jobs.dcc.certificate import Certificate
from cmm_uq.jobs.dcc.xml_file import checked_by_schema, read, unread, written

__all__ = ["Certificate", "checked_by_schema", "read", "unread", "written"]
