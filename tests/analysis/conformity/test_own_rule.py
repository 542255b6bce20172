"""Figures that a laboratory decides by its own rule: what they are, what makes a test whole, and what is refused."""

from __future__ import annotations

from dataclasses import replace
from functools import partial
from pathlib import Path

import numpy as np
import pytest
from scipy.optimize import least_squares

from cmm_uq.analysis.conformity.as_recorded import OutsideReadings
from cmm_uq.analysis.conformity.own_rule import EVALUATED, FIGURES, NAME, titled
from cmm_uq.analysis.conformity.standards import statement
from cmm_uq.analysis.conformity.statement import Statement
from cmm_uq.app.commands.reading import job_of
from cmm_uq.artefacts import BUILT_IN, artefact_facts, kind_named
from cmm_uq.artefacts.bryan import Bryan
from cmm_uq.artefacts.plane import PlaneSurface
from cmm_uq.artefacts.triangle import Triangle
from cmm_uq.base.errors import CmmUqError
from cmm_uq.base.languages.translation import translated
from cmm_uq.base.points import Machine, Points
from cmm_uq.jobs.tables.artefact import ArtefactFacts
from cmm_uq.jobs.tables.conformity import Circumstances, ConformityFacts, TestUncertainty
from cmm_uq.jobs.tables.plan import CompleteTest
from cmm_uq.machine.model.artefact import Artefact
from tests.analysis.conformity.own_by_hand import OWN, SIDES, by_loops, changing, swept
from tests.analysis.conformity.recorded import STATED, gauge
from tests.analysis.conformity.test_as_recorded import numbered_lines
from tests.recordings import screened, with_columns

EXAMPLES = Path(__file__).parents[3] / "examples"
WHOLE = CompleteTest(measurements=1, repeats=1, points=1)


def decided(
    artefact: Artefact, figure: str, limit: float, under: Circumstances = STATED, complete: CompleteTest | None = WHOLE
) -> Statement:
    wish = ConformityFacts(standard=NAME, characteristic=figure, limit_um=limit, complete=complete)
    return statement(wish, artefact, {}, "[[conformity]] 1", tuple(FIGURES), None, under)


def screened_and_decided(
    points: Points, facts: ArtefactFacts, figure: str, limit: float, under: Circumstances, aside: tuple[int, ...] = ()
) -> Statement:
    """As every command does it."""
    points = numbered_lines(points)
    recording = screened(points, facts, needed=set(), set_aside=aside, where="recording.csv")
    observe = partial(kind_named(facts.kind).observing("decided"), facts)
    left_out = OutsideReadings.of(points, recording.findings, observe)
    wish = ConformityFacts(standard=NAME, characteristic=figure, limit_um=limit, complete=WHOLE)
    return statement(wish, observe(recording.points), {}, "[[conformity]] 1", tuple(FIGURES), None, under, left_out)


def example(name: str, added: str) -> dict[str, bytes]:
    files = {file: (EXAMPLES / name / file).read_bytes() for file in ("job.toml", "recording.csv")}
    return {**files, "job.toml": files["job.toml"] + added.encode()}


def statement_of(name: str, figure: str, limit: str = "limit_um = 10.0", key: str = "u_repeat_um") -> str:
    return (
        f'\n[[conformity]]\nstandard = "{NAME}"\ncharacteristic = "{figure}"\n{limit}\n'
        f"[test_uncertainty]\n{key} = 0.3\n[rated_conditions]\ntemperature_c = [18.0, 22.0]\n"
    )


def test_every_figure_is_offered_by_some_kind_and_is_decided_by_hand() -> None:
    offered = {word for kind in BUILT_IN.values() for word in kind.tested}
    assert set(FIGURES) <= offered
    assert set(FIGURES) == set(OWN)


