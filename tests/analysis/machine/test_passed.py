"""A test of lengths that a machine passed: what it says of errors that no recording shows, and when it cannot have."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from benchmarks.parts import truth
from benchmarks.parts.studied import MACHINE
from cmm_uq.analysis.machine.conditional import given_recording
from cmm_uq.analysis.machine.passed import LengthsUnderTest, passed_test, prescribed
from cmm_uq.analysis.machine.recordings import FurtherRecording, FurtherRecordings, shown_by
from cmm_uq.analysis.machine.state import MachineState, StatedNoise
from cmm_uq.base.points import Floats
from cmm_uq.machine.physics.catalogue import effects
from tests.analysis.machine.test_conditional import BARS, MODELLED, SIGMA, calibration, left_out

PLAY = ["hysteresis_x", "hysteresis_y", "hysteresis_z"]
MODEL = calibration()


def test_lengths_err_by_what_a_machine_written_twice_shows() -> None:
    """Scales, squarenesses and play of :mod:`benchmarks.parts.truth`, which shares no code; other errors are as small."""
    gap, none = np.array([3.0, -2.0, 5.0]), np.zeros((3, 3))
    scale, square = np.array([20.0, -30.0, 10.0]), np.array([8.0, -5.0, 6.0])
    hidden = truth.Truth(scale, square, none, none, gap, np.zeros((3, 2)), np.ones(3))
    ends, ideal = prescribed(MACHINE), truth.Truth.of_six(dict.fromkeys(truth.SIX, 0.0))
    artefact = LengthsUnderTest(ends, MACHINE, bidirectional=True)
    assert len(ends) == 35
    along = np.linalg.norm(np.diff(ends[4::5], axis=1)[:, 0], axis=1)
    whole = np.append(np.full(4, np.linalg.norm(np.ptp(truth.TRAVEL, axis=1))), np.ptp(truth.TRAVEL, axis=1))
    np.testing.assert_allclose(along, 0.66 * whole)
    approach = np.column_stack([artefact.points.columns[f"approach_{a}"] for a in "xyz"])
    read = hidden.read(ends.reshape(-1, 3), np.zeros(3), approach)
    shown = ideal.true(read, np.zeros(3), 0 * approach).reshape(-1, 2, 3)
    errors = np.linalg.norm(np.diff(shown, axis=1)[:, 0], axis=1) - artefact.nominal
    test = passed_test(MODEL, artefact, np.ones(35), np.zeros(35), 0.0, 3)
    values = np.concatenate([scale, square, gap])
    seen = np.hstack([shown_by(test.model, one) for one in effects([*MODELLED, *PLAY])])
    np.testing.assert_allclose(seen @ values, errors, atol=2e-6)
    one_way = LengthsUnderTest(ends, MACHINE, bidirectional=False)
    assert not np.any(shown_by(passed_test(MODEL, one_way, *([np.ones(35)] * 2), 0.0, 3).model, effects(PLAY)[0]))


def stated(limit_um: float, off: Floats | None = None) -> tuple[MachineState, FurtherRecording]:
    """Bars with play beside what they show, and a test on the same machine; ``off``: (6,) that it did not correct then."""
    model = MODEL if off is None else calibration(BARS.xyz)
    mean = model.estimate().about[:6]
    state = MachineState(
        BARS.machine, effects(MODELLED), mean[None], StatedNoise(np.full(3, SIGMA)), unmodelled=left_out(*PLAY)
    )  # fmt: skip
    artefact = LengthsUnderTest(prescribed(BARS.machine), BARS.machine, bidirectional=True)
    test = passed_test(model, artefact, np.full(35, 1e-3 * limit_um), np.full(35, 1e-4), SIGMA, 3)
    keys = [(one.name, each.name) for one in state.effects for each in one.coefficients]
    corrected = mean if off is None else mean - off
    return state, replace(test, corrections=dict(zip(keys, corrected.tolist(), strict=True)))


def test_what_nobody_saw_is_no_larger_than_lengths_that_passed_let_it_be() -> None:
    """Play of 30 µm beforehand; a length along an axis has all of it, so that it is within the limit and its doubt."""
    state, test = stated(50.0)
    alone = given_recording(state, MODEL, SIGMA, 4000)
    together = given_recording(state, MODEL, SIGMA, 4000, beside=FurtherRecordings((test,)))
    assert test.passing(alone) > 1e-3
    assert [one.effect.name for one in alone.unmodelled] == PLAY
    errors, doubt = test._foretold(together)[0] - test.linear.observed, np.linalg.norm(test.noise, axis=1)
    assert np.all(np.abs(errors) < test.limit + 5 * doubt)
    assert np.any(np.abs(errors) > test.limit)
    gaps = together.draws[:, 6:].std(axis=0)
    assert np.all((gaps > 10) & (gaps < 0.8 * 30))
    assert np.all(together.draws[:, :6].std(axis=0) < 1.05 * alone.draws[:, :6].std(axis=0))


def test_a_limit_that_is_always_kept_says_nothing() -> None:
    state, test = stated(1e5)
    alone = given_recording(state, MODEL, SIGMA, 4000)
    together = given_recording(state, MODEL, SIGMA, 4000, beside=FurtherRecordings((test,)))
    assert test.passing(alone) == pytest.approx(1.0)
    assert together.draws[:, :6].mean(axis=0) == pytest.approx(alone.draws[:, :6].mean(axis=0), abs=0.1 * 40)
    gaps = together.draws[:, 6:].std()
    assert gaps == pytest.approx(30 * 1.0, rel=0.3)  # of a family of half-normal size, 30 µm


def test_a_machine_whose_recording_denies_it_cannot_have_passed() -> None:
    state, test = stated(30.0, np.array([400.0, 0, 0, 0, 0, 0]))
    alone = given_recording(state, MODEL, SIGMA, 2000)
    assert test.passing(alone) < 1e-3
