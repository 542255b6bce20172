"""What is stated of axes stands as far as a recording does not deny it."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.linalg import null_space
from scipy.stats import multivariate_normal, norm

from benchmarks.parts import curved, machines
from benchmarks.parts.studied import MACHINE
from cmm_uq.analysis.machine.conditional import as_recorded_allows, given_recording, white
from cmm_uq.analysis.machine.regions import readings_of, with_readings
from cmm_uq.analysis.machine.state import MachineState, StatedNoise, StatementEvidence, Unmodelled, with_bounds
from cmm_uq.base.points import Machine
from cmm_uq.jobs.tables.machine import AxisFacts
from cmm_uq.machine.model import RecordingModel
from cmm_uq.machine.model.field import PERIODIC, family_of
from cmm_uq.machine.physics.effects.drives import HYSTERESIS

SIGMA = 0.7e-3
GRATING = AxisFacts(names=["x", "y", "z"], reading="exposed optical grating", source="data sheet", period_mm=0.02,
                    deviation=[[1000.0, 3.0], [10.0, 0.3]])  # fmt: skip
STATED = replace(MACHINE, read_by=dict.fromkeys("xyz", GRATING))


def recording(gap_um: float, seed: int = 2) -> tuple[RecordingModel, np.ndarray]:
    """Of a simulated machine with a step gauge whose faces are met from both sides, and its true gaps."""
    random = np.random.default_rng(seed)
    sort = curved.Sort("ordinary", size=0.3, wave_um=0.1, periods_mm=(0.01, 0.02), gap_um=gap_um)
    hidden = curved.drawn(sort, random)
    cell = machines.Cell("step gauge", "stated", 0.0)
    return RecordingModel(machines.calibrated(cell, hidden, SIGMA, 0.0, random), machines.NAMED), hidden.gap


def others(machine: Machine) -> tuple[Unmodelled, ...]:
    return with_readings(machines.UNMODELLED, machine)


def test_a_machine_of_which_nothing_is_stated_has_what_it_had() -> None:
    assert with_readings(machines.UNMODELLED, MACHINE) == tuple(machines.UNMODELLED)
    model, _ = recording(0.3)
    assert as_recorded_allows(model, machines.UNMODELLED, white(SIGMA)) == (tuple(machines.UNMODELLED), ())


def test_a_correct_statement_is_used() -> None:
    model, _ = recording(0.3)
    held, statements = as_recorded_allows(model, others(STATED), white(SIGMA))
    assert [family_of(one.effect) for one in held] == [family_of(one.effect) for one in others(STATED)]
    assert [one.of for one in statements] == ["x", "y", "z"]
    assert not any(one.denied for one in statements)


def test_a_statement_that_the_recording_denies_is_not_used_and_play_stays_as_large_as_it_is() -> None:
    """The drives have tens of micrometres of play, where scales on the axes were stated."""
    model, gap = recording(30.0)
    state = MachineState(
        STATED, machines.NAMED, np.zeros((1, 6)), StatedNoise(np.full(3, SIGMA)), unmodelled=others(STATED)
    )
    found = given_recording(state, model, SIGMA, 400)
    denied = [one.of for one in found.statements if one.denied]
    assert "xyz"[int(np.argmax(np.abs(gap)))] in denied
    names = [effect.name for effect in found.effects for _ in effect.coefficients]
    for axis, true in zip("xyz", gap, strict=True):
        drawn = found.draws[:, names.index(f"hysteresis_{axis}")]
        assert abs(drawn.mean() - true) < 5 * max(float(drawn.std()), 0.3)


def test_what_a_recording_cannot_see_it_neither_denies_nor_supports() -> None:
    model, _ = recording(30.0)
    play = tuple(one for one in others(STATED) if one.effect.name.startswith("hysteresis"))
    points = model.artefact.points
    blind = replace(points, columns={name: c for name, c in points.columns.items() if not name.startswith("approach")})
    artefact = type(model.artefact)(model.artefact.facts, blind) if hasattr(model.artefact, "facts") else None
    if artefact is None:
        artefact = machines.StepGauge(machines.ReferencedFacts(
            kind="step_gauge", u_um=machines.U_GAUGE_UM, length_mm=machines.GAUGE_MM), blind)  # fmt: skip
    held, statements = as_recorded_allows(RecordingModel(artefact, machines.NAMED), play, white(SIGMA))
    assert held == play
    assert all(np.isnan(one.ratio) and not one.denied and not one.supported for one in statements)


def test_a_bound_that_is_stated_stands_before_how_the_axis_is_read() -> None:
    state = MachineState(STATED, machines.NAMED, np.zeros((1, 6)), unmodelled=tuple(machines.UNMODELLED))
    found = with_readings(with_bounds(state, {"hysteresis_y": 0.7}).unmodelled, STATED)
    by_name = {one.effect.name: one for one in found}
    assert by_name["hysteresis_y"].sd == pytest.approx([0.7 / 1.959964])
    assert by_name["hysteresis_x"].sd == pytest.approx([2.0 / 1.959964])
    without = by_name["hysteresis_y"].unstated
    assert without is not None  # and how its axis is read before what physics allows
    assert without.sd == pytest.approx([2.0 / 1.959964])
    assert without.unstated is not None
    assert without.unstated.sd == pytest.approx([30.0])
    assert [by_name[name].stated_by for name in ("hysteresis_y", "hysteresis_x")] == ["hysteresis_y", "x"]


@pytest.mark.parametrize(("ratio", "denied", "supported"),
                         [(20.1, True, False), (19.9, False, False), (0.34, False, False), (0.33, False, True)])  # fmt: skip
def test_denied_is_what_is_twenty_times_as_probable_otherwise(ratio: float, denied: bool, supported: bool) -> None:
    one = StatementEvidence("x", ratio)
    assert (one.denied, one.supported) == (denied, supported)


def bounded_by(largest_um: dict[str, float]) -> tuple[Unmodelled, ...]:
    state = MachineState(MACHINE, machines.NAMED, np.zeros((1, 6)), unmodelled=tuple(machines.UNMODELLED))
    return with_bounds(state, largest_um).unmodelled


def waving() -> RecordingModel:
    """Of a machine whose X errs by 8 µm to either side every 90 mm, with a gauge that has faces every 20 mm."""
    random = np.random.default_rng(4)
    hidden = curved.drawn(curved.Sort("ordinary", size=0.1, wave_um=0.1, gap_um=0.1), random)
    wave, period = hidden.wave.copy(), hidden.period.copy()
    wave[0], period[0] = [8.0, 0.0], 90.0
    hidden = replace(hidden, wave=wave, period=period)
    gauge = machines.calibrated(machines.Cell("dense gauge", "stated", 0.0), hidden, SIGMA, 0.0, random)
    return RecordingModel(gauge, machines.NAMED)


@pytest.mark.long
def test_a_bound_that_the_recording_denies_is_not_used_and_a_right_one_is() -> None:
    model = waving()
    others = bounded_by({"periodic_scale_x": 0.5, "periodic_scale_y": 0.5, "hysteresis_z": 0.5})
    held, statements = as_recorded_allows(model, others, white(SIGMA))
    assert {one.of: one.denied for one in statements} == {
        "hysteresis_z": False, "periodic_scale_x": True, "periodic_scale_y": False,
    }  # fmt: skip
    by_name = {one.effect.name: one for one in held}
    assert family_of(by_name["periodic_scale_x"].effect) == PERIODIC
    assert by_name["periodic_scale_x"].sd == pytest.approx([10.0, 10.0])
    assert by_name["periodic_scale_y"].sd == pytest.approx(np.full(2, 0.5 / 2.447747))
    _, (right,) = as_recorded_allows(model, bounded_by({"periodic_scale_x": 10.0}), white(SIGMA))
    assert not right.denied


def test_the_evidence_against_a_bound_is_that_of_the_normal_distribution() -> None:
    """Play of one axis alone: as stated one normal density, in its family an integral of such over the family's size."""
    model, _ = recording(1.0)
    (one,) = (one for one in bounded_by({"hysteresis_x": 0.5}) if one.effect.name == "hysteresis_x")
    _, (found,) = as_recorded_allows(model, (one,), white(SIGMA))
    estimate = model.estimate()
    linear = estimate.linear
    basis = null_space(linear.freedoms.dense().T)
    play = model.seen(model.columns(HYSTERESIS.of("x"), (), estimate.about), estimate.about)
    mean = np.array([unknown.prior_mean for unknown in linear.unknowns])
    left = basis.T @ (linear.observed - linear.design @ mean)
    design = linear.design * [unknown.prior_sd for unknown in linear.unknowns]
    noise = np.diag((SIGMA * linear.noise_scale) ** 2) + design @ design.T

    def density(sd_um: float) -> float:
        covariance = basis.T @ (noise + sd_um**2 * play @ play.T) @ basis
        return float(multivariate_normal(None, covariance, allow_singular=False).logpdf(left))

    stated, sizes = density(0.5 / 1.959964), (np.arange(2000) + 0.5) / 1000  # up to 2: a gap of 30 µm is one
    free = np.sum(2 * norm.pdf(sizes) * np.exp([density(30.0 * size) - stated for size in sizes])) / 1000
    assert found.ratio == pytest.approx(free, rel=0.1)


def test_an_amplitude_is_never_taken_for_larger_than_physics_allows() -> None:
    assert readings_of(STATED)["x"].most_um == pytest.approx(24.47747)
