"""What a machine alone makes of the recorded lengths, beside what a standard decides: noise included, and never by this."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings, strategies as st

from benchmarks.coverage.performance import ALONE, CORRECTED, FIGURES, LARGEST, Cell, measured
from benchmarks.parts import curved, machines
from cmm_uq.analysis.conformity.accuracy import figures
from cmm_uq.analysis.machine.performance import performance_of, rows_of
from cmm_uq.analysis.machine.regions import FactorRegions
from cmm_uq.app.commands.estimation import accuracy
from cmm_uq.app.commands.reading import job_of
from cmm_uq.app.commands.report import report_outcome
from cmm_uq.artefacts.ballbar import Ballbar
from cmm_uq.base.points import Floats, Machine, Points
from cmm_uq.certificate.certificate import certified
from cmm_uq.certificate.result import Page, Result
from cmm_uq.certificate.sections.conformity import performance, returning_figures
from cmm_uq.jobs.tables.artefact import ArtefactFacts
from cmm_uq.machine.model import RecordingModel
from cmm_uq.machine.model.noise import noise_of
from cmm_uq.maths.inference.posterior import Doubt, sample_with_noise
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
    drawn = DrawnErrors.of(model, Doubt(()), lambda points: observe(result, points), 0, 10)
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


@pytest.mark.long
@pytest.mark.parametrize("sort", ["ordinary", "ten times worse"])
def test_errors_of_the_machine_that_come_again_leave_the_noise_in_u_and_no_more(sort: str) -> None:
    """Bars thrice in each of twenty places, on three machines with curves that no job names: U beside half of the width within
    which 95 % of figures truly lie when the same is measured again. U as recorded is several times too wide."""
    wide, narrow = list[float](), list[float]()
    for seed in range(3):
        random = np.random.default_rng(seed)
        hidden = curved.drawn(next(one for one in curved.SORTS if one.name == sort), random)
        shown, still = (
            machines.calibrated(
                machines.Cell("bars", "white", 0.0), hidden, sigma, 0.0, np.random.default_rng(100 + seed)
            )
            for sigma in (1e-3, 0.0)
        )
        model = RecordingModel(shown, machines.NAMED)
        estimate = model.estimate()
        posterior = sample_with_noise(estimate.linear, noise_of(model), estimate.least_squares, seed)
        again = still.points.xyz + 1e-3 * random.standard_normal((400, *still.points.xyz.shape))
        each = figures(np.linalg.norm(again[:, still.rows[:, 1]] - again[:, still.rows[:, 0]], axis=2))
        as_recorded, returning = (
            accuracy(model, estimate, posterior, (), seed, returning=one) for one in (False, True)
        )
        for name in FIGURES:
            half = 0.5 * float(np.diff(np.quantile(each[name], [0.025, 0.975]))[0])
            wide.append(as_recorded[name].expanded / half)
            narrow.append(returning[name].expanded / half)
            assert returning[name].value == as_recorded[name].value
            assert abs(returning[name].value - each[name].mean()) < 1.2 * returning[name].expanded
    assert min(wide) > 2
    assert 0.9 < min(narrow) < max(narrow) < 1.6


def test_a_certificate_says_by_how_much_less_u_would_be_and_decides_by_nothing_of_it() -> None:
    job = JOBS[0]
    result = analysed(job)
    name = "b89_range_um"
    stated = result.accuracy[name]
    assert not returning_figures(result)  # each bar measured once: nothing tells noise from errors
    for part, told in ((0.91, False), (0.89, True)):
        half = part * stated.expanded
        less = replace(stated, u=0.5 * half, interval95=(stated.value - half, stated.value + half))
        other = replace(result, returning={name: less})
        new, old = (certified(one, Page(lambda found: [], lambda found: {})).results for one in (other, result))
        assert ("accuracy_if_left_returns" in new) == told
        assert decided(dict(new)) == decided(dict(old))
        texts = [str(note) for note in performance(other).blocks[0].notes]  # type: ignore[union-attr]
        assert any("would be there again" in text for text in texts) == told


JOB = b"""
[job]
id = "thrice"
date = 2026-01-01
origin = "simulated"
[machine]
name = "M"
travel_mm = { x = [0, 900], y = [0, 550], z = [-500, 0] }
[artefact]
kind = "ballbar"
length_mm = 400.0
u_um = 0.5
[recording]
file = "recording.csv"
[model]
effects = ["scale_x", "scale_y", "scale_z", "squareness_xy", "squareness_yz", "squareness_zx"]
"""


@pytest.mark.long
def test_a_report_of_bars_that_are_measured_thrice_has_it() -> None:
    random = np.random.default_rng(0)
    hidden = curved.drawn(curved.Sort("ordinary"), random)
    points = machines.calibrated(machines.Cell("bars", "white", 0.0), hidden, 1e-3, 0.0, random).points
    rows = zip(points.measurement, points.point, points.repeat, points.xyz.tolist(), strict=True)
    lines = [f"{m},{p},{r},{x:.5f},{y:.5f},{z:.5f}" for m, p, r, (x, y, z) in rows]
    csv = "\n".join(["# origin: simulated", "measurement,point,repeat,x_mm,y_mm,z_mm", *lines, ""])
    data = report_outcome(job_of({"job.toml": JOB, "recording.csv": csv.encode()})).results
    assert set(FIGURES) <= set(data["accuracy_if_left_returns"])
    for name, one in data["accuracy_if_left_returns"].items():
        assert one["U"] < 0.9 * data["accuracy_uncertainty"][name]["U"]


def test_distances_between_thousands_of_balls_have_no_figures_of_performance(monkeypatch: pytest.MonkeyPatch) -> None:
    """They grow with the square of the balls, and what every error does to each of them is more than memory holds."""
    plate = analysed("plate-simulated").artefact
    rows = rows_of(plate)
    assert rows is not None
    monkeypatch.setattr("cmm_uq.analysis.machine.performance._LENGTHS", len(rows) - 1)
    assert rows_of(plate) is None
    monkeypatch.setattr("cmm_uq.analysis.machine.performance._LENGTHS", len(rows))
    assert rows_of(plate) is not None
    monkeypatch.setattr("cmm_uq.analysis.machine.performance._PAIRS", 2 * len(rows))
    assert rows_of(plate) is None
