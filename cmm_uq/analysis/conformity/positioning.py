"""ISO 230-2, -4 and -6: figures of axes, circles and diagonals against limits, with the test uncertainty of ISO/TR 230-9.

The instrument's scale, alignment and temperature make readings wrong in proportion to the way from the first target;
what changes between readings, each by itself. The figures are evaluated anew of draws of these; the machine's own scatter is
no part of it.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from functools import partial

import numpy as np

from cmm_uq.analysis.conformity.plans import Condition
from cmm_uq.analysis.conformity.standard import NOT_STATED, Characteristic, Test
from cmm_uq.analysis.conformity.statement import (
    CHOSEN,
    ITS_RULE,
    REPORTED,
    Clause,
    Decided,
    Statement,
    least_favourable,
)
from cmm_uq.base.messages import Message, Text, Verbatim, at_key, commas, number as figure_of, say, signed
from cmm_uq.base.points import AXES, Machine
from cmm_uq.base.units import ARCSECOND, METRE, MICROMETRE
from cmm_uq.jobs.tables.artefact import ArtefactFacts
from cmm_uq.jobs.tables.conformity import Circumstances
from cmm_uq.machine.model.artefact import Artefact
from cmm_uq.machine.model.kind import POSITIONING
from cmm_uq.maths.geometry.positioning import CircularTest, MissingReadingError, PositioningRuns

LINES = ("calibration", "temperature", "alignment", "repeat")
_DRAWS = 2000
# degrees of freedom of Student's t by which readings on a circle change. What is stated is a standard uncertainty: the
# largest of many single readings goes by their tails, of which it says nothing; these are the tails that a diagnosis looks for
_DOF = 4
REPEATS, LEAST_TARGETS, PER_METRE = 5, 5, 5.0  # runs in each direction, targets (ISO 230-2:2014, of axes up to 2 m)
# ° of the run of a rotary axis up to which so many targets are enough, as commonly reported of the same standard; its figures
# are decided as arcs at a radius where 1 µm is 1″
_TURN, _ANGULAR_TARGETS, _ARC_MM = 360.0, ((90.0, 3), (180.0, 5), (np.inf, 8)), MICROMETRE / ARCSECOND
DIAGONALS, _MOVES, _MOST = 4, 0.1, 2 / 3  # least cosine with each axis, and part of its travel that each crosses
_UNEVEN = 2.0  # times the spacing of as few even targets as are asked for, that two of them lie apart at most
_APART = 5.0  # degrees between targets of a circle, at most: a path that is recorded as it goes has no targets
_TITLES = {
    "A": say("bidirectional accuracy of positioning"), "E": say("bidirectional systematic deviation of positioning"),
    "R": say("bidirectional repeatability of positioning"), "B": say("reversal value"),
    "M": say("range of the mean bidirectional deviation"), "Ed": say("bidirectional systematic deviation of diagonals"),
    "Bd": say("reversal value of diagonals"), "G": say("circular deviation"), "H": say("circular hysteresis"),
    "F": say("radial deviation"), "G(b)": say("bidirectional circular deviation"),
    "D": say("mean bidirectional radial deviation"),
}  # fmt: skip


def uncertainty_of_figures(runs: PositioningRuns, under: Circumstances) -> dict[str, float]:
    """Standard uncertainty of each figure of a run, µm or ″, by what is stated of the test; none where nothing is."""
    stated, growth = under.uncertainty, np.zeros(len(runs.targets)) if runs.growth is None else runs.growth
    warm = abs(under.cte_per_k or 0.0) * stated.u_temperature_k * runs.length_mm / MICROMETRE
    alignment, repeat = (stated.u_alignment_um, stated.u_repeat_um) if runs.length_mm else (0.0, 0.0)
    if runs.angular:
        alignment, repeat = stated.u_alignment_arcsec, stated.u_repeat_arcsec
    whole = float(np.linalg.norm([runs.u_reference, warm, alignment]))
    motion = runs.motion
    if whole == 0 and repeat == 0 and not (motion and motion.u_delay):
        return {}
    random = np.random.default_rng(np.random.SeedSequence(230, spawn_key=(2,)))
    targets = len(growth) if runs.by_target else 1
    common = whole * random.standard_normal((_DRAWS, 1, targets, 1)) * growth[None, None, :, None]
    shape = (_DRAWS, *runs.x.shape)
    tails = isinstance(runs, CircularTest)
    each = np.sqrt((_DOF - 2) / _DOF) * random.standard_t(_DOF, shape) if tails else random.standard_normal(shape)
    if motion is not None:
        # what the interpolation leaves out is the machine's curve there, in all runs the same but for where readings lie
        doubt, delay = random.standard_normal((_DRAWS, 1, len(growth), 1)), random.standard_normal((_DRAWS, 1, 1, 1))
        ways = np.array([1.0, -1.0])[: len(runs.x), None, None]
        common = common + doubt * motion.curvature + (motion.u_delay or 0.0) * delay * ways
        each = motion.share * each
    return dict(runs.spread(common, repeat * each))


_BOTH = {"G": ("G↺", "G↻"), "F": ("Fmax", "Fmin")}  # figures of which the larger is decided
_CIRCULAR = say(
    "Evaluated by the definitions of ISO 230-4, of the path of each round by itself: the largest of all rounds."
)
_FORMULAS = say("Evaluated by the formulas of ISO 230-2:2014, with twice the standard uncertainty estimators.")
_IN_MOTION = say(
    "Readings were taken in motion and interpolated at the targets: this is no test by ISO 230-2, which asks that the axis "
    "rests at each."
)
Runs = Mapping[int, PositioningRuns]


def axes(artefact: Artefact) -> Runs:
    return {number: runs for number, runs in artefact.positionings().items() if runs.axis}


def circles(artefact: Artefact) -> Runs:
    return {number: runs for number, runs in artefact.positionings().items() if isinstance(runs, CircularTest)}


def diagonals(artefact: Artefact) -> Runs:
    """Body diagonals alone: all three axes move."""
    found = artefact.positionings().items()
    return {number: runs for number, runs in found if runs.travel and min(np.abs(runs.travel)) > _MOVES}


def positioning(
    test: Test, *, figure: str, of: Callable[[Artefact], Runs], what: str, key: str, own: bool = False
) -> Statement:
    """The worst of all against the limit; of readings taken in motion by the laboratory's own rule alone."""
    try:
        runs = of(test.artefact)
    except MissingReadingError as error:
        fix = "Record every target in every repeat of each direction, or leave the statement out"
        if error.gap:
            fix = "Record more readings, or name fewer targets in [artefact.on_the_fly]"
        raise test.error(f"{error}: {test.facts.standard} needs every target", fix=fix) from None
    test.refuse_nothing_measured(bool(runs), f"{what} in both directions")
    angular = any(run.angular for run in runs.values())
    if angular != (test.facts.angle_arcsec is not None):
        kind, keys = ("a rotary axis", "limit_arcsec") if angular else ("no angle", "limit_um or mpe")
        raise test.error(f"{figure} of these runs is of {kind}, and its limit is not", "limit_arcsec", f"Give {keys}")
    moving = {number: run.motion for number, run in runs.items() if run.motion is not None}
    if moving and not own:
        problem = f"{test.facts.standard} asks for an axis at rest at each target, and measurement {min(moving)} was in motion"
        raise test.error(problem, fix=f'Decide it by standard = "{OWN_RULE}", or record it target by target')
    if any(motion.u_delay is None for motion in moving.values()):
        fix = "State it in [artefact.on_the_fly]; 0 where one trigger reads scales and instrument"
        raise test.error("readings in motion are decided with u_delay_um, which the job does not state", fix=fix)
    items = []
    for measurement, run in runs.items():
        figures, spread = run.figures(), uncertainty_of_figures(run, test.circumstances)
        names = [n for n in figures if n in (figure, figure.removesuffix("d")) or n in _BOTH.get(figure, ())]
        if not names or not run.both:
            needs = "both directions, twice" if figure in "AR" else "both directions"
            needs = f"{needs}, a full circle and u_bar_um in [artefact]" if figure in "DF" else needs
            fix = "Record them, or leave the statement out"
            raise test.error(f"measurement {measurement} has no {figure}, which needs {needs}", "characteristic", fix)
        value, u = max(abs(figures[name]) for name in names), max(spread.get(name, 0.0) for name in names)
        length = _ARC_MM if run.angular else run.length_mm
        u = test.at_least(u, length)
        test.refuse_without_uncertainty(u, "u_polygon_arcsec" if run.angular else key or "u_repeat_um")
        limit = test.limit_um(length)
        items.append(test.decided(value, u, limit, signed=False, measurement=measurement, length_mm=length))
    worst = least_favourable(tuple(items))
    how = NOT_STATED
    if worst.u_um > 0:
        how = say(
            "u is the test uncertainty as ISO/TR 230-9 has it, of what is stated of instrument, alignment, temperature and "
            "changes between readings: {u:.2g} µm.",
            u=worst.u_um,
        )
    remarks: list[Text] = [how, _CIRCULAR if of is circles else _FORMULAS, *([_IN_MOTION] if moving else [])]
    remarks += [as_angle(worst, test.facts.angle_arcsec)] if test.facts.angle_arcsec is not None else []
    machine = test.artefact.points.machine
    remarks += _not_measured(runs, machine, angular=angular) if of is axes else []
    each = say("rotary axes"), say("circles"), say("diagonals"), say("axes")
    items_of = each[0 if angular else 1 if of is circles else 2 if of is diagonals else 3]
    return test.stated(_TITLES[figure], items_of, tuple(items), remarks, signed=False)


