"""The steps of the recipe between a screened recording and its posterior, and what follows from that posterior."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Mapping, Sequence
from dataclasses import replace
from functools import partial

import numpy as np
import scipy

from cmm_uq.analysis.conformity.accuracy import repeated_draws, with_uncertainty
from cmm_uq.analysis.conformity.as_recorded import OutsideReadings
from cmm_uq.analysis.conformity.plans import ALIGNED
from cmm_uq.analysis.conformity.standards import statement
from cmm_uq.analysis.conformity.statement import Statement
from cmm_uq.analysis.machine.agreement import lines_of
from cmm_uq.analysis.screening.columns import Finding, finding
from cmm_uq.analysis.screening.screening import (
    counted_with,
    gross_outliers,
    moved_stretches,
    point_words,
    recurring_points,
    stretch_words,
)
from cmm_uq.artefacts import kind_of
from cmm_uq.base.messages import say
from cmm_uq.base.points import Floats, Ints
from cmm_uq.base.units import MICROMETRE, PPM, unit
from cmm_uq.certificate.result import LACK_OF_FIT, Contradiction, NoiseComponent, RecordingNoise
from cmm_uq.jobs.job import Job
from cmm_uq.machine.model import Estimate, RecordingModel
from cmm_uq.machine.model.artefact_doubt import growth
from cmm_uq.machine.model.measurement import ARTEFACT
from cmm_uq.machine.model.noise import noise_of, repeated_quantity
from cmm_uq.machine.model.recorded import of_last_digit
from cmm_uq.maths.inference.draws import Draws, by_chain, by_ensemble, evenly, uncertainty_of_sum
from cmm_uq.maths.inference.linear_model import Freedoms, LinearModel
from cmm_uq.maths.inference.noise import AXES, GROWTH, PLACING, SLOW, Components
from cmm_uq.maths.inference.posterior import Cause, Doubt, NoisyPosterior, gain
from cmm_uq.maths.uncertainty.quantity import Quantity, expanded_of

_LINES = 2000  # draws of the sizes of the noise, over which a line's uncertainty is taken


def without_outliers(model: RecordingModel) -> tuple[RecordingModel, list[Finding]]:
    """The model without gross outliers, and what they are; the figures of performance still count them."""
    artefact, used = model.artefact, model.used.copy()
    chosen, estimate = np.flatnonzero(used), model.estimate()
    least = of_last_digit(artefact.points.xyz, estimate.least_squares.sigma_of_residuals)
    linear = _about_repeats(model, estimate.linear) if artefact.curves else estimate.linear
    outliers = gross_outliers(linear, artefact.measurement[chosen], least)
    times_off = {int(chosen[index]): times for index, times in outliers}
    rows = {i: int(artefact.rows[i][0]) for i in times_off}
    outlying = np.array(sorted(set(rows.values())), dtype=np.int64)
    recurring = recurring_points(artefact.points, outlying)
    kept = {row for each in recurring for row in each.tolist()}  # what is so each time is no gross error
    used[[i for i in times_off if rows[i] not in kept]] = False
    # one by one, but those of one cause together, where the worst of them stands
    points, left, findings = artefact.points, dict(times_off), list[Finding]()
    causes = [
        *((each, point_words, False) for each in recurring),
        *((each, stretch_words, True) for each in moved_stretches(points, outlying)),
    ]
    for i, times in times_off.items():
        if i not in left:
            continue
        cause = next((each for each in causes if rows[i] in each[0]), None)
        if cause is None:
            why = say("{what} is {times:.1f} of its standard deviations off what the others say",
                      what=artefact.words_of(i), times=times)  # fmt: skip
            findings.append(replace(finding("outlier", points, artefact.rows[i], why), set_aside=True))
            continue
        together, words, aside = cause
        off = [left.pop(j) for j in tuple(left) if rows[j] in together]
        findings.append(replace(finding("outlier", points, together, words(points, together, off)), set_aside=aside))
    return model.using(used), findings


def _about_repeats(model: RecordingModel, linear: LinearModel) -> LinearModel:
    """The same observations with a value of its own for each quantity that is read again and again."""
    quantity = repeated_quantity(model, model.used)
    each = Freedoms(np.ones((len(quantity), 1)), quantity, int(quantity.max()) + 1)
    return replace(linear, design=linear.design[:, :0], unknowns=(), placing=each)


def with_noise(model: RecordingModel) -> tuple[RecordingModel, Estimate, float | None]:
    """Estimate; where the residuals contradict the stated noise, they replace it. Also the χ² test's probability."""
    estimate = model.estimate()
    result = estimate.least_squares
    if model.sigma is None or result.degrees_of_freedom < 1:
        return model, estimate, None
    squares = float(np.sum((result.residuals / estimate.linear.noise_scale) ** 2))
    p_value = float(scipy.special.chdtrc(result.degrees_of_freedom, squares / model.sigma**2))
    if p_value < LACK_OF_FIT:
        model = replace(model, sigma=None)
        estimate = model.estimate()
    return model, estimate, p_value


