"""ISO 230-2: figures of positioning against their limits, with the test uncertainty as ISO/TR 230-9 has it.

The instrument's scale, alignment and temperature make readings wrong in proportion to the way from the first target;
what changes between readings, each by itself. The figures are evaluated anew of draws of these; the machine's own scatter is
no part of it.
"""

from __future__ import annotations

from functools import partial

import numpy as np

from cmm_uq.analysis.conformity.plans import Condition
from cmm_uq.analysis.conformity.standard import NOT_STATED, Characteristic, Test
from cmm_uq.analysis.conformity.statement import Statement, least_favourable
from cmm_uq.base.messages import say
from cmm_uq.base.units import METRE, MICROMETRE
from cmm_uq.jobs.tables.conformity import Circumstances
from cmm_uq.machine.model.artefact import Artefact
from cmm_uq.machine.model.kind import POSITIONING
from cmm_uq.maths.geometry.positioning import MissingReadingError, PositioningRuns

LINES = ("calibration", "temperature", "alignment", "repeat")
_DRAWS = 2000
REPEATS, LEAST_TARGETS, PER_METRE = 5, 5, 5.0  # runs in each direction, targets (ISO 230-2:2014, of axes up to 2 m)
_TITLES = {
    "A": say("bidirectional accuracy of positioning"),
    "E": say("bidirectional systematic deviation of positioning"),
    "R": say("bidirectional repeatability of positioning"),
    "B": say("reversal value"),
    "M": say("range of the mean bidirectional deviation"),
}


def uncertainty_of_figures(runs: PositioningRuns, artefact: Artefact, under: Circumstances) -> dict[str, float]:
    """Standard uncertainty of each figure of a run, µm, by what is stated of the test; none where nothing is."""
    stated, size = under.uncertainty, artefact.sizes[0]
    longest = float(np.ptp(runs.targets))
    warm = abs(under.cte_per_k or 0.0) * stated.u_temperature_k * longest / MICROMETRE
    scale = size.sd / size.nominal * longest / MICROMETRE if np.isfinite(size.sd) else 0.0
    whole = float(np.linalg.norm([scale, warm, stated.u_alignment_um]))
    if whole == 0 and stated.u_repeat_um == 0:
        return {}
    random = np.random.default_rng(np.random.SeedSequence(230, spawn_key=(2,)))
    part = (runs.targets - runs.targets[0]) / longest
    changes = whole * random.standard_normal((_DRAWS, 1, 1, 1)) * part[None, None, :, None]
    changes = changes + stated.u_repeat_um * random.standard_normal((_DRAWS, *runs.x.shape))
    return dict(runs.spread(changes))


def positioning(test: Test, *, figure: str) -> Statement:
    """The worst of all axes against the limit."""
    try:
        runs = test.artefact.positionings()
    except MissingReadingError as error:
        fix = "Record every target in every repeat of each direction, or leave the statement out"
        raise test.error(f"{error}: {test.facts.standard} needs one", fix=fix) from None
    test.refuse_nothing_measured(bool(runs), "positioning in both directions")
    items = []
    for measurement, run in runs.items():
        figures, spread = run.figures(), uncertainty_of_figures(run, test.artefact, test.circumstances)
        if figure not in figures:
            needs = "both directions, twice" if figure in "AR" else "both directions"
            fix = "Record them, or leave the statement out"
            raise test.error(f"measurement {measurement} has no {figure}, which needs {needs}", "characteristic", fix)
        length = float(np.ptp(run.targets))
        u = test.at_least(spread.get(figure, 0.0), length)
        test.refuse_without_uncertainty(u, "u_scale_um_per_m")
        items.append(
            test.decided(
                figures[figure], u, test.limit_um(length), signed=False, measurement=measurement, length_mm=length
            )
        )
    worst = least_favourable(tuple(items))
    how = NOT_STATED
    if worst.u_um > 0:
        how = say(
            "u is the test uncertainty as ISO/TR 230-9 has it, of what is stated of instrument, alignment, temperature and "
            "changes between readings: {u:.2g} µm.",
            u=worst.u_um,
        )
    remarks = [how, say("Evaluated by the formulas of ISO 230-2:2014, with twice the standard uncertainty estimators.")]
    return test.stated(_TITLES[figure], say("axes"), tuple(items), remarks, signed=False)


def conditions(artefact: Artefact, *, recorded: bool) -> tuple[Condition, ...]:
    """Targets and runs of every axis that is there; a repeat that is another to the last digit is a copy of it."""
    try:
        runs = artefact.positionings()
    except MissingReadingError:
        runs = {}
    what = say("five runs in each direction, five targets a metre and five at least")
    few = []
    for number, run in runs.items():
        count, span = len(run.targets), float(np.ptp(run.targets)) / METRE
        if run.repeats < REPEATS or count < max(LEAST_TARGETS, PER_METRE * span):
            few.append(
                say(
                    "measurement {number}: {repeats} runs, {targets} targets",
                    number=number,
                    repeats=run.repeats,
                    targets=count,
                )
            )
        alike = np.all(run.x[..., :, None] == run.x[..., None, :], axis=(0, 1)) & ~np.eye(run.repeats, dtype=bool)
        if recorded and alike.any():
            first, second = np.argwhere(alike)[0] + 1
            few.append(
                say(
                    "measurement {number}: repeat {second} is repeat {first} to the last digit",
                    number=number,
                    second=int(second),
                    first=int(first),
                )
            )
    return (Condition(what, tuple(few) if runs else (what,)),)


CHARACTERISTICS = tuple(
    Characteristic(
        name,
        POSITIONING,
        partial(positioning, figure=name),
        conditions,
        lines=LINES,
        unstated=lambda artefact: None if getattr(artefact, "u_scale_um_per_m", None) else "u_scale_um_per_m",
    )
    for name in _TITLES
)
