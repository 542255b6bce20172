"""Which columns a table must have: of a recording its coordinates, of an artefact's certificate its certified values."""

from __future__ import annotations

from cmm_uq.jobs.recording import COORDINATES

POINTS = (COORDINATES,)
REFERENCES = (*POINTS, ("reference_mm",), ("reference_x_mm", "reference_y_mm", "reference_z_mm"))
