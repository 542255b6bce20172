"""What a machine alone makes of the recorded lengths, beside what a standard decides: noise included, and never by this."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings, strategies as st

from benchmarks.coverage.performance import ALONE, CORRECTED, FIGURES, LARGEST, Cell, measured
from cmm_uq.analysis.machine.performance import performance_of
from cmm_uq.analysis.machine.regions import FactorRegions
from cmm_uq.artefacts.ballbar import Ballbar
from cmm_uq.base.points import Floats, Machine, Points
from cmm_uq.certificate.certificate import certified
from cmm_uq.certificate.result import Page, Result
from cmm_uq.jobs.tables.artefact import ArtefactFacts
from cmm_uq.machine.model import RecordingModel
from tests.artefacts.simulated import analysed, outcome

JOBS = ("iota-1102-20C", "step-gauge-simulated")
TRAVEL = np.array([[0.0, 900.0], [0.0, 600.0], [-500.0, 0.0]])


def regions(job: str) -> FactorRegions:
    found = analysed(job).regions
    assert isinstance(found, FactorRegions)
    return found


def three_bars() -> RecordingModel:
    """Bars of 300 mm along X, Y and Z."""
    ends = np.array(
        [[100.0, 100, -400], [400, 100, -400], [100, 100, -400], [100, 400, -400], [100, 100, -400], [100, 100, -100]]
    )
    one = np.repeat([1, 2, 3], 2)
    points = Points(ends, one, np.tile([1, 2], 3), np.ones(6, dtype=np.int64), Machine(travel_mm=TRAVEL), {})
    return RecordingModel(Ballbar(ArtefactFacts(kind="ballbar", length_mm=300.0, u_um=0.5), points), ())


def test_figures_are_those_of_errors_by_hand() -> None:
    """Bars too long by 1, 4 and −2 µm: mean 1, range 6, deviations 0, 3, −3, standard deviation √(18/2) = 3 µm."""
    found = performance_of(three_bars(), 1e-3 * np.tile([1.0, 4.0, -2.0], (50, 1)))
    assert found is not None
    assert [found.figures[name].value for name in FIGURES] == pytest.approx([3.0, 6.0, 3.0], rel=1e-9)
    assert found.largest(np.array([True, False, True])).value == pytest.approx(2.0, rel=1e-9)


@pytest.mark.parametrize("job", JOBS)
def test_errors_of_lengths_are_those_of_the_machine_that_indicates_them(job: str) -> None:
    """A machine with nothing but the estimated errors: the difference of its indicated lengths from the true ones."""
    from cmm_uq.analysis.machine.performance import rows_of
    from cmm_uq.analysis.machine.regions import DrawnErrors
    from tests.analysis.machine.test_regions import observe

    result = analysed(job)
    model, about = result.model, result.estimate.about
    drawn = DrawnErrors.of(model, lambda points: observe(result, points), 0, 10)
    rows, k = rows_of(model.artefact), drawn.field.modelled
    assert rows is not None
    errors = drawn.of_lengths(model, rows, about[None, :k], np.zeros((1, drawn.further.shape[1])))[0]
    true, shown = (
        np.linalg.norm(np.diff(each[rows], axis=1)[:, 0], axis=1)
        for each in (model.placed(about), model.predicted(about))
    )
    np.testing.assert_allclose(errors, shown - true, atol=1e-6)


@pytest.mark.parametrize(
    ("sort", "artefact", "noise"),
    [(ALONE, "bars", "white"), ("ordinary", "bars", "set-up 1"), ("ordinary", "step gauge", "white")],
)
def test_a_machine_of_known_errors_has_its_figures_in_the_interval(sort: str, artefact: str, noise: str) -> None:
    """Machines that share no code with the package; of so few intervals of 95 % no two may miss."""
    missed = 0
    for number in (1, 2):
        record = measured((Cell(sort, artefact, 3, noise), 5, number))
        for one in record["figures"].values():
            missed += not one["machine"][2] <= one["true"] <= one["machine"][3]
    assert missed <= 1


def test_noise_makes_the_range_of_a_machine_without_errors_larger_and_the_interval_does_not_follow() -> None:
    """Corrected to a fifth of a micrometre: the range that was recorded is of noise, and lies above the machine's interval."""
    one = measured((Cell(CORRECTED, "bars", 3, "white"), 5, 1))["figures"]["b89_range_um"]
    assert one["value"] > one["machine"][3]
    assert one["value"] > 3 * one["true"]


def test_the_largest_error_of_a_gauge_is_stated_by_itself() -> None:
    assert set(measured((Cell(ALONE, "step gauge", 3, "white"), 5, 1))["figures"]) == {LARGEST}


def with_errors(job: str, change: Any) -> dict[str, Any]:
    """What results.json would have of a job whose machine has other errors in the draws."""
    found, result = regions(job), analysed(job)
    assert found.performance is not None
    own = replace(found.performance, errors=change(found.performance.errors))
    other: Result = replace(result, all_errors=lambda: replace(found, performance=own))
    return dict(certified(other, Page(lambda found: [], lambda found: {})).results)


def decided(results: dict[str, Any]) -> list[Any]:
    """All that is decided, and what it is decided on."""
    new = ("largest_um", "largest_without_noise_um")
    statements = [{key: value for key, value in one.items() if key not in new} for one in results["conformity"]]
    return [
        statements,
        results["verdicts"],
        results["tolerances"],
        results["accuracy"],
        results["accuracy_uncertainty"],
    ]


@pytest.mark.parametrize("job", JOBS)
@settings(max_examples=8, deadline=None)
@given(times=st.floats(0.0, 10.0), seed=st.integers(0, 1000))
def test_nothing_that_is_decided_depends_on_what_is_said_of_the_machine_without_noise(
    job: str, times: float, seed: int
) -> None:
    """However small its errors are made, no outcome, probability, value or u moves, so that none improves."""
    random = np.random.default_rng(seed)

    def smaller(errors: Floats) -> Floats:
        return times * errors * random.random(errors.shape)

    assert decided(with_errors(job, smaller)) == decided(with_errors(job, lambda errors: errors))


def test_beside_each_decision_stands_what_of_it_is_the_machine_s() -> None:
    """The range as decided, and the largest error of the lengths decided, each with the machine's own."""
    for job in JOBS:
        (one,) = outcome(job).results["conformity"]
        sizes = [abs(item["error_um"]) for item in one["errors"]]
        assert one["largest_um"] == pytest.approx(max(sizes), rel=1e-9)
        low, high = one["largest_without_noise_um"]["interval95"]
        assert 0 < low < high
    assert outcome(JOBS[0]).results["performance_of_machine"].keys() == set(FIGURES)