def test_errors_of_a_gauge_with_their_mean_and_standard_deviation() -> None:
    """Five lengths thrice in seven places: one is 6 µm off, three are 3 µm off; u = 0.5 µm in a metre."""
    every = [[20.0, 100.0, 200.0, 300.0, 320.0]] * 7
    artefact = gauge(lengths=every, errors={(2, 1, 300.0): -6.0, **{(3, r, 100.0): 3.0 for r in (1, 2, 3)}})
    lengths = np.tile(every[0], 21)
    errors = np.zeros(105)
    errors[0], errors[1:4] = -6.0, 3.0
    u = 0.5e-3 * lengths
    mean, sd = decided(artefact, "mean error", 10.0), decided(artefact, "standard deviation of errors", 10.0)
    assert mean.errors[0].error_um == pytest.approx(errors.mean(), abs=1e-6)
    assert mean.u_um == pytest.approx(u.mean())
    assert sd.value_um == pytest.approx(errors.std(ddof=1), abs=1e-6)
    assert sd.u_um == pytest.approx(np.sqrt(np.sum(u**2) / 104))
    each = decided(artefact, "error", 10.0)
    assert (each.value_um, each.u_um) == (pytest.approx(6.0, abs=1e-6), pytest.approx(0.15))
    assert (each.named.measurement, each.named.length_mm, len(each.errors)) == (2, 300.0, 105)


def test_the_limit_of_an_error_grows_with_its_length() -> None:
    artefact = gauge(lengths=[[20.0, 400.0]] * 7, errors={(1, 1, 20.0): 4.1, (2, 1, 400.0): 7.9})
    wish = ConformityFacts.model_validate({"standard": NAME, "characteristic": "error", "mpe": "4 + L/100"})
    found = statement(wish, artefact, {}, "[[conformity]] 1", tuple(FIGURES), None, STATED)
    assert {(one.length_mm, one.limit_um) for one in found.errors} == {(20.0, 4.2), (400.0, 8.0)}
    assert (found.named.length_mm, found.finding) == (400.0, "undecided")  # 0.1 µm of room, half its u; of 20 mm ten u


def test_a_direction_point_is_no_point_of_a_complete_test() -> None:
    """Eight points of contact and the one before contact are eight."""
    x, y = (part.ravel() for part in np.meshgrid([100.0, 200.0, 300.0], [100.0, 200.0, 300.0]))
    xyz, one = np.column_stack([x, y, np.append(-390.0, np.full(8, -400.0))]), np.ones(9, dtype=np.int64)
    surface = PlaneSurface(artefact_facts(kind="plane", form_um=0.2), Points(xyz, one, np.arange(9), one, Machine()))
    under = replace(STATED, uncertainty=TestUncertainty(u_form_um=0.1))
    for points, outcome in ((8, "pass"), (9, "incomplete")):
        asked = CompleteTest(measurements=1, repeats=1, points=points)
        assert decided(surface, "flatness", 5.0, under, asked).outcome == outcome


@pytest.mark.parametrize("key", ["u_blocks_um", "u_cylinders_um"])
@pytest.mark.parametrize("figure", ["error", "mean error", "angle error"])
def test_blocks_and_cylinders_each_state_how_uncertain_they_are(figure: str, key: str) -> None:
    artefact, under, value, _, _, complete = OWN["mean error"]("complete")
    facts = artefact._facts.model_copy(update={key: 0.0})
    found = decided(Triangle(facts, artefact.points), figure, 10 * abs(value) + 1e3, under, complete)
    assert (found.finding, found.outcome) == ("pass", "incomplete")
    (missing,) = found.missing_with_remedies
    assert "calibration of the artefact" in missing
    assert key in missing


@pytest.mark.parametrize("figure", OWN)
def test_without_saying_what_is_complete_nothing_passes(figure: str) -> None:
    artefact, under, value, _, _, complete = OWN[figure]("complete")
    limit = 10 * abs(value)
    assert decided(artefact, figure, limit, under, complete).outcome == "pass"
    found = decided(artefact, figure, limit, under, None)
    assert (found.outcome, found.scope) == ("incomplete", "partial")
    assert "complete = {" in str(found.missing_with_remedies[0])
    for key in ("measurements", "repeats", "points"):
        more = complete.model_copy(update={key: getattr(complete, key) + 1})
        assert decided(artefact, figure, limit, under, more).outcome == "incomplete", key