def _crosses(run: PositioningRuns, artefact: Artefact) -> bool:
    """Whether a diagonal crosses most of the travel of every axis; of unknown travel none does."""
    travel = np.ptp(artefact.points.machine.travel_mm, axis=1)
    return bool(np.all(run.length_mm * np.abs(run.travel) >= _MOST * travel))


def as_angle(value: Decided, limit_arcsec: float) -> Message:
    """What was decided as an arc over a length, as the angle that it is."""
    arc = (value.length_mm or _ARC_MM) * ARCSECOND / MICROMETRE  # µm of one arcsecond
    return say(
        "As an angle this is {value} ″ with U = {U} ″ (k = 2), against {limit} ″.", value=signed(value.error_um / arc, ".3g"),
        U=figure_of(2 * value.u_um / arc, ".2g"), limit=figure_of(limit_arcsec, "g"),
    )  # fmt: skip


def _short_of_turn(runs: Runs, artefact: Artefact) -> Iterator[Message]:
    """The same of rotary axes, of which runs over more than one turn are not decided."""
    for run in runs.values():
        limits, key, _ = artefact.points.machine.limits_of(run.axis)
        turn, whole = float(np.ptp(run.targets)), min(float(np.ptp(limits)), _TURN)
        axis = Verbatim(run.axis.upper())
        if np.isnan(whole):
            yield say("the travel of {axis}{key}, of which its run is a part", axis=axis, key=at_key(key))
        elif not _MOST * whole <= turn <= _TURN:
            yield say("two thirds of the travel of {axis}, within one turn ({turn:.0f} of {whole:.0f}°)", axis=axis,
                      turn=turn, whole=whole)  # fmt: skip


