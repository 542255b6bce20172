"""Figures that a laboratory decides by its own rule: what they are, what makes a test whole, and what is refused."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from scipy.optimize import least_squares

from cmm_uq.analysis.conformity.own_rule import FIGURES, NAME
from cmm_uq.analysis.conformity.standards import statement
from cmm_uq.analysis.conformity.statement import Statement
from cmm_uq.app.commands.reading import job_of
from cmm_uq.artefacts import BUILT_IN, artefact_facts, kind_named
from cmm_uq.artefacts.bryan import Bryan
from cmm_uq.artefacts.triangle import Triangle
from cmm_uq.base.errors import CmmUqError
from cmm_uq.jobs.tables.conformity import Circumstances, ConformityFacts
from cmm_uq.jobs.tables.plan import CompleteTest
from cmm_uq.machine.model.artefact import Artefact
from tests.analysis.conformity.own_by_hand import OWN, SIDES, by_loops, changing, swept
from tests.analysis.conformity.recorded import STATED, gauge

EXAMPLES = Path(__file__).parents[3] / "examples"
WHOLE = CompleteTest(measurements=1, repeats=1, points=1)


def decided(
    artefact: Artefact, figure: str, limit: float, under: Circumstances = STATED, complete: CompleteTest | None = WHOLE
) -> Statement:
    wish = ConformityFacts(standard=NAME, characteristic=figure, limit_um=limit, complete=complete)
    return statement(wish, artefact, {}, "[[conformity]] 1", tuple(FIGURES), None, under)


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
    (statement_of("bryan", "spam"), r"characteristic = 'spam' of laboratory's own rule is not decided here: only .*span"),
    (statement_of("bryan", "span", "limit_um = -1.0"), r"limit_um.*greater than 0|limit_um.*above 0|limit_um.*> 0"),
    (statement_of("bryan", "span", "limit_arcsec = 1.0"), r"limit_arcsec.*unknown key.*limit_um"),
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