def test_a_certificate_names_the_rule_in_its_language_and_a_standard_as_it_is() -> None:
    assert translated(titled(NAME), "de") == "eigene Regel des Laboratoriums"
    assert translated(titled("ISO 10360-2:2009"), "de") == "ISO 10360-2:2009"
    assert titled(NAME) == NAME


@pytest.mark.parametrize("figure", OWN)
def test_errors_have_two_sides_and_spreads_one(figure: str) -> None:
    artefact, under, value, _, signed, complete = OWN[figure]("complete")
    found = decided(artefact, figure, 10 * abs(value), under, complete)
    assert found.signed == signed == (figure in ("error", "mean error", "angle error", "squareness"))
    assert found.named.error_um == pytest.approx(value, abs=2e-5)


def test_a_radius_read_too_long_is_an_error_above_zero() -> None:
    bar, points = swept("complete", certified=True)
    xyz = points.xyz.copy()
    xyz[7] += 50e-3 * (xyz[7] - [440.0, 270.0, -240.0]) / 250.0
    longer = Bryan(artefact_facts(kind="bryan", length_mm=250.0, u_um=0.2), points.at(xyz))
    counts = np.ones(60, dtype=bool)
    assert longer.figures(counts)["error"].values[7] - bar.figures(counts)["error"].values[7] > 0.04


def test_the_budget_is_that_of_the_value_named() -> None:
    artefact, under, *_ = OWN["error"]("complete")
    found = decided(artefact, "error", 100.0, under)
    assert found.budget is not None
    assert 1e3 * found.budget.u == pytest.approx(found.u_um)
    assert found.budget.lines[0].u == pytest.approx(0.2e-3)


def test_a_surface_of_unknown_form_makes_no_pass() -> None:
    _, under, value, _, _, complete = OWN["flatness"]("complete")
    plane = OWN["flatness"]("no u")[0]
    under = replace(under, uncertainty=TestUncertainty(u_form_um=0.3))
    found = decided(plane, "flatness", 10 * value, under, complete)
    assert (found.outcome, *found.missing) == (
        "incomplete",
        "uncertainty: the form deviation of the surface is not stated",
    )


@pytest.mark.parametrize("figure", [one for one in OWN if FIGURES[one][2] != EVALUATED])
def test_copies_are_in_no_figure(figure: str) -> None:
    """Worked from all but the copies."""
    artefact, under, value, u, _, complete = OWN[figure]("copied")
    found = decided(artefact, figure, 10 * abs(value), under, complete)
    assert found.outcome == "incomplete"
    assert (found.value_um, found.u_um) == (pytest.approx(abs(value), abs=2e-5), pytest.approx(u))


def test_lengths_are_those_at_20_degrees() -> None:
    """Two kelvin warm, all radii and sides are longer by 2 × 11.5 ppm, and nothing is found of it."""
    warm = np.full(60, 22.0)
    bar, points = swept("complete", certified=True)
    longer = points.at(np.array([440.0, 270.0, -240.0]) + (points.xyz - [440.0, 270.0, -240.0]) * (1 + 23e-6))
    facts = artefact_facts(kind="bryan", length_mm=250.0, u_um=0.2, cte_per_k=11.5e-6)
    found = Bryan(facts, with_columns(longer, temp_artefact_c=warm)).figures(np.ones(60, dtype=bool))
    for name, figure in bar.figures(np.ones(60, dtype=bool)).items():
        np.testing.assert_allclose(found[name].values, figure.values, atol=1e-6)

    cold = OWN["mean error"]("complete")[0]
    facts = artefact_facts(kind="triangle", blocks_mm=[380.0, 230.0, 280.0], cylinders_mm=[20.0] * 3, cte_per_k=11.5e-6)
    longer = with_columns(cold.points.at(cold.points.xyz * (1 + 23e-6)), temp_artefact_c=np.full(18, 22.0))
    found = Triangle(facts, longer).figures(np.ones(18, dtype=bool))
    for name, figure in cold.figures(np.ones(18, dtype=bool)).items():
        np.testing.assert_allclose(found[name].values, figure.values, atol=1e-7)