def _short_of_travel(runs: Runs, artefact: Artefact) -> Iterator[Message]:
    """Of each axis that no run goes over most of, in how far its figures are those of a part of it."""
    if artefact.angular:
        yield from _short_of_turn(runs, artefact)
        return
    travel = dict(zip(AXES, np.ptp(artefact.points.machine.travel_mm, axis=1).tolist(), strict=True))
    longest = {axis: max(run.length_mm for run in runs.values() if run.axis == axis) for axis in _named(runs)}
    for axis, length in longest.items():
        if not np.isfinite(travel[axis]):
            key = at_key("[machine] travel_mm")
            yield say("the travel of {axis}{key}, of which its run is a part", axis=Verbatim(axis.upper()), key=key)
        elif length < _MOST * travel[axis]:
            name, whole = Verbatim(axis.upper()), travel[axis]
            yield say(
                "two thirds of the travel of {axis} ({length:.0f} of {travel:.0f} mm)",
                axis=name,
                length=length,
                travel=whole,
            )


def _named(runs: Runs) -> list[str]:
    return [axis for axis in (*AXES, "a", "b", "c") if any(run.axis == axis for run in runs.values())]


def _not_measured(runs: Runs, machine: Machine, *, angular: bool) -> list[Text]:
    """What a reader must know of axes that no run is of."""
    measured = _named(runs)
    others = [Verbatim(axis.upper()) for axis in machine.axes if (axis in AXES) != angular and axis not in measured]
    if not measured or not others:
        return []
    those = commas([Verbatim(axis.upper()) for axis in measured])
    return [say("Of {measured} alone: nothing is said of {others}.", measured=those, others=commas(others))]


