"""The model that a job names, joined with its artefact, and what is refused before anything is estimated."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from cmm_uq.analysis.screening.copies import counted_with
from cmm_uq.base.errors import CmmUqError
from cmm_uq.base.files.limits import FREEDOMS, OBSERVATIONS
from cmm_uq.base.units import MICROMETRE
from cmm_uq.jobs.job import Job
from cmm_uq.machine.model import MeasurementModel
from cmm_uq.machine.model.artefact import Artefact
from cmm_uq.machine.physics.catalogue import effects
from cmm_uq.maths.inference.freedoms import Freedoms
from cmm_uq.maths.inference.least_squares import RANK_TOLERANCE

FEWEST_LEFT = 3
"""Observations that the noise is estimated from, beside those that sizes and set-ups could explain."""


def model_of(job: Job, artefact: Artefact) -> MeasurementModel:
    """The model that the job names.

    Raises
    ------
    CmmUqError : an unknown effect, one that cannot be of this artefact, too many observations or placings, or a measurement to
        set aside that is not there.
    """
    if len(artefact.noise_scale) > OBSERVATIONS.most:
        raise CmmUqError(
            f"{len(artefact.noise_scale)} observations are more than are estimated from at once",
            where=job.recording_path, fix=f"{OBSERVATIONS.most} are the most: thin out the recording",
        )  # fmt: skip
    if (count := Freedoms.of(artefact.placing(artefact.points.xyz)).count) > FREEDOMS.most:
        raise CmmUqError(
            f"the placings have {count} freedoms together, more than are estimated beside the machine's errors at once",
            where=job.recording_path, fix=f"{FREEDOMS.most} are the most: split the recording",
        )  # fmt: skip
    stated, aside = job.facts.recording.u_coordinate_um, job.facts.recording.measurements_aside
    if unknown := set(aside) - set(job.points.measurement.tolist()):
        raise CmmUqError(f"there is no measurement {min(unknown)}", where="job.toml [recording] set_aside",
                         fix="Name measurements that the recording has")  # fmt: skip
    used = ~(np.isin(artefact.measurement, aside) | _copies(artefact, aside) | artefact.unread())
    if not used.any():
        raise CmmUqError(
            "no observation is left to estimate from", where="job.toml [recording] set_aside" if aside else job.recording_path,
            fix="Set fewer measurements aside, or record what the machine reads",
        )  # fmt: skip
    named = effects(job.facts.model.effects, where="job.toml [model] effects")
    if unfit := next(filter(None, (effect.unfit(artefact.points) for effect in named)), None):
        raise unfit
    model = MeasurementModel(artefact, named, None if stated is None else stated * MICROMETRE, used)
    _refuse_open_sizes(model, job.recording_path)
    _refuse_hidden_noise(model, job.recording_path)
    return model


def _copies(artefact: Artefact, aside: Sequence[int]) -> NDArray[np.bool_]:
    """(m,) which observations are copies of others."""
    group, rows = artefact.points.group, artefact.rows[:, 0]
    return np.asarray(group[counted_with(artefact.points, aside)[rows]] != group[rows])


def _refuse_open_sizes(model: MeasurementModel, where: str) -> None:
    """Refuse measurements that leave open, whatever the machine's errors, what the measurement is made for.

    Raises
    ------
    CmmUqError : too much of the recording is set aside.
    """
    sought = [i for i, size in enumerate(model.artefact.sizes) if size.role == "sought"]
    if not sought:
        return
    rank, _ = _rank(replace(model, effects=()), sought)
    if rank < len(sought):
        names = ", ".join(model.artefact.sizes[i].title for i in sought)
        raise CmmUqError(f"the measurements that are used leave a combination of {names} open", where=where,
                         fix="Set fewer measurements aside, or record more")  # fmt: skip


def _rank(model: MeasurementModel, columns: Sequence[int] | slice = slice(None)) -> tuple[int, int]:
    """Rank of some columns of the design, and how many observations there are, what is of no interest projected out."""
    linear = model.linearised(np.array([unknown.prior_mean for unknown in model.unknowns]))
    design = (linear.reduced.design * np.array([unknown.scale for unknown in model.unknowns]))[:, columns]
    return int(np.linalg.matrix_rank(design, tol=RANK_TOLERANCE * np.linalg.norm(design, 2))), linear.reduced.count


def _refuse_hidden_noise(model: MeasurementModel, where: str) -> None:
    """Refuse to estimate the noise where what is in doubt about each set-up could explain every residual.

    Raises
    ------
    CmmUqError : fewer than three observations are left to estimate it from.
    """
    if model.sigma is not None or all(size.role != "set-up" for size in model.artefact.sizes):
        return
    rank, count = _rank(model)
    left = count - rank
    if left < FEWEST_LEFT:
        raise CmmUqError(
            f"what is in doubt about each set-up explains all but {left} of {count} observations, so the noise "
            "of a coordinate does not show", where=where,
            fix="State u_coordinate_um in job.toml [recording], or record more points in each measurement",
        )  # fmt: skip
