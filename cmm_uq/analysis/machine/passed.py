"""A test of lengths that a machine passed: each was indicated within its limit, and nobody has the errors themselves.

    |t_j| ≤ MPE(L_j),   t = T·(β + d − g) + Σ_f s_f · T_f·c_f + ε

T: what of each tested length the errors are that all recordings show. Of the repeats the mean is taken, which lies within the
limit if each does. ε: of that mean by the noise of readings, and by the uncertainty of the test, of all lengths together and,
as that is not known, of each line by itself besides. A pass with a guard band says more; what is taken here holds of both.
"""

from __future__ import annotations

import numpy as np

from cmm_uq.analysis.conformity.plans import ISO_10360_2
from cmm_uq.analysis.machine.recordings import FurtherRecording, model_of_machine
from cmm_uq.base.messages import NOTHING
from cmm_uq.base.points import AXES, Floats, Machine, Points
from cmm_uq.machine.model.artefact import Artefact
from cmm_uq.machine.model.measurement import RecordingModel

_DIAGONALS = np.array([[x, y, 1.0] for x in (1.0, -1.0) for y in (1.0, -1.0)])
_LEAST = 1e-6  # mm: noise without which lengths that differ by nothing else would be one
_SIDEWAYS, _PARALLEL = 1e-6, 2  # part of a line below which an axis does not move; digits of a direction


class LengthsUnderTest(Artefact):
    """m lengths between 2m points, each where it was tested; there is no other recording of them."""

    kind, title = "passed_test", NOTHING

    def __init__(self, ends: Floats, machine: Machine, *, bidirectional: bool) -> None:
        """``ends``: (m, 2, 3) in the recorded frame, mm."""
        steps = np.diff(ends, axis=1)[:, 0]
        self.nominal = np.linalg.norm(steps, axis=1)
        self.along = steps / self.nominal[:, None]
        moving = np.where(np.abs(self.along) > _SIDEWAYS, np.sign(self.along), 0.0)
        approach = np.stack([moving, -moving if bidirectional else moving], axis=1).reshape(-1, 3)
        m, columns = len(ends), {f"approach_{axis}": approach[:, i] for i, axis in enumerate(AXES)}
        number, point = np.repeat(np.arange(1, m + 1), 2), np.tile([1, 2], m)
        self.points = Points(ends.reshape(-1, 3), number, point, np.ones_like(number), machine, columns)
        self.rows = np.arange(2 * m).reshape(-1, 2)

    def fit(self, true_xyz: Floats, sizes: Floats) -> Floats:
        return self.points.xyz

    def project(self, xyz: Floats, displacement: Floats) -> Floats:
        between = displacement[self.rows[:, 1]] - displacement[self.rows[:, 0]]
        return np.asarray(np.einsum("mi,mik->mk", self.along, between))


def prescribed(machine: Machine) -> Floats:
    """(35, 2, 3) ends of the lengths of ISO 10360-2 in the recorded frame, mm; their lines are through the middle of travel.

    Five on each line from one end on, up to 66 % of the travel along it, which lie in its middle.
    """
    travel, ends = np.array([machine.travel(axis) for axis in AXES]), list[Floats]()
    for whole in np.vstack([_DIAGONALS, np.eye(3)]) * np.ptp(travel, axis=1):
        longest = ISO_10360_2.least_share * float(np.linalg.norm(whole))
        shortest = min(ISO_10360_2.shortest_mm, longest / ISO_10360_2.lengths)
        each = np.linspace(shortest, longest, ISO_10360_2.lengths)
        along = whole / np.linalg.norm(whole)
        ends += [travel.mean(axis=1) + along * np.array([[0.0], [length]]) - 0.5 * longest * along for length in each]
    return machine.coordinates(np.reshape(ends, (-1, 3))).reshape(-1, 2, 3)


def passed_test(
    first: RecordingModel, artefact: LengthsUnderTest, limit: Floats, u: Floats, sigma_mm: float, repeats: int
) -> FurtherRecording:
    """``limit``, ``u``: (m,) of each length and of its test value, mm. ``sigma_mm``: of the reading of one coordinate."""
    model = model_of_machine(first, RecordingModel(artefact, first.effects))
    of_line = np.unique(np.round(np.abs(artefact.along), _PARALLEL), axis=0, return_inverse=True)[1].ravel()
    by_line = u[:, None] * (of_line[:, None] == np.unique(of_line))
    own = max(sigma_mm * np.sqrt(2 / repeats), _LEAST) * np.eye(len(u))
    return FurtherRecording(model, np.hstack([u[:, None], by_line, own]), limit=limit)
