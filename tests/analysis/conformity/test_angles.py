"""Limits in arcseconds: of the angles of a triangle, and of the squareness that a self-calibrating plate shows."""

from __future__ import annotations

import json
from functools import cache
from pathlib import Path

import numpy as np
import pytest

from cmm_uq.analysis.conformity.own_rule import FIGURES, NAME
from cmm_uq.analysis.conformity.standards import statement
from cmm_uq.analysis.conformity.statement import Statement
from cmm_uq.app.commands.report import analyse, outcome_of
from cmm_uq.artefacts.shift.plane import PlaneShiftResult
from cmm_uq.base.errors import CmmUqError
from cmm_uq.certificate.sections.conformity import decision_block
from cmm_uq.certificate.verify.decisions import _entry
from cmm_uq.jobs.tables.conformity import ConformityFacts
from cmm_uq.machine.model.artefact import Artefact
from tests.analysis.conformity.own_by_hand import OWN, SIDES, by_loops
from tests.analysis.conformity.recorded import STATED, gauge
from tests.conftest import ROOT

ARCSEC_PER_RAD = 180 * 3600 / np.pi
EXAMPLE = ROOT / "examples" / "shift-plate-simulated"
GRADES = {"fail": 0, "conditional fail": 1, "undecided": 2, "conditional pass": 3, "pass": 4}


def decided(
    artefact: Artefact, figure: str, arcsec: float, complete: object = None, rule: str = "ISO 14253-1"
) -> Statement:
    wish = ConformityFacts(standard=NAME, characteristic=figure, limit_arcsec=arcsec, complete=complete, rule=rule)
    return statement(wish, artefact, {}, "[[conformity]] 1", tuple(FIGURES), None, STATED)


def angles_by_hand(artefact: Artefact) -> list[float]:
    """Errors of the triangle's angles in arcseconds."""
    return [arc / min(SIDES[i], SIDES[i - 1]) * ARCSEC_PER_RAD for arc, i in by_loops(artefact.points)[1]]


def test_the_angle_that_is_worst_decides_and_not_the_longest_arc() -> None:
    triangle, _, _, _, _, complete = OWN["angle error"]("complete")
    by_hand = angles_by_hand(triangle)
    worst = max(by_hand, key=abs)
    found = decided(triangle, "angle error", 60.0, complete)
    arm = found.named.length_mm
    assert arm is not None
    assert found.named.error_um / 1e3 / arm * ARCSEC_PER_RAD == pytest.approx(worst, rel=1e-4)
    assert found.limit_um == pytest.approx(60.0 / ARCSEC_PER_RAD * arm * 1e3)
    ratios = sorted(abs(one.error_um) / one.limit_um for one in found.errors)
    assert ratios == pytest.approx(sorted(abs(one) / 60.0 for one in by_hand), rel=1e-4, abs=1e-7)
    assert f"against {60:g} ″" in str(found.remarks[1])


def test_it_passes_below_its_limit_by_more_than_its_u_and_fails_above() -> None:
    triangle, _, _, _, _, complete = OWN["angle error"]("complete")
    worst = max(map(abs, angles_by_hand(triangle)))
    found = decided(triangle, "angle error", worst, complete)
    arm = found.named.length_mm
    u = found.u_um / 1e3 / arm * ARCSEC_PER_RAD
    assert decided(triangle, "angle error", worst + 3 * u, complete).outcome == "pass"
    assert decided(triangle, "angle error", worst + 0.5 * u, complete).outcome == "undecided"
    assert decided(triangle, "angle error", worst - 3 * u, complete).outcome == "fail"
    assert decided(triangle, "angle error", worst + 3 * u, None).outcome == "incomplete"


@pytest.mark.parametrize("figure", ["angle error", "squareness"])
def test_a_wider_limit_never_makes_it_worse(figure: str) -> None:
    artefact, _, _, _, _, complete = OWN[figure]("complete")
    grades = [GRADES[decided(artefact, figure, limit, complete).outcome] for limit in np.geomspace(0.5, 500.0, 40)]
    assert grades == sorted(grades)
    assert set(grades) >= {0, 4}


def test_only_angles_have_limits_in_arcseconds() -> None:
    for figure in ("span", "flatness", "mean error"):
        with pytest.raises(CmmUqError, match=f"{figure} of laboratory's own rule is no angle") as refused:
            decided(OWN[figure]("complete")[0], figure, 5.0)
        assert "limit_um" in str(refused.value.fix)
    wish = ConformityFacts(standard="ISO 10360-2:2009", limit_arcsec=5.0)
    with pytest.raises(CmmUqError, match="is no angle"):
        statement(
            wish, gauge(lengths=[[20.0, 400.0]] * 7), {}, "[[conformity]] 1", ("calibrated lengths",), None, STATED
        )


