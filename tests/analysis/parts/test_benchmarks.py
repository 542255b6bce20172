"""Published figures, a real machine, exact reference pairs, and coverage of zones: what benchmarks/parts computes."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest

from benchmarks.parts.iota import elsewhere
from benchmarks.parts.published import Figure, arcs, circles, polar
from benchmarks.parts.reference_pairs import every, pair
from benchmarks.parts.zones import short
from cmm_uq.jobs.part.feature import Kind
from cmm_uq.maths.geometry.association import Association


@pytest.mark.long
@pytest.mark.parametrize("figures", [circles, polar, arcs])
def test_printed_figures_come_out_again(figures: Callable[[], list[Figure]]) -> None:
    assert [one for one in figures() if not one.holds] == []


@pytest.mark.long
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


@pytest.mark.parametrize(("kind", "how"), list(every()))
def test_a_reference_pair_gives_form_size_direction_and_place_to_a_picometre(kind: Kind, how: Association) -> None:
    for name, off in pair(kind, how, seed=7).items():
        assert off < 1e-9, name


@pytest.mark.long
@pytest.mark.parametrize("times", [1.0, 3.0])
def test_what_was_measured_small_may_be_large_where_errors_are(times: float) -> None:
    """Whatever direction is left of it: the upper end fails in 2.5 %, to three standard deviations of 400 measurements."""
    assert short(times, 400) < 0.025 + 3 * np.sqrt(0.025 * 0.975 / 400)
