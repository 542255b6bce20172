"""Repeats against placings: what the table says follows from σ²/n + τ² for each placing."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from cmm_uq.analysis.planning.candidates import ready_plan
from cmm_uq.analysis.planning.identifiability import compare_repeats
from cmm_uq.analysis.planning.set_up import join, repeat_points
from cmm_uq.analysis.planning.setting import PlannedNoise
from cmm_uq.artefacts import artefact_facts
from tests.analysis.planning.plans import setting

SIGMA = 1e-3
NAMED = ("squareness_xy", "squareness_yz", "squareness_zx")
BAR = artefact_facts(kind="ballbar", length_mm=400.0)


def ratio_of(offset: float) -> PlannedNoise:
    return PlannedNoise((SIGMA, SIGMA, SIGMA), placing=offset * SIGMA)


@pytest.mark.parametrize(
    ("offset", "minutes", "seconds"), [(1.0, 5.0, 10.0), (2.0, 5.0, 10.0), (1.0, 1.0, 60.0), (0.0, 5.0, 10.0)]
)
def test_repeats_lower_the_noise_alone_and_placings_all_of_it(offset: float, minutes: float, seconds: float) -> None:
    chosen = setting(BAR, NAMED, minutes_per_placing=minutes, seconds_per_point=seconds)
    chosen = replace(chosen, noise=ratio_of(offset))
    found = compare_repeats(chosen, ready_plan(chosen)[1])
    assert found is not None
    first, n = found.rows[0], 20
    better = []
    for row, following in zip(found.rows, found.rows[1:], strict=False):
        r = row.repeats
        left = (1 / r + offset**2) / (1 + offset**2)
        np.testing.assert_allclose(row.u, first.u * np.sqrt(left), rtol=1e-8)
        np.testing.assert_allclose(row.u_more, row.u * np.sqrt(n / (n + 1)), rtol=1e-8)
        assert row.readings == 2 * n * r
        assert row.readings_more == pytest.approx(2 * (n + 1) * r)
        assert row.minutes == pytest.approx(minutes * n + seconds * 2 * n * r / 60)
        assert row.minutes_more == pytest.approx(minutes * (n + 1) + seconds * 2 * (n + 1) * r / 60)
        # half the logarithm of both variances, over the minutes of each
        by_placing = 0.5 * np.log((n + 1) / n) / (minutes + seconds * 2 * r / 60)
        by_repeat = -0.5 * np.log((1 / (r + 1) + offset**2) / (1 / r + offset**2)) / (seconds * 2 * n / 60)
        better.append(bool(by_placing > by_repeat))
        assert following.repeats == r + 1
    expected = next((i + 1 for i in range(len(better)) if all(better[i:])), None)
    assert found.enough == expected


def test_large_offsets_make_repeats_worthless_sooner() -> None:
    """Twenty bars of 20 s each and 5 min to set one up.

    With an offset as large as the noise, ½·ln(21/20) in 6.33 min against ½·ln(1.25/1.2) in 6.67 min from four repeats on;
    with three, ½·ln(21/20) in 6 min is less than ½·ln(1.333/1.25) in 6.67 min.
    """
    chosen = setting(BAR, NAMED)
    enough = []
    for offset in (0.0, 1.0, 5.0):
        found = compare_repeats(replace(chosen, noise=ratio_of(offset)), ready_plan(chosen)[1])
        assert found is not None
        enough.append(found.enough)
    assert enough == [None, 4, 1]


def test_white_noise_and_a_kind_without_effects_have_no_such_table() -> None:
    chosen = setting(BAR, NAMED)
    assert compare_repeats(chosen, ready_plan(chosen)[1]) is None


def test_a_placing_repeated_is_the_plan_with_as_many_repeats() -> None:
    once, four = (setting(BAR, NAMED, repeats=n) for n in (2, 4))
    points, wanted = (join(ready_plan(chosen)[1][:1]) for chosen in (once, four))
    found = repeat_points(points, 4)
    np.testing.assert_array_equal(found.repeat, wanted.repeat)
    np.testing.assert_array_equal(found.point, wanted.point)
    np.testing.assert_allclose(found.xyz, wanted.xyz)
