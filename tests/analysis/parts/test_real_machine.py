"""A real machine: stated distances elsewhere in its volume against a laser interferometer's error map of it."""

from __future__ import annotations

import numpy as np

from benchmarks.parts.iota import elsewhere


def test_distances_of_a_real_machine_are_stated_as_its_error_map_has_them() -> None:
    """J. O. Harris, Ph.D. thesis, McMaster University, 2004, figures C 1 and C 2: before and after compensation."""
    distances = elsewhere(trials=5000)
    assert len(distances) == 13
    assert all(one.holds for one in distances)
    off, before = (
        np.array([getattr(one, which) - one.compensated for one in distances]) for which in ("value", "indicated")
    )
    assert np.abs(before).max() > 0.25  # mm, as indicated
    assert np.sqrt(np.mean(off**2)) < np.mean([one.u for one in distances])
