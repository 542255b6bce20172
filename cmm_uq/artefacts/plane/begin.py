"""A new job of a probed plane: a grid of points on a surface plate."""

from __future__ import annotations

from cmm_uq.jobs.beginning import Beginning

BEGINNING = Beginning(
    title="Surface plate, a grid of points",
    numbering="One measurement is one place of the surface; point 0, where there is one, lies just before contact.",
    artefact={"name": "Surface plate"},
    effects=("straightness_x_z", "straightness_y_z"),
    plan={"grid": [7, 7], "repeats": 2},
)