def _enough(run: PositioningRuns) -> bool:
    if isinstance(run, CircularTest):
        return run.both and run.widest_gap <= _APART
    least = max(LEAST_TARGETS, PER_METRE * run.length_mm / METRE)
    if run.angular:
        least = next(count for most, count in _ANGULAR_TARGETS if np.ptp(run.targets) <= most)
    return run.repeats >= REPEATS and len(run.targets) >= least and _bare(run) * (least - 1) <= _UNEVEN * (1 + 1e-9)


def _bare(run: PositioningRuns) -> float:
    """Widest part of a run without a target, of all of it."""
    return float(np.diff(run.targets).max(initial=0.0)) / max(float(np.ptp(run.targets)), 1e-9)


def conditions(
    artefact: Artefact, *, recorded: bool, of: Callable[[Artefact], Runs], what: Text
) -> tuple[Condition, ...]:
    """Targets, runs and travel of everything there; a repeat that is another to the last digit is a copy of it."""
    try:
        runs = of(artefact)
    except MissingReadingError:
        runs = {}
    few = []
    if of is diagonals:
        whole = [run for run in runs.values() if _crosses(run, artefact)]
        count = len({tuple(np.sign(run.travel)) for run in whole})
        few += [say("{count} of the four body diagonals", count=count)] if count < DIAGONALS else []
    few += list(_short_of_travel(runs, artefact)) if of is axes else []
    for number, run in runs.items():
        if not _enough(run):
            few.append(say("measurement {number}: {repeats} runs, {targets} targets, {bare:.0f} % of the run without one",
                           number=number, repeats=run.repeats, targets=len(run.targets), bare=100 * _bare(run)))  # fmt: skip
        read = recorded and np.ptp(run.x) > 0  # and not planned beside a recording
        if read and run.both and np.array_equal(run.x[0], run.x[1]):
            few.append(say("measurement {number}: both directions are the same to the last digit", number=number))
        alike = np.all(run.x[..., :, None] == run.x[..., None, :], axis=(0, 1)) & ~np.eye(run.repeats, dtype=bool)
        if read and alike.any():
            first, second = (np.argwhere(alike)[0] + 1).tolist()
            few.append(say("measurement {number}: repeat {second} is repeat {first} to the last digit",
                           number=number, first=first, second=second))  # fmt: skip
    what = _TURNS if of is axes and artefact.angular else what
    return (Condition(what, tuple(few) if runs else (what,)),)


def _unstated(key: str, artefact: ArtefactFacts) -> str | None:
    """The key that says how uncertain the instrument is, where neither it nor that of a polygon does."""
    return None if not key or any(getattr(artefact, one, None) for one in (key, "u_polygon_arcsec")) else key


def _characteristics(
    names: Sequence[str], of: Callable[[Artefact], Runs], what: str, asked: Text, key: str
) -> tuple[Characteristic, ...]:
    decides, whole = partial(positioning, of=of, what=what, key=key), partial(conditions, of=of, what=asked)
    each = ((name, POSITIONING, partial(decides, figure=name), whole, partial(_unstated, key)) for name in names)
    return tuple(Characteristic(*one, lines=LINES, angle=of is axes) for one in each)