def parameters(model: RecordingModel, values: Floats) -> dict[str, dict[str, Quantity]]:
    """Reported parameters of each effect, by effect and name, of draws (N, k) of the unknowns."""
    return {owner: found for owner, found in _quantities(model, values).items() if owner != ARTEFACT}


def named_draws(
    model: RecordingModel, components: Components, posterior: NoisyPosterior, values: Floats, *, mixture: bool
) -> Draws:
    """Draws of all that is reported: of each effect, of the artefact's sizes, and of the noise.

    ``values`` (N, k) of the model's unknowns are the posterior's, row by row, or a ``mixture``'s, row after row independent:
    these go with no size of the noise, which are then taken evenly from the posterior, and an ensemble is a chain.
    """
    units, columns, steps = {}, [], posterior.steps // posterior.every
    for (owner, name), (draws, own) in model.reported(values).items():
        units[f"{owner}.{name}"] = own
        columns.append(draws)
    noise = {name: each / MICROMETRE for name, each in sizes_of_noise(components, posterior).items()}
    units |= {f"noise.{name}_um": unit("µm") for name in noise}
    if not mixture:
        return Draws(units, by_chain(np.column_stack([*columns, *noise.values()]), steps), posterior.every)
    kept = evenly(len(posterior.draws), len(values))
    chains = by_ensemble(np.column_stack([each[kept] for each in noise.values()]), steps, len(posterior.draws))
    mixed = [each.reshape(*chains.shape[:2], 1) for each in columns]
    return Draws(units, np.concatenate([*mixed, chains], axis=2))


def sizes(model: RecordingModel, values: Floats) -> dict[str, Quantity]:
    return _quantities(model, values).get(ARTEFACT, {})


def _quantities(model: RecordingModel, values: Floats) -> dict[str, dict[str, Quantity]]:
    found: dict[str, dict[str, Quantity]] = {}
    for (owner, name), (draws, own) in model.reported(values).items():
        found.setdefault(owner, {})[name] = Quantity.of_draws(draws, own)
    return found


def sizes_of_noise(components: Components, posterior: NoisyPosterior) -> dict[str, Floats]:
    """Draws (N,), mm, of the reading noise, all axes and each, and of every other component that the recording could show.

    A reading is what the display shows: its steps are part of it.
    """
    sizes, rounding = posterior.sizes, components.display / np.sqrt(12)
    found = {"coordinate": np.hypot(sizes.coordinate, rounding)}
    if AXES in components.possible:
        found |= dict(zip("xyz", np.hypot(sizes.reading, rounding).T, strict=True))
    each = {PLACING: sizes.placing, GROWTH: sizes.growth, SLOW: sizes.slow}
    return found | {name: values for name, values in each.items() if name in components.possible}


def noise(
    estimate: Estimate,
    components: Components,
    posterior: NoisyPosterior,
    stated_um: float | None,
    p_value: float | None,
) -> RecordingNoise:
    found = {
        name: NoiseComponent(Quantity.of_draws(values / MICROMETRE, unit("µm")), float(np.mean(values > 0)))
        for name, values in sizes_of_noise(components, posterior).items()
    }
    coordinate = found.pop("coordinate").size
    apart = float(np.mean(np.ptp(posterior.sizes.reading, axis=1) > 0))
    step, ls = components.display / MICROMETRE, estimate.least_squares
    free = ls.determined & ~np.array([u.known for u in ls.unknowns], dtype=bool)
    white = np.sqrt(np.diag(ls.covariance)[free])
    # largest ratio of an uncertainty to what it would be under white noise; 1 where nothing is determined
    wider = float(np.max(posterior.draws.std(axis=0)[free] / white, initial=1.0, where=white > 0))
    return RecordingNoise(coordinate, found, apart, wider, stated_um, p_value, step)


def with_doubt(
    model: RecordingModel, estimate: Estimate, posterior: NoisyPosterior, draws: Floats, causes: Sequence[Cause]
) -> tuple[Floats, Doubt]:
    """Draws (N, k) of the model's unknowns with what is in doubt about all observations together; as they are without."""
    doubt = doubt_of(model, estimate, float(np.median(posterior.sigma)), causes)
    return doubt.widened(draws, posterior.seed) if doubt.carried else draws, doubt


def doubt_of(model: RecordingModel, estimate: Estimate, sigma_mm: float, causes: Sequence[Cause]) -> Doubt:
    """What is in doubt about the model's unknowns, as they are estimated under noise ``sigma_mm`` of a coordinate."""
    return (
        Doubt.of([cause.at(model.used) for cause in causes], gain(estimate.linear, sigma_mm)) if causes else Doubt(())
    )


