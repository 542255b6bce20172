"""What a recording would not have shown: against recordings drawn one by one, and where exact geometry says it."""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest

from cmm_uq.analysis.diagnosis.comparison.search import SearchResult, model_comparison
from cmm_uq.analysis.diagnosis.power import powers, without_fault
from cmm_uq.analysis.diagnosis.smallest import SmallestEffect, smallest_effects
from cmm_uq.analysis.planning.candidates import ready_plan
from cmm_uq.analysis.planning.set_up import attitude_along, join
from cmm_uq.artefacts.ballbar import ballbar
from cmm_uq.certificate.document import Table
from cmm_uq.machine.model import Noise, RecordingModel
from cmm_uq.machine.physics.catalogue import effects
from tests.analysis.planning.plans import BALLBAR, GAUGE, setting
from tests.artefacts.simulated import diagnosed

ALPHA = 0.01


def searched(model: RecordingModel) -> SearchResult:
    """A search that finds nothing, noise not stated."""
    first = model_comparison(model, None, 0)
    assert first.p_value > ALPHA
    return SearchResult(first, first.comparison, None, frozenset(), (), model, 0.0)


def rows(found: SearchResult) -> dict[str, SmallestEffect]:
    """By effect."""
    return {row.effect: row for row in smallest_effects(found, ALPHA, found.model)}


@cache
def gauge(noise: float = 1e-3) -> tuple[SearchResult, dict[str, SmallestEffect]]:
    """Seven lines of a step gauge, faces 60 mm apart, each once, nothing left out."""
    chosen = setting(GAUGE, length_mm=820.0, pitch_mm=60.0, repeats=1)
    model = chosen.model(join(ready_plan(chosen)[1]))
    found = searched(without_fault(chosen.observed, model, Noise(noise), 1))
    return found, rows(found)


@pytest.mark.long
def test_the_closed_form_is_within_a_fifth_of_recordings_drawn_and_tested() -> None:
    """The amplitude that 90 of 100 drawn recordings show lies so close to the one computed."""
    found, smallest = gauge()
    comparison = found.first.comparison
    sigma = float(comparison.noise_posterior().sum(axis=0) @ comparison.sigma)
    names = ("rotation_y_y", "straightness_x_z")
    for power in powers(found.model, effects(names), stated=None, sigma=sigma, alpha=ALPHA, seed=4, draws=20):
        detected = smallest[power.effect].detected
        assert detected is not None
        assert power.detected(1.2 * detected) >= 0.9
        assert power.detected(detected / 1.2) <= 0.9


def test_twins_are_seen_and_never_named() -> None:
    """On lines through one middle the pitch of X and the roll of Y bend the space diagonals alike."""
    smallest = gauge()[1]
    for name in ("rotation_x_y", "rotation_y_x"):
        assert smallest[name].shown
        assert smallest[name].named is None


@pytest.mark.long
def test_twice_the_noise_hides_effects_twice_as_large() -> None:
    """The same draws of the noise, twice as large: all is in proportion, but for thresholds from two hundred draws each."""
    small, large = gauge()[1], gauge(2e-3)[1]
    for name in ("rotation_y_y", "scale_curvature_x", "straightness_x_z"):
        first, second = small[name].detected, large[name].detected
        assert first is not None
        assert second is not None
        assert second / first == pytest.approx(2.0, rel=0.15)


def test_what_the_named_effects_take_up_is_said_with_their_names() -> None:
    """Level bars along X and Y alone, scales free: sag shortens all alike, which scales of X and Y do as well."""
    chosen = setting(BALLBAR, repeats=2)
    bar = ballbar(BALLBAR, chosen.plan)
    level = tuple(
        chosen.volume.set_up(bar, attitude_along(np.array(way)), (x, y, 0.5), "level")
        for way in ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0)) for x in (0.1, 0.5, 0.9) for y in (0.1, 0.9)
    )  # fmt: skip
    model = RecordingModel(chosen.observed(join(level)), effects(("scale_x", "scale_y")), 1e-3)
    row = rows(searched(without_fault(chosen.observed, model, Noise(1e-3), 2)))["artefact_sag"]
    assert not row.shown
    assert row.share < 1e-3
    assert set(row.taken_up) == {"scale_x", "scale_y"}


def bars_in_the_middle() -> RecordingModel:
    """Bars along X at one place: a bow of X shows in none of them beyond what their own middle does."""
    chosen = setting(BALLBAR, repeats=2)
    bar = ballbar(BALLBAR, chosen.plan)
    placings = tuple(
        chosen.volume.set_up(bar, attitude_along(np.array(way)), (0.5, 0.5, 0.5), "middle")
        for way in ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0), (1.0, 1.0, 0.0), (1.0, 0.0, 1.0), (0.0, 1.0, 1.0),
                    (1.0, -1.0, 0.0), (1.0, 0.0, -1.0), (0.0, 1.0, -1.0))
    )  # fmt: skip
    model = RecordingModel(chosen.observed(join(placings)), effects(("scale_x", "scale_y", "scale_z")), 1e-3)
    return without_fault(chosen.observed, model, Noise(1e-3), 2)


def test_a_bow_that_no_bar_shows_is_blind() -> None:
    """Both balls lie symmetrically about the middle of travel, where a bow is the same: nothing of it is in their distance."""
    row = rows(searched(bars_in_the_middle()))["straightness_x_y"]
    assert row.detected is None
    assert row.blind


def test_a_period_that_divides_the_pitch_is_not_resolved() -> None:
    """Faces 60 mm apart along X: an error of 60, 30, 20, … mm is the same at each, and the gauge's place takes it up."""
    periods = gauge()[1]["periodic_scale_x"].periods
    assert periods is not None
    for part in range(1, 6):
        assert any(low / 1.01 < 60.0 / part < 1.01 * high for low, high in periods.unresolved)
    assert not any(low < 60.0 / 1.5 < high for low, high in periods.unresolved)


@pytest.mark.long
@pytest.mark.parametrize("job", ["digitizer-simulated", "plate-simulated", "step-gauge-simulated"])
def test_sag_is_of_bars_and_gauges_alone(job: str) -> None:
    """A digitizer's mount moves along lines past its sphere, and neither sphere nor plate is shortened along a line."""
    listed = next(
        block for section in diagnosed(job).sections for block in section.blocks
        if isinstance(block, Table) and block.caption == "Smallest errors that would have shown"
    )  # fmt: skip
    assert ("Sag of the artefact" in [row[0] for row in listed.rows]) is job.startswith("step-gauge")
