"""The steps of the recipe between a screened recording and its posterior, and what follows from that posterior."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np
from scipy import special

from cmm_uq.conformity.accuracy import with_uncertainty
from cmm_uq.documents.result import LACK_OF_FIT, Influence, Noise
from cmm_uq.errors import CmmUqError
from cmm_uq.files.limits import OBSERVATIONS
from cmm_uq.inference.draws import Draws, by_chain
from cmm_uq.inference.least_squares import RANK_TOLERANCE
from cmm_uq.inference.posterior import Posterior
from cmm_uq.jobs.job import Job
from cmm_uq.model import Estimate, MeasurementModel
from cmm_uq.model.artefact import Artefact
from cmm_uq.model.measurement import ARTEFACT
from cmm_uq.physics.catalogue import effects
from cmm_uq.screening.screened import Finding, gross_outliers
from cmm_uq.uncertainty.quantity import Quantity
from cmm_uq.units import MICROMETRE

FEWEST_LEFT = 3
"""Observations that the noise is estimated from, beside those that sizes and set-ups could explain."""


def model_of(job: Job, artefact: Artefact) -> MeasurementModel:
    """The model that the job names.

    Raises
    ------
    CmmUqError : an unknown effect, too many observations, or a measurement to set aside that is not there.
    """
    if len(artefact.noise_scale) > OBSERVATIONS.most:
        raise CmmUqError(
            f"{len(artefact.noise_scale)} observations are more than are estimated from at once",
            where=job.recording_path, fix=f"{OBSERVATIONS.most} are the most: thin out the recording",
        )  # fmt: skip
    stated, aside = job.facts.recording.u_coordinate_um, job.facts.recording.set_aside
    if unknown := set(aside) - set(job.points.measurement.tolist()):
        raise CmmUqError(f"there is no measurement {min(unknown)}", where="job.toml [recording] set_aside",
                         fix="Name measurements that the recording has")  # fmt: skip
    model = MeasurementModel(
        artefact, effects(job.facts.model.effects, where="job.toml [model] effects"),
        None if stated is None else stated * MICROMETRE, ~np.isin(artefact.measurement, aside),
    )  # fmt: skip
    _refuse_open_sizes(model, job.recording_path)
    _refuse_hidden_noise(model, job.recording_path)
    return model


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


def without_outliers(model: MeasurementModel) -> tuple[MeasurementModel, list[Finding]]:
    """The model without gross outliers, and what they are; the figures of performance still count them."""
    artefact, used, found = model.artefact, model.used.copy(), []
    chosen = np.flatnonzero(used)
    for index, times in gross_outliers(model.estimate().linear, artefact.measurement[chosen]):
        i = int(chosen[index])
        used[i] = False
        measurement, repeat = int(artefact.measurement[i]), int(artefact.repeat[i])
        rows = (artefact.points.measurement == measurement) & (artefact.points.repeat == repeat)
        why = f"measurement {measurement}, repeat {repeat} is {times:.1f} of its standard deviations off what the others say"
        lines = tuple(artefact.points.lines[rows].tolist()) if len(artefact.points.lines) else ()
        found.append(Finding("outlier", (measurement,), lines, why, set_aside=True))
    return replace(model, used=used), found


def with_noise(model: MeasurementModel) -> tuple[MeasurementModel, Estimate, float | None]:
    """Estimate; where the residuals contradict the stated noise, they replace it. Also the χ² test's probability."""
    estimate = model.estimate()
    result = estimate.least_squares
    if model.sigma is None or result.degrees_of_freedom < 1:
        return model, estimate, None
    squares = float(np.sum((result.residuals / estimate.linear.noise_scale) ** 2))
    p_value = float(special.chdtrc(result.degrees_of_freedom, squares / model.sigma**2))
    if p_value < LACK_OF_FIT:
        model = replace(model, sigma=None)
        estimate = model.estimate()
    return model, estimate, p_value


def influences(model: MeasurementModel, estimate: Estimate, findings: tuple[Finding, ...]) -> tuple[Influence, ...]:
    """What leaving out the later measurement of each pair of copies would change."""
    found = []
    result = estimate.least_squares
    u = np.sqrt(np.diag(result.covariance))
    for finding in findings:
        if finding.kind != "duplicate" or finding.set_aside:
            continue
        measurement = finding.measurements[-1]
        kept = model.used & (model.artefact.measurement != measurement)
        without = replace(model, used=kept).estimate().least_squares
        known = result.determined & without.determined & (u > 0)
        if not known.any():
            continue
        change = np.where(known, np.abs(without.value - result.value) / np.where(known, u, 1.0), 0.0)
        worst = int(np.argmax(change))
        sd = without.residual_sd
        found.append(Influence(
            measurement, None if sd is None else sd / MICROMETRE, float(change[worst]), result.unknowns[worst].key
        ))  # fmt: skip
    return tuple(found)


def parameters(model: MeasurementModel, posterior: Posterior) -> dict[str, dict[str, Quantity]]:
    """Reported parameters of each effect, by effect and name."""
    found = _quantities(model, posterior)
    return {effect.name: found[effect.name] for effect in model.effects}


def named_draws(model: MeasurementModel, posterior: Posterior) -> Draws:
    """The posterior of all that is reported: of each effect, of the artefact's sizes, and of the noise if it is estimated."""
    units, columns = {}, []
    for (owner, name), (draws, unit) in model.reported(posterior.draws).items():
        units[f"{owner}.{name}"] = unit
        columns.append(draws)
    if model.sigma is None:
        units["noise.coordinate_um"] = "µm"
        columns.append(posterior.sigma / MICROMETRE)
    values = np.column_stack(columns) if columns else np.zeros((len(posterior.draws), 0))
    return Draws(units, by_chain(values, posterior.steps))


def sizes(model: MeasurementModel, posterior: Posterior) -> dict[str, Quantity]:
    """Sizes of the artefact, by name."""
    return _quantities(model, posterior).get(ARTEFACT, {})


def _quantities(model: MeasurementModel, posterior: Posterior) -> dict[str, dict[str, Quantity]]:
    found: dict[str, dict[str, Quantity]] = {}
    for (owner, name), (draws, unit) in model.reported(posterior.draws).items():
        found.setdefault(owner, {})[name] = Quantity.of_draws(draws, unit)
    return found


def noise(posterior: Posterior, stated_um: float | None, p_value: float | None) -> Noise:
    """Noise of a coordinate."""
    return Noise(Quantity.of_draws(posterior.sigma / MICROMETRE, "µm"), stated_um, p_value)


def accuracy(model: MeasurementModel, estimate: Estimate, posterior: Posterior, seed: int) -> Mapping[str, Quantity]:
    """Figures of performance of all recorded lengths; empty for an artefact that has none."""
    artefact = model.artefact
    lengths = artefact.lengths()
    if lengths is None:
        return {}
    linear = replace(model, used=np.ones_like(model.used)).linearised(estimate.least_squares.value)
    predicted = lengths - linear.observed + posterior.draws @ linear.design.T
    return with_uncertainty(lengths, predicted, posterior.sigma[:, None] * artefact.noise_scale, seed)