def contradictions(
    model: RecordingModel, estimate: Estimate, posterior: NoisyPosterior, averaged: Floats
) -> tuple[Contradiction, ...]:
    """Averaged scales of axes that lines along these deny: of each the line that does most.

    An average may give to a scale what another explanation takes away from it again. Nobody may use the scale without that,
    so what the lines along the axis alone say of it, all other named effects as they are on average, must agree with it: all
    of them, within the joint 95 % uncertainty.

    averaged : (N, k) draws of the model's unknowns over all explanations that remain.
    """
    if growth(model.artefact) is None:
        return ()
    linear, components, mean = estimate.linear, noise_of(model, in_turn=True), averaged.mean(axis=0)
    sizes = posterior.sizes.at(evenly(len(posterior.draws), _LINES))
    lines: dict[int, list[tuple[float, float, Contradiction]]] = {}
    along_axis = (1 - 2 * ALIGNED**2) * PPM
    for number, weights in lines_of(model, len(model.used)):
        slope = weights @ linear.design
        spoken = [i for i in np.flatnonzero(np.abs(slope) >= along_axis).tolist() if linear.unknowns[i].unit == "ppm"]
        if not spoken:
            continue
        left = float(weights @ linear.observed - slope @ mean)
        expected = float(expanded_of(averaged @ slope, slope @ mean))
        u, U = uncertainty_of_sum(components, sizes, weights)
        for i in spoken:
            off, wide = left / slope[i], np.array([u, U]) / abs(slope[i])
            value, unknown = float(mean[i] + off), linear.unknowns[i]
            alone = Quantity(value, float(wide[0]), (value - float(wide[1]), value + float(wide[1])), unknown.unit)
            own = float(np.hypot(expected / slope[i], wide[1]))
            lines.setdefault(i, []).append((abs(off), own, Contradiction(unknown.key, number, alone)))
    found = []
    for each in lines.values():
        factor = float(scipy.special.ndtri(0.5 + 0.5 * 0.95 ** (1 / len(each))) / scipy.special.ndtri(0.975))
        off, own, line = max(each, key=lambda one: one[0] / one[1])
        if off > factor * own:
            found.append(line)
    return tuple(found)


def accuracy(
    model: RecordingModel,
    estimate: Estimate,
    posterior: NoisyPosterior,
    causes: Sequence[Cause],
    seed: int,
    *,
    returning: bool = False,
) -> Mapping[str, Quantity]:
    """Figures of performance of all recorded lengths, the noise drawn anew; empty for an artefact that has none.

    ``returning``: what the named errors leave of a length on average over its repeats is of the machine, and there again.

    What is in doubt is drawn anew with the noise, the same for all set-ups and for each by itself; the larger U stands.
    """
    artefact = model.artefact
    lengths = artefact.lengths()
    if lengths is None or (returning and not np.any(posterior.sizes.placing)):
        return {}
    every = model.using()
    linear, components, sizes = every.linearised(estimate.about), noise_of(every), posterior.sizes
    chosen = repeated_draws(len(posterior.draws), len(lengths))
    predicted, sizes = lengths - linear.observed + posterior.draws[chosen] @ linear.design.T, sizes.at(chosen)
    copies = counted_with(artefact.points)[artefact.rows[:, 0]]
    if returning:
        place = np.column_stack([artefact.measurement, artefact.points.point[artefact.rows]])
        _, which, count = np.unique(place, axis=0, return_inverse=True, return_counts=True)
        order, first = np.argsort(which.ravel(), kind="stable"), np.cumsum(count) - count
        mean = np.add.reduceat((lengths - predicted)[:, order], first, axis=1) / count
        predicted, sizes = predicted + mean[:, which.ravel()], replace(sizes, placing=np.zeros_like(sizes.placing))

    def figures(apart: bool) -> dict[str, Quantity]:
        def again(some: Ints, times: int, random: np.random.Generator) -> Floats:
            readings = components.repeated(sizes.at(some), times, random)
            for cause in causes:
                readings += cause.drawn((len(some), times), random, apart=apart)
            return readings

        return with_uncertainty(lengths, predicted, again, seed, copies)

    found = figures(apart=False)
    other = figures(apart=True) if causes else found
    return {name: max(one, other[name], key=lambda quantity: quantity.expanded) for name, one in found.items()}


def decision(
    job: Job, model: RecordingModel, findings: Sequence[Finding], i: int, figures: Mapping[str, Quantity] | None = None
) -> Statement:
    """The ``i``-th statement, from 1, that a job wishes, of all its readings as they were recorded.

    Without ``figures`` of performance, which take a posterior, what cannot be decided is refused, and the values mean nothing.
    """
    kind = kind_of(job)
    observe = partial(kind.observing("reported"), job.facts.artefact, where=job.recording_path)
    known = defaultdict(lambda: Quantity(1.0, 1.0, (0.0, 2.0), unit("µm"))) if figures is None else figures
    outside = OutsideReadings.of(job.points, findings, observe)
    key, wish = f"[[conformity]] {i}", job.facts.conformity[i - 1]
    return statement(wish, model.artefact, known, key, kind.tested, None, job.circumstances, outside)
