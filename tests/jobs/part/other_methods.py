"""Recordings of other methods on the plate, for tests: exact constructions whose figures follow by hand."""

from __future__ import annotations

from typing import Any

import numpy as np

from cmm_uq.jobs.part.job import PartJob
from tests.jobs.part.parts import plate

# the plate's characteristics: diameter of its bore, 30 mm, and the bore's distance from the face B, 40 mm
SIZE, ACROSS = "1", "5"
# of the calibrated part's bore: systematic error, and half of what two repeats in a set-up differ by, mm
BIAS, SPREAD = 3e-3, 1e-3
OFF = 1e-3 * np.array([3.0, -1.0, -4.0, 2.0])  # of the orientations, mm; their mean is nothing
SCALE, TIP = 20e-6, 6e-3  # errors of the common scale, and of the tip's effective diameter, mm


def calibrated_rows() -> list[str]:
    """Ten set-ups of two measurements: 30.0020 mm by the certificate, 3 ± 1 µm more by the machine."""
    return ["cycle,repeat,characteristic,value_mm"] + [
        f"{i},{j},{SIZE},{30.002 + BIAS + (2 * j - 3) * SPREAD!r}" for i in range(1, 11) for j in (1, 2)
    ]


def turned_rows() -> list[str]:
    """Four orientations of five measurements of a bore of 30 mm and a distance of 40 mm, with scale and tip wrong."""
    rows = ["orientation,repeat,characteristic,value_mm"]
    for i, off in enumerate(OFF.tolist()):
        for j in range(5):
            own = off + 1e-3 * (j - 2)
            rows.append(f"{i + 1},{j + 1},{SIZE},{30 * (1 + SCALE) - TIP + own!r}")
            rows.append(f"{i + 1},{j + 1},{ACROSS},{40 * (1 + SCALE) + 0.5 * TIP + own!r}")
    return rows


def standard_rows(column: str, size: float) -> list[str]:
    """Four orientations of five readings, half a micrometre to both sides."""
    return [f"orientation,repeat,{column}"] + [
        f"{i},{j},{size + 0.5e-3 * (j - 3)!r}" for i in range(1, 5) for j in range(1, 6)
    ]


def files() -> dict[str, bytes]:
    """Every recording."""
    rows = {
        "calibrated.csv": calibrated_rows(), "turned.csv": turned_rows(),
        "bar.csv": standard_rows("length_mm", 500 * (1 + SCALE)),
        "ring.csv": standard_rows("diameter_mm", 25 * (1 + SCALE) - TIP),
    }  # fmt: skip
    return {name: "\n".join(lines).encode() for name, lines in rows.items()}


CALIBRATED: dict[str, Any] = {
    "file": "calibrated.csv", "certificate": "K-7", "same_procedure": True, "substitution": True, "similar": True,
    "conditions_varied": True,
    "characteristic": [{"name": SIZE, "value_mm": 30.002, "u_um": 0.4, "u_part_um": 0.3}],
}  # fmt: skip
ORIENTED: dict[str, Any] = {
    "file": "turned.csv", "points_varied": True,
    "length_standard": {"length_mm": 500.0, "u_um": 0.6, "file": "bar.csv", "certificate": "K-8"},
    "probe_standard": [{"diameter_mm": 25.0, "u_um": 0.2, "inner": True, "file": "ring.csv", "certificate": "K-9"}],
}  # fmt: skip
"""Tests that lack nothing."""


def with_methods(**changes: Any) -> PartJob:
    """The plate with both methods; a table that is given stands in place of its own, ``None`` takes it away."""
    return plate(files(), **{"by_calibrated_part": CALIBRATED, "by_orientations": ORIENTED, **changes})
