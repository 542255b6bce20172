"""Bryan gauge: a bar with one ball fixed to the table, the other swept through the machine's volume.

The observation is the distance of the swept ball from the fixed one, whose place is free for the whole job, and the bar's
length too when no certificate gives it (US 4,437,151, equations 108 and 110, solved together instead of one after the other).
"""

from __future__ import annotations

import numpy as np

from cmm_uq.artefacts.distances.equations import DistanceSolution, solve_distances
from cmm_uq.base.errors import CmmUqError
from cmm_uq.base.messages import say
from cmm_uq.base.points import Floats, Points
from cmm_uq.jobs.tables.artefact import ArtefactFacts
from cmm_uq.machine.model.artefact import Placings
from cmm_uq.machine.model.radial import Radial
from cmm_uq.machine.model.recorded import expansion, place


class Bryan(Radial):
    """A swept bar: n distances of n points, one a measurement.

    Parameters
    ----------
    facts : what the job says of the bar; its length may be missing.
    points : the recording; point 1 is the swept ball.

    Raises
    ------
    CmmUqError : points other than the swept ball, too few of them, all in one place or plane.
    """

    kind = "bryan"
    title = say("Bryan gauge")
    per_size = 1.0
    size_title = say("Length of the bar")
    size_what = say("length")
    plural = "the recorded bars"

    def __init__(self, facts: ArtefactFacts, points: Points, *, where: str | None = None) -> None:
        if np.any(other := points.point != 1):
            raise CmmUqError(
                f"measurement {points.measurement[np.argmax(other)]} has a point {points.point[np.argmax(other)]}: only the "
                "swept ball is recorded, as point 1; the fixed ball's centre is estimated",
                where=place(points, other, where),
                fix="Leave the fixed ball out, or mend [artefact] kind in job.toml",
            )
        whole_job = np.zeros(len(points), dtype=np.int64)
        super().__init__(facts, points, Placings(whole_job, np.array([0])), expansion(facts, points), where)

    def in_two_steps(self, method: str = "QR", xyz: Floats | None = None) -> tuple[DistanceSolution, Floats]:
        """The patent's way: centre, and the length if it is not certified, from the sphere (108); then e1 … e6 from (110).

        The sphere is fitted as if the machine had no errors, and bends to them: unless the swept positions surround the
        fixed ball evenly, its centre takes up part of every scale and squareness error, and e1 … e6 lack that part.

        Parameters
        ----------
        method : of solving the equations.
        xyz : (n, 3) readings, mm; by default those recorded.

        Returns
        -------
        solution, and the centre (3,) of the first step, mm.

        Raises
        ------
        CmmUqError : the swept directions do not determine all six factors.
        """
        certified = self.sizes[0].certified
        readings = self.points.xyz if xyz is None else xyz
        centre = self.centres(readings, self.sizes[0].nominal if certified else None)[0]
        differences = readings - centre
        length = self.sizes[0].nominal
        return solve_distances(differences, length * self.expansion, method), centre