def test_three_points_have_no_flatness() -> None:
    plane = OWN["flatness"]("complete")[0]
    counts = (plane.points.measurement == 1) & (plane.points.point <= 3)
    assert plane.figures(counts) == {}


def test_what_the_screening_leaves_out_is_in_the_decision() -> None:
    """One of sixty readings is 2 mm off: left out of the estimates, it fails, whatever the limit."""
    _, points = swept("complete", certified=True)
    xyz = points.xyz.copy()
    xyz[7] += 2.0 * (xyz[7] - [440.0, 270.0, -240.0]) / 250.0
    facts = artefact_facts(kind="bryan", length_mm=250.0, u_um=0.2)
    for figure in ("error", "span", "repeatability"):
        under = STATED if figure == "error" else changing(0.3)
        found = screened_and_decided(points.at(xyz), facts, figure, 1e4, under)
        assert (found.outcome, found.named.set_aside) == ("fail", True), figure
        assert screened_and_decided(points, facts, figure, 1e4, under).outcome == "pass"


def test_what_the_laboratory_sets_aside_is_decided_as_recorded() -> None:
    _, points = swept("complete", certified=True)
    facts = artefact_facts(kind="bryan", length_mm=250.0, u_um=0.2)
    whole = screened_and_decided(points, facts, "error", 1e4, STATED)
    aside = screened_and_decided(points, facts, "error", 1e4, STATED, aside=(4,))
    assert [one.error_um for one in aside.errors] == pytest.approx([one.error_um for one in whole.errors])
    gauged = gauge(errors={(1, 1, 20.0): 9.0})
    length = artefact_facts(kind="step_gauge", length_mm=800.0, u_um="L/2000")
    mean = screened_and_decided(gauged.points, length, "mean error", 1e4, STATED, aside=(4,))
    assert mean.value_um == pytest.approx(9.0 / 105, abs=1e-6)


def test_a_recording_corrected_is_decided_as_corrected() -> None:
    """Beside a reading that was left out, figures of the corrected readings are those, and not the recorded ones."""
    _, points = swept("complete", certified=True)
    facts, centre = artefact_facts(kind="bryan", length_mm=250.0, u_um=0.2), np.array([440.0, 270.0, -240.0])
    xyz = points.xyz.copy()
    xyz[7] += 2.0 * (xyz[7] - centre) / 250.0
    points, observe = numbered_lines(points.at(xyz)), partial(Bryan, facts)
    recording = screened(points, facts, needed=set(), set_aside=(), where="recording.csv")
    left_out = OutsideReadings.of(points, recording.findings, observe)
    assert np.flatnonzero(~left_out.kept).tolist() == [7]
    corrected = recording.points.at(centre + (recording.points.xyz - centre) * (1 + 100e-6))
    found = left_out.whole(observe(corrected)).figures(np.ones(60, dtype=bool))["error"].values
    mixed = centre + (xyz - centre) * (1 + 100e-6 * left_out.kept)[:, None]
    by_itself, recorded = (
        observe(points.at(each)).figures(np.ones(60, dtype=bool))["error"].values for each in (mixed, xyz)
    )
    np.testing.assert_allclose(found, by_itself, atol=1e-9)
    assert np.abs(found - recorded).max() > 0.01