_RUNS = say("five runs in each direction, five targets a metre and five at least, over two thirds of the travel")
_TURNS = say(
    "five runs in each direction, 3, 5 or 8 targets over up to 90°, 180° or 360°, over two thirds of the travel"
)
# Figures of axes against the laboratory's own limits, read at rest or in motion
OWN_RULE = "laboratory's own rule"
OF_AXES = tuple(
    Characteristic(
        figure,
        POSITIONING,
        partial(positioning, figure=figure, of=axes, what="positioning", key="u_scale_um_per_m", own=True),
        unstated=partial(_unstated, "u_scale_um_per_m"),
        lines=LINES,
        angle=True,
    )
    for figure in "AERBM"
)
_CIRCLE = say("a full circle in both senses, targets 5° apart at most")
ISO_230_2 = _characteristics(["A", "E", "R", "B", "M"], axes, "positioning", _RUNS, "u_scale_um_per_m")
ISO_230_6 = _characteristics(
    ["Ed", "Bd"], diagonals, "diagonals",
    say("four body diagonals, five runs in each direction, five targets a metre and five at least"), "u_scale_um_per_m",
)  # fmt: skip
_OF_CIRCLES = partial(_characteristics, of=circles, what="circles", asked=_CIRCLE)  # only F and D rest on the radius
ISO_230_4_1996 = (*_OF_CIRCLES(["G", "H"], key=""), *_OF_CIRCLES(["F"], key="u_bar_um"))
ISO_230_4_2005 = (*_OF_CIRCLES(["G(b)"], key=""), *_OF_CIRCLES(["D"], key="u_bar_um"))

_ISO_230_2 = (
    Clause(
        "scope", say("scope"),
        "Linear axes up to 2 m, of longer ones the same formulas; rotary axes up to 360°. Both directions.",
        "its publisher's abstract; 2 m, 360°: as commonly reported",
    ),
    Clause(
        "targets_and_runs", say("targets and runs"),
        "Five runs in each direction; five targets a metre and five at least, the axis at rest at each: readings in motion "
        "are not decided. Of a rotary axis 3 targets up to 90°, 5 up to 180°, 8 beyond. Each axis over two thirds of its "
        "travel, no two neighbours farther apart than twice the spacing of as few even targets. That targets are not evenly "
        "spaced is not asked for.",
        "as commonly reported; at rest: GOST ISO 230-2-2016, its translation; two thirds, twice: this project",
    ),
    Clause(
        "formulas", say("figures"), "A, E, R, B and M with twice the standard uncertainty estimators, n − 1.", REPORTED,
    ),
    Clause(
        "test_uncertainty", say("test uncertainty"),
        "Instrument, alignment, temperature and changes between readings, by "
        "draws; the formulas of its annex are not used.",
        CHOSEN,
    ),
    ITS_RULE,
)  # fmt: skip

_ISO_230_4 = (
    Clause(
        "scope",
        say("scope"),
        "Circles of two linear axes, both senses; circles of linear with rotary axes (edition of 2022) are not evaluated.",
        "its publisher's abstract",
    ),
    Clause(
        "targets",
        say("targets and runs"),
        "A full circle in both senses; of a path recorded as it goes, a reading every 5° at least.",
        CHOSEN,
    ),
    Clause(
        "figures",
        say("figures"),
        "G by the minimum zone of each sense, H between both senses, F about the least-squares centre (1996); G(b) and D "
        "(2005). Diameter and feed, which the standard asks for beside them, are for the procedure to state.",
        REPORTED,
    ),
    _ISO_230_2[-2],
    ITS_RULE,
)
_ISO_230_6 = (
    Clause("scope", say("scope"), "Body diagonals; face diagonals are evaluated, and not decided.", REPORTED),
    Clause(
        "targets_and_runs",
        say("targets and runs"),
        "Four diagonals, each over two thirds of the travel of every axis, with the runs and targets of ISO 230-2.",
        CHOSEN,
    ),
    Clause("formulas", say("figures"), "Ed and Bd: E and B of ISO 230-2, the largest of the four.", REPORTED),
    _ISO_230_2[-2],
    ITS_RULE,
)
CLAUSES: Mapping[str, tuple[Clause, ...]] = {
    "ISO 230-2:2014": _ISO_230_2,
    "ISO 230-4:1996": _ISO_230_4,
    "ISO 230-4:2005": _ISO_230_4,
    "ISO 230-6:2002": _ISO_230_6,
}