@cache
def plate(folder: Path) -> PlaneShiftResult:
    begin = '\n[[conformity]]\nstandard = "laboratory\'s own rule"\ncharacteristic = '
    complete = "\ncomplete = { measurements = 7, repeats = 1, points = 15 }\n"
    added = "".join(f'{begin}"{figure}"\n{limit}{complete}' for figure, limit in (
        ("squareness", "limit_arcsec = 12.0"), ("straightness", "limit_um = 9.0"), ("linearity", "limit_um = 5.0"),
    ))  # fmt: skip
    rated = '\n[rated_conditions]\ndeclared = { by = "the test", reason = "nothing grows in a simulation" }\n'
    for name in ("recording.csv", "job.toml"):
        (folder / name).write_bytes((EXAMPLE / name).read_bytes() + (added + rated).encode() * (name == "job.toml"))
    found = analyse(folder)
    assert isinstance(found, PlaneShiftResult)
    return found


def error(x: np.ndarray, y: np.ndarray) -> np.ndarray:
    """What was put into the example, mm: its remarks."""
    yaw = 5e-6 * np.sin(x / 150) + 1e-5 * x / 600
    return np.array([
        0.010 * np.sin(x / 90) + 20e-6 * x + 0.003 * np.sin(y / 100) - 60e-6 * y - y * yaw,
        -0.008 * np.cos(y / 110) - 10e-6 * y + 0.004 * (x / 300 - 1) ** 2 + 0.002 * np.sin(x / 60),
    ])  # fmt: skip


@pytest.mark.long
def test_a_plate_s_squareness_straightness_and_linearity_are_decided(tmp_path: Path) -> None:
    found = plate(tmp_path)
    square, straight, linear = found.statements
    (x, y), middle = found.estimate.positions, np.linspace(0, 1, 201)
    along_x, along_y = (ends[0] + middle * np.ptp(ends) for ends in (x, y))
    Lx, Ly = np.ptp(along_x), np.ptp(along_y)
    # how far each axis moves across the other one, from end to end, where the other stands anywhere
    of_y = np.mean([error(at, along_y)[0] for at in along_x], axis=0)
    of_x = np.mean([error(along_x, at)[1] for at in along_y], axis=0)
    S = -((of_y[-1] - of_y[0]) / Ly + (of_x[-1] - of_x[0]) / Lx)
    assert square.named.error_um == pytest.approx(S * min(Lx, Ly) * 1e3, abs=3 * square.u_um)
    assert square.u_um < 0.5
    assert square.limit_um == pytest.approx(12.0 / ARCSEC_PER_RAD * min(Lx, Ly) * 1e3)
    assert square.outcome == "fail"
    names = {str(one.position): one for one in straight.errors}
    assert set(names) == {"straightness of X along Y", "straightness of Y along X"}
    for name, curve, at in (("X along Y", of_x, along_x), ("Y along X", of_y, along_y)):
        off = curve - curve[0] - (curve[-1] - curve[0]) * (at - at[0]) / np.ptp(at)
        one = names[f"straightness of {name}"]
        assert one.error_um == pytest.approx(np.ptp(off) * 1e3, abs=3 * one.u_um)
        assert one.length_mm == pytest.approx(np.ptp(at))
    assert (straight.outcome, linear.outcome, len(linear.errors)) == ("pass", "fail", 2)
    results = json.loads(json.dumps(outcome_of(found).results, default=str))
    entry = results["conformity"][0]
    assert entry["limit_arcsec"] == 12.0
    assert not list(_entry(entry))
    entry["errors"][0]["limit_um"] *= 1.3
    assert any("limit of the angle" in problem for _, problem, _, _ in _entry(entry))
    assert str(decision_block(square).limit).endswith("mm; 12 ″")


@pytest.mark.parametrize("figure", ["straightness", "squareness"])
def test_an_axis_by_itself_has_no_straightness(figure: str, tmp_path: Path) -> None:
    source = ROOT / "examples" / "shift-simulated"
    added = f'\n[[conformity]]\nstandard = "laboratory\'s own rule"\ncharacteristic = "{figure}"\nlimit_um = 5.0\n'
    for name in ("recording.csv", "job.toml"):
        (tmp_path / name).write_bytes((source / name).read_bytes() + added.encode() * (name == "job.toml"))
    with pytest.raises(CmmUqError, match=f"the {figure} is none of an axis by itself"):
        analyse(tmp_path)
