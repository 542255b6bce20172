"""Features of measured points, in mm: least squares, zones, inscribed, circumscribed and tangent features."""

from cmm_uq.maths.geometry import *  # noqa: F403 - one list of names, which is that of the room
from cmm_uq.maths.geometry import __all__ as __all__
