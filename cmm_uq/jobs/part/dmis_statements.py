"""Statements of DMIS by their first words: what is read of features, and what says nothing of a plan."""

from __future__ import annotations

import math

MILLIMETRES = {"MM": 1.0, "CM": 10.0, "M": 1000.0, "INCH": 25.4, "FEET": 304.8}
DEGREES = {"ANGDEC": 1.0, "ANGRAD": math.degrees(1.0)}
KINDS = {
    "POINT": "point",
    "LINE": "line",
    "PLANE": "plane",
    "CIRCLE": "circle",
    "SPHERE": "sphere",
    "CYLNDR": "cylinder",
}
NUMBERS = {"point": 6, "line": 9, "plane": 6, "circle": 7, "sphere": 4, "cylinder": 7}
"""That a feature has at least: its place, its direction, its diameter."""

PASSED = (
    "DMISMN", "DMISMD", "DISPLY", "FILNAM", "PRCOMP", "SNSET", "SNSMNT", "OPEN", "CLOSE", "GOTO", "MODE", "TEXT", "SAVE",
    "ENDFIL", "FEDRAT", "ACLRAT", "DECPL", "FINPOS", "RAPID", "FROM", "GOHOME", "CRSLCT", "TECOMP", "WKPLAN", "DEVICE",
    "DID", "VFORM", "REPORT", "FLY", "BADTST", "CALIB", "UNITS", "ENDMES", "PTMEAS", "SCNSET", "SCNMOD", "PATH", "PAMEAS",
    "GOTARG", "ENDGO", "CLMPID", "CLMPSN", "FIXTID", "FIXTSN", "OPERID", "PARTID", "PARTRV", "PARTSN", "PLANID", "PREVOP",
    "PROCID", "LOTID", "DMEID", "DMESWI", "DMESWV", "MFGDEV",
)  # fmt: skip
"""First words of statements that say nothing of what is measured, or that are read elsewhere."""
