"""The steps of the recipe between a screened recording and its posterior, and what follows from that posterior."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray
from scipy import special

from cmm_uq.conformity.accuracy import with_uncertainty
from cmm_uq.documents.result import LACK_OF_FIT, Noise
from cmm_uq.errors import CmmUqError
from cmm_uq.files.limits import OBSERVATIONS
from cmm_uq.inference.draws import Draws, by_chain
from cmm_uq.inference.posterior import Posterior
from cmm_uq.jobs.job import Job
from cmm_uq.model import Estimate, MeasurementModel
from cmm_uq.model.artefact import Artefact
from cmm_uq.model.measurement import ARTEFACT
from cmm_uq.physics.catalogue import effects
from cmm_uq.screening.copies import counted_with
from cmm_uq.screening.finding import finding
from cmm_uq.screening.screened import Finding, gross_outliers
from cmm_uq.uncertainty.quantity import Quantity
from cmm_uq.units import MICROMETRE


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
    used = ~(np.isin(artefact.measurement, aside) | _copies(artefact, aside) | artefact.unread())
    if not used.any():
        raise CmmUqError(
            "no observation is left to estimate from", where="job.toml [recording] set_aside" if aside else job.recording_path,
            fix="Set fewer measurements aside, or record what the machine reads",
        )  # fmt: skip
    named = effects(job.facts.model.effects, where="job.toml [model] effects")
    return MeasurementModel(artefact, named, None if stated is None else stated * MICROMETRE, used)


def _copies(artefact: Artefact, aside: Sequence[int]) -> NDArray[np.bool_]:
    """(m,) which observations are copies of others."""
    group, rows = artefact.points.group, artefact.rows[:, 0]
    return np.asarray(group[counted_with(artefact.points, aside)[rows]] != group[rows])


def without_outliers(model: MeasurementModel) -> tuple[MeasurementModel, list[Finding]]:
    """The model without gross outliers, and what they are; the figures of performance still count them."""
    artefact, used, found = model.artefact, model.used.copy(), []
    chosen = np.flatnonzero(used)
    for index, times in gross_outliers(model.estimate().linear, artefact.measurement[chosen]):
        i = int(chosen[index])
        used[i] = False
        why = f"{artefact.words_of(i)} is {times:.1f} of its standard deviations off what the others say"
        found.append(replace(finding("outlier", artefact.points, artefact.rows[i], why), set_aside=True))
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
    noise = posterior.sigma[:, None] * artefact.noise_scale
    return with_uncertainty(lengths, predicted, noise, seed, counted_with(artefact.points)[artefact.rows[:, 0]])