def test_lengths_corrected_beside_one_left_out_are_decided_as_corrected() -> None:
    facts = artefact_facts(kind="step_gauge", length_mm=800.0, u_um="L/2000")
    observe = partial(kind_named("step_gauge").observing("decided"), facts)
    points = gauge(errors={(2, 2, 20.0): 5000.0}).points
    points = numbered_lines(points)
    recording = screened(points, facts, needed=set(), set_aside=(), where="recording.csv")
    left_out = OutsideReadings.of(points, recording.findings, observe)
    assert left_out.artefact is not None
    corrected = observe(recording.points.at(recording.points.xyz * (1 + 50e-6)))
    found = left_out.whole(corrected).figures(np.ones(len(points), dtype=bool))["error"]
    known = np.abs(found.values) < 1.0
    np.testing.assert_allclose(found.values[known], 50e-6 * found.lengths[known], atol=1e-6)


def test_a_larger_error_of_one_reading_has_no_better_decision() -> None:
    bar, points = swept("complete", certified=True)
    facts, order = artefact_facts(kind="bryan", length_mm=250.0, u_um=0.2), ["pass", "undecided", "fail"]
    for figure in ("error", "span", "standard deviation", "repeatability"):
        under = STATED if figure == "error" else changing(0.3)
        at = decided(bar, figure, 1e4, under).value_um
        seen = []
        for size in (0.0, 5e-3, 10e-3, 20e-3, 40e-3, 80e-3):
            xyz = points.xyz.copy()
            xyz[7] += size * (xyz[7] - [440.0, 270.0, -240.0]) / 250.0
            seen.append(order.index(decided(Bryan(facts, points.at(xyz)), figure, at + 2.0, under).finding))
        assert seen == sorted(seen)
        assert (seen[0], seen[-1]) == (0, 2)


def test_a_larger_u_has_no_better_decision() -> None:
    bar, _ = swept("complete", certified=False)
    value = decided(bar, "span", 1e4, changing(0.1)).value_um
    for room, worse in (
        (1.0, ["pass", "pass", "undecided", "undecided"]),
        (-1.0, ["fail", "fail", "undecided", "undecided"]),
    ):
        assert [decided(bar, "span", value + room, changing(u)).finding for u in (0.1, 0.5, 1.0, 5.0)] == worse


def test_the_six_are_not_corrected_where_positions_leave_one_open() -> None:
    bar, points = swept("complete", certified=False)
    some = points.select(points.measurement <= 4)
    few = Bryan(artefact_facts(kind="bryan"), some)
    assert set(few.figures(np.ones(len(some), dtype=bool))) == {"repeatability", "span", "standard deviation"}
    with pytest.raises(CmmUqError, match=r"do not determine the span corrected of the bryan.*Record more places"):
        decided(few, "span corrected", 10.0, changing(0.3))
    assert {"span corrected", "pivot offset"} <= set(bar.figures(np.ones(len(points), dtype=bool)))


def test_an_error_needs_a_certified_length() -> None:
    bar, _ = swept("complete", certified=False)
    with pytest.raises(CmmUqError, match=r"calibrated lengths, and the bryan has none.*Give length_mm"):
        decided(bar, "error", 10.0)


