"""Where the part lies in the machine, and what its axes read at a point."""

from __future__ import annotations

import numpy as np

from cmm_uq.base.points import Floats
from cmm_uq.jobs.part.file import PartFile
from cmm_uq.jobs.part.probed import Probed
from cmm_uq.jobs.part.tables import PlacingFacts, StylusFacts


def rotation(placing: PlacingFacts) -> Floats:
    """(3, 3) coordinates of the machine = rotation · those of the part + origin: about x, then y, then z of the machine."""
    a, b, c = np.radians(placing.rotation_deg)
    about_x = np.array([[1, 0, 0], [0, np.cos(a), -np.sin(a)], [0, np.sin(a), np.cos(a)]])
    about_y = np.array([[np.cos(b), 0, np.sin(b)], [0, 1, 0], [-np.sin(b), 0, np.cos(b)]])
    about_z = np.array([[np.cos(c), -np.sin(c), 0], [np.sin(c), np.cos(c), 0], [0, 0, 1]])
    return np.asarray(about_z @ about_y @ about_x)


def readings(feature: Probed, stylus: StylusFacts, facts: PartFile) -> Floats:
    """(n, 3) what the scales read while a feature is probed, mm: of the ram's reference point, which is not at the tip.

    Where the job does not say where the part lies, it lies at the origin.
    """
    centres = feature.points + 0.5 * stylus.diameter_mm * feature.normals
    origin = facts.placing.origin_mm or [0.0, 0.0, 0.0]
    placed = centres @ rotation(facts.placing).T + origin
    return np.asarray(placed - stylus.offset_mm + np.array(facts.machine_state.origin_mm))
