"""What a further recording will leave of a machine's errors, before it is made."""

from __future__ import annotations

import numpy as np
import pytest

from cmm_uq.analysis.machine.conditional import RecordedField, given_recording, white
from cmm_uq.analysis.machine.recordings import FurtherRecording, FurtherRecordings
from cmm_uq.analysis.machine.state import MachineState, Unmodelled
from cmm_uq.analysis.parts.foreseen import EACH, foreseen
from cmm_uq.base.errors import CmmUqError
from cmm_uq.base.points import Floats
from cmm_uq.machine.physics.catalogue import effects
from cmm_uq.maths.inference.noise import Sizes
from tests.analysis.machine.test_conditional import BARS, MODELLED
from tests.analysis.machine.test_recordings import FIRST, SIGMA, further, of

OTHERS = ~FIRST
MACHINE = BARS.machine


def beside(points: Floats, times: float = 1.0) -> FurtherRecordings:
    model = of(points)
    noise = times * SIGMA * np.sqrt(2) * np.eye(int(model.used.sum()))
    return FurtherRecordings((FurtherRecording(model, noise),))


def known(errors: tuple[Unmodelled, ...] = ()) -> MachineState:
    """By the first half of the bars."""
    certificate = MachineState(MACHINE, effects(MODELLED), np.zeros((1, len(MODELLED))), unmodelled=errors)
    return given_recording(certificate, of(FIRST), SIGMA, seed=1)


def sd_of(state: MachineState) -> Floats:
    """(k,) of the named errors, of one machine in the root mean square."""
    each = state.draws[:, : len(MODELLED)].reshape(-1, EACH, len(MODELLED))
    return np.asarray(np.sqrt(each.var(axis=1, ddof=1).mean(axis=0)))


def expected(recordings: FurtherRecordings) -> Floats:
    """In closed form, of all recordings together: independent of what they show."""
    field = RecordedField.of(of(FIRST), (), beside=recordings.recordings).field
    covariance = field.normal(white(SIGMA), np.zeros(0))[1]
    return np.asarray(np.sqrt(np.diag(covariance)[: len(MODELLED)]))


@pytest.mark.parametrize("times", [0.5, 1.0])
def test_what_is_left_is_what_all_recordings_together_leave(times: float) -> None:
    """2000 draws know a standard deviation to 1.6 %; another noise of the further recording is another answer."""
    state, of_others = known(), beside(OTHERS, times)
    found = sd_of(foreseen(state, of(FIRST), of_others))
    np.testing.assert_allclose(found / expected(of_others), 1.0, atol=0.07)
    assert np.max(np.abs(found / expected(beside(OTHERS, 2 * times)) - 1)) > 0.1


def test_a_recording_that_shows_nothing_leaves_what_there_is() -> None:
    state = known(further())
    found = sd_of(foreseen(state, of(FIRST), beside(OTHERS, 1e4), machines=50))
    np.testing.assert_allclose(found / state.draws[:, : len(MODELLED)].std(axis=0), 1.0, atol=0.15)


def test_more_lengths_leave_no_more() -> None:
    state, some = known(further()), OTHERS & (BARS.measurement <= 16)
    few, many = (sd_of(foreseen(state, of(FIRST), beside(points))) for points in (some, OTHERS))
    today = state.draws[:, : len(MODELLED)].std(axis=0)
    assert np.all(few < 1.1 * today)
    assert np.all(many < 1.05 * few)
    assert np.all(many < today)


def test_sizes_are_weighed_by_the_density_of_the_further_recording_given_the_others() -> None:
    """p(y₂ | y₁, s) as p(y₁, y₂ | s) / p(y₁ | s), which others compute."""
    others = beside(OTHERS)
    together, alone = (RecordedField.of(of(FIRST), further(), beside=some).field for some in (others.recordings, ()))
    scales = np.random.default_rng(3).uniform(0.02, 0.5, (6, len(alone.families)))
    each = Sizes(*(np.repeat(part, 6, axis=0) for part in vars(white(SIGMA)).values()))
    found = together.log_densities(each, scales, together.combined[:, None], int(others.recordings[0].model.used.sum()))
    density = together.log_likelihood(each, scales) - alone.log_likelihood(each, scales)
    np.testing.assert_allclose(found[:, 0] - found[0, 0], density - density[0], atol=2e-3)
    assert np.ptp(density) > 1


def test_a_machine_of_which_no_recording_is_at_hand_is_refused() -> None:
    state = MachineState(MACHINE, effects(MODELLED), np.zeros((1, len(MODELLED))))
    with pytest.raises(CmmUqError, match="follows from recordings alone"):
        foreseen(state, of(FIRST), beside(OTHERS))