def test_figures_of_the_examples_as_the_pages_print_them() -> None:
    read = job_of(example("bryan-simulated", ""))
    own = kind_named("bryan").observing("")(read.facts.artefact, read.points, where=None)
    counts = np.ones(len(read.points), dtype=bool)
    xyz = read.points.xyz
    fitted = least_squares(lambda p: np.linalg.norm(xyz - p[:3], axis=1) - p[3], [450.0, 600.0, -550.0, 400.0]).x
    radii = np.linalg.norm(xyz - fitted[:3], axis=1)
    found = {name: float(figure.values.max()) * 1e3 for name, figure in own.figures(counts).items()}
    assert found["span"] == pytest.approx(np.ptp(radii) * 1e3, abs=1e-4) == pytest.approx(30.04, abs=0.005)
    assert found["standard deviation"] == pytest.approx(np.sqrt(radii.var() * 48 / 44) * 1e3, abs=1e-4)
    rounded = {name: round(value, 1) for name, value in found.items()}
    assert rounded == {"span": 30.0, "standard deviation": 7.1, "span corrected": 5.5,
                       "standard deviation corrected": 1.2, "pivot offset": 7.5}  # fmt: skip

    read = job_of(example("triangle-simulated", ""))
    own = kind_named("triangle").observing("")(read.facts.artefact, read.points, where=None)
    sides = np.array([[np.linalg.norm(np.roll(p, -1, axis=0) - p, axis=1)] for p in read.points.xyz.reshape(-1, 3, 3)])
    errors = (sides[:, 0] - [500.0, 300.0, 400.0]).ravel() * 1e3
    found = {name: figure.values * 1e3 for name, figure in own.figures(np.ones(189, dtype=bool)).items()}
    np.testing.assert_allclose(found["error"], errors, atol=1e-8)
    assert found["mean error"] == pytest.approx(errors.mean()) == pytest.approx(-4.6, abs=0.05)
    assert found["standard deviation of errors"] == pytest.approx(errors.std(ddof=1)) == pytest.approx(5.0, abs=0.05)
    assert np.abs(found["error"]).max() == pytest.approx(11.9, abs=0.05)


def test_an_angle_that_is_a_second_of_arc_too_wide_is_that_arc_of_the_shorter_side() -> None:
    """Turned about corner 1, side 3–1 keeps its length."""
    triangle = OWN["angle error"]("complete")[0]
    c, a, b = SIDES
    arc, cos = np.pi / 648_000, (b**2 + c**2 - a**2) / (2 * b * c)
    turned = np.arccos(cos) + arc
    one = triangle.points.select(np.arange(3)).at(
        np.array([[0.0, 0.0, 0.0], [c, 0.0, 0.0], [b * np.cos(turned), b * np.sin(turned), 0.0]])
    )
    found = Triangle(triangle._facts, one).figures(np.ones(3, dtype=bool))
    assert found["angle error"].values[0] == pytest.approx(min(b, c) * arc, rel=1e-6)
    assert by_loops(one)[1][0][0] == pytest.approx(min(b, c) * arc, rel=1e-6)


@pytest.mark.parametrize(("added", "message"), [
    (statement_of("bryan", "spam"), r"characteristic = 'spam' of laboratory's own rule is not decided here: only .*pivot"),
    (statement_of("bryan", "span", "limit_um = -1.0"), r"limit_um.*greater than 0|limit_um.*above 0|limit_um.*> 0"),
    (statement_of("bryan", "span", "limit_arcsec = -1.0"), r"limit_arcsec.*(greater than|above|>) 0"),
    (statement_of("bryan", "span", "limit_arcsec = 1.0\nlimit_um = 1.0"), r"either limit_um.*limit_arcsec"),
    (statement_of("bryan", "span", "limit_um = 1.0\ncomplete = { measurements = 0, repeats = 1, points = 1 }"),
     r"complete\.measurements"),
    (statement_of("bryan", "span", "limit_um = 1.0\ncomplete = { measurements = 9 }"), r"complete\.(repeats|points)"),
    (statement_of("bryan", "span", key="u_form_um"), r"needs the uncertainty.*states no u_repeat_um"),
])  # fmt: skip
def test_what_cannot_be_meant_is_refused_with_its_key(added: str, message: str) -> None:
    with pytest.raises(CmmUqError, match=message):
        job_of(example("bryan-simulated", added))


def test_a_figure_of_another_kind_is_refused_with_those_that_there_are() -> None:
    bar, _ = swept("complete", certified=False)
    wish = ConformityFacts(standard=NAME, characteristic="flatness", limit_um=1.0)
    with pytest.raises(CmmUqError, match=r"not decided on a bryan.*one of: error, repeatability, span, "):
        statement(wish, bar, {}, "[[conformity]] 1", kind_named("bryan").tested, None, STATED)
