"""A laboratory's own rule: figures of an artefact that no standard decides, against the limits that the laboratory states.

What stays uncertain is that of the artefact alone, as in the standards: its certificate and circumstances where something is
compared with it, what of it changes between readings where it cancels, its own form. The machine's errors and scatter are
what is tested. What a complete test consists of is the laboratory's too, and without it nothing passes.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import replace
from functools import partial

import numpy as np
from numpy.typing import NDArray

from cmm_uq.analysis.conformity import positioning
from cmm_uq.analysis.conformity.plans import Condition
from cmm_uq.analysis.conformity.standard import NOT_STATED, Characteristic, Standard, Test, length_unstated
from cmm_uq.analysis.conformity.statement import Statement, least_favourable
from cmm_uq.analysis.conformity.uncertainty import (
    FORM_LINES,
    LENGTH_LINES,
    REPEAT_LINES,
    Causes,
    causes_of_lengths,
    length_budget,
    temperatures,
    u_of_repeats,
)
from cmm_uq.base.messages import Text, Verbatim, say
from cmm_uq.base.points import Points
from cmm_uq.base.units import ARCSECOND, MICROMETRE, REFERENCE_TEMPERATURE
from cmm_uq.jobs.tables.artefact import ArtefactFacts
from cmm_uq.jobs.tables.plan import CompleteTest
from cmm_uq.machine.model.artefact import Artefact, ArtefactFigure, Indications

NAME = positioning.OWN_RULE
# lines of a figure whose u is that of its evaluation, with all that is stated of the readings
EVALUATED: tuple[str, ...] = ()
ORIENTATION_LINES, TURNING_LINES = ("orientation",), ("turning",)  # of angles, as arcs over a length
# each figure: what is compared, what is counted of it, and the lines of its uncertainty
FIGURES: Mapping[str, tuple[Text, Text, tuple[str, ...]]] = {
    "error": (say("error of length, worst against its limit"), say("lengths"), LENGTH_LINES),
    "mean error": (say("mean error of all lengths"), say("means"), LENGTH_LINES),
    "standard deviation of errors": (
        say("standard deviation (n − 1) of the errors of all lengths"), say("standard deviations"), LENGTH_LINES,
    ),
    "angle error": (
        say("error of an angle, as an arc over the shorter of its sides, worst against its limit"), say("angles"),
        LENGTH_LINES,
    ),
    "repeatability": (say("range of repeats in one place, worst against its limit"), say("ranges"), REPEAT_LINES),
    "span": (say("span of the radii about the best centre"), say("spans"), REPEAT_LINES),
    "standard deviation": (
        say("standard deviation of the radii about their mean and the best centre"), say("standard deviations"),
        REPEAT_LINES,
    ),
    "span corrected": (
        say("span of the radii that would remain with three scales and three squarenesses corrected"), say("spans"),
        REPEAT_LINES,
    ),
    "standard deviation corrected": (
        say("standard deviation of the radii that would remain with three scales and three squarenesses corrected"),
        say("standard deviations"), REPEAT_LINES,
    ),
    "pivot offset": (
        say("distance of the centre that is best without corrections from that which is best with them"),
        say("distances"), REPEAT_LINES,
    ),
    "flatness": (say("flatness, worst against its limit"), say("planes"), FORM_LINES),
    "roundness": (say("roundness, worst against its limit"), say("rings"), FORM_LINES),
    "closure": (
        say("distance of the sphere's centre in one attitude from that of all, worst against its limit"),
        say("distances"), REPEAT_LINES,
    ),
    "linearity": (say("linearity error of the axis, peak to valley"), say("curves"), EVALUATED),
    "straightness": (
        say("straightness of a motion, peak to valley, worst against its limit"), say("curves"), EVALUATED,
    ),
    "squareness": (
        say("squareness of two axes, as an arc over the shorter of their travels"), say("angles"), EVALUATED,
    ),
}  # fmt: skip
ANGLES = ("angle error", "squareness")
SIGNED = ("error", "mean error", *ANGLES)
_UNSTATED = {
    EVALUATED: "u_coordinate_um",
    LENGTH_LINES: "u_um",
    REPEAT_LINES: "u_repeat_um",
    FORM_LINES: "form_um",
    ORIENTATION_LINES: "u_orientation_arcsec",
    TURNING_LINES: "u_repeat_arcsec",
}


def titled(standard: str) -> Text:
    """A standard by its name, the laboratory's own rule in words."""
    return say("laboratory's own rule") if standard == NAME else Verbatim(standard)


def decided(test: Test, *, name: str) -> Statement:
    """One figure of the artefact, everywhere that it has a value."""
    quantity, measured, lines = FIGURES[name]
    figure = test.artefact.figures(counting(test.recorded.points))
    if name not in figure or not len(figure[name].values):
        if lines == LENGTH_LINES:
            test.indications()
        problem = f"the readings do not determine the {name} of the {test.artefact.kind}"
        fix = "Record more places in more directions, or repeats, or leave the statement out"
        raise test.error(problem, "characteristic", fix)
    return figure_decided(test, figure[name], quantity, measured, lines, of_two_sides=name in SIGNED)


def figure_decided(
    test: Test, found: ArtefactFigure, quantity: Text, measured: Text, lines: tuple[str, ...], *, of_two_sides: bool
) -> Statement:
    """Values of a figure, each against its limit, with what these lines leave uncertain."""
    causes = _causes(test, found, lines)
    test.refuse_without_uncertainty(float(causes.u.min()), _key(test.artefact.key_of_u, lines))
    points, aside = test.artefact.points, test.set_aside(found.rows)
    of, repeats = points.measurement[found.rows], points.repeat[found.rows]
    one, same = (np.all(values == values[:, :1], axis=1) for values in (of, repeats))
    items = test.each_decided(
        found.values / MICROMETRE, causes.u, found.lengths, signed=of_two_sides, set_aside=aside,
        measurement=[int(number) if alone else None for number, alone in zip(of[:, 0], one, strict=True)],
        repeat=[int(turn) if alone else None for turn, alone in zip(repeats[:, 0], one & same, strict=True)],
        position=found.names,
    )  # fmt: skip
    worst = least_favourable(items)
    budget, i = None, items.index(worst)
    if lines == LENGTH_LINES and found.u is not None:
        recorded = temperatures(_indications(found), test.artefact)
        degrees = REFERENCE_TEMPERATURE if recorded is None else float(recorded[i])
        budget = length_budget(float(found.lengths[i]), float(found.u[i]), degrees, test.circumstances)
    remarks = [_SAID[lines] if worst.u_um > 0 else NOT_STATED]
    if test.facts.angle_arcsec is not None and worst.length_mm:
        remarks.append(positioning.as_angle(worst, test.facts.angle_arcsec))
    return test.stated(quantity, measured, items, remarks, signed=of_two_sides,
                       causes=causes if len(items) > 1 else None, budget=budget)  # fmt: skip


_SAID = {
    EVALUATED: say("u is that of the evaluation, half the longer side of its 95 % interval."),
    LENGTH_LINES: say("u is the test uncertainty of the artefact (as ISO/TS 23165 has that of a length)."),
    REPEAT_LINES: say(
        "What the artefact's certificate leaves uncertain cancels; u is what of it changes between readings."
    ),
    FORM_LINES: say("u is half the form deviation of the surface, and what its calibration leaves uncertain."),
    ORIENTATION_LINES: say("u is that of the measured angle, with alignment to the base."),
    TURNING_LINES: say("u is what of a measured angle changes between readings."),
}


def _key(of_artefact: str, lines: tuple[str, ...]) -> str:
    return of_artefact if lines == LENGTH_LINES else _UNSTATED[lines]


def _causes(test: Test, found: ArtefactFigure, lines: tuple[str, ...]) -> Causes:
    """What makes each value uncertain, not below the laboratory's capability."""
    m, least = len(found.values), test.least_u(found.lengths)
    if lines == LENGTH_LINES:
        return causes_of_lengths(_indications(found), test.artefact, test.circumstances).at_least(least)
    if lines == EVALUATED and found.u is not None:
        return Causes((found.u / MICROMETRE)[:, None], np.zeros(m), np.arange(m)).at_least(least)
    if lines == FORM_LINES:
        u = float(np.hypot(test.artefact.form / MICROMETRE / 2, test.circumstances.uncertainty.u_form_um))
        return Causes(np.full((m, 1), u), np.zeros(m), np.arange(m)).at_least(least)
    if lines in (ORIENTATION_LINES, TURNING_LINES):
        u = ARCSECOND * getattr(test.circumstances.uncertainty, _UNSTATED[lines]) / MICROMETRE
        shared = u * found.lengths if lines == ORIENTATION_LINES else np.zeros(m)
        return Causes(shared[:, None], u * found.lengths - shared, np.arange(m)).at_least(least)
    changes = np.array([u_of_repeats(float(length), test.circumstances) for length in found.lengths])
    return Causes(np.zeros((m, 0)), changes, np.arange(m)).at_least(least)


def _indications(found: ArtefactFigure) -> Indications:
    u = np.zeros(len(found.values)) if found.u is None else found.u
    return Indications(found.values, found.lengths, u, found.rows)


def counting(points: Points) -> NDArray[np.bool_]:
    """Which points (n,) are of no copy."""
    return ~np.isin(points.group, list(points.copies))


def enough(test: Test) -> tuple[Condition, ...]:
    """What the laboratory says of a complete test, held against what was recorded and is no copy."""
    if test.facts.complete is None:
        what = say("what a complete test consists of, by the laboratory's own rule")
        return (Condition(what, (what,), Verbatim("complete = { measurements, repeats, points } in [[conformity]]")),)
    return whole(test.facts.complete, test.recorded)


def whole(asked: CompleteTest, artefact: Artefact) -> tuple[Condition, ...]:
    """How many measurements, repeats and points there are, recorded or planned, of those that are asked for.

    Points that observe nothing, as a direction point before contact, are none.
    """
    points = artefact.points
    observed, own = np.isin(np.arange(len(points)), artefact.rows), counting(points)
    runs: dict[int, list[int]] = {}
    for g in np.unique(points.group[own]).tolist():
        runs.setdefault(points.run_of(g)[0], []).append(len(np.unique(points.point[observed & (points.group == g)])))
    few = (
        min((len(each) for each in runs.values()), default=0),
        min((n for each in runs.values() for n in each), default=0),
    )
    found = []
    for what, wanted, count in (
        (say("measurements"), asked.measurements, len(runs)),
        (say("repeats of each measurement"), asked.repeats, few[0]),
        (say("points of each repeat"), asked.points, few[1]),
    ):
        asks = say("{wanted} {what} by the laboratory's own rule", wanted=wanted, what=what)
        lacks = say("{what} ({least})", what=asks, least=count)
        found.append(Condition(asks, () if count >= wanted else (lacks,)))
    return tuple(found)


def form_unstated(artefact: ArtefactFacts) -> str | None:
    key = artefact.form_key
    return key if key is not None and not getattr(artefact, key) else None


def _unstated(lines: tuple[str, ...], artefact: ArtefactFacts) -> str | None:
    """The key of ``[artefact]`` without which there is no uncertainty."""
    if lines == FORM_LINES:
        return form_unstated(artefact)
    keys = [value.u_key for value in artefact.certified_values if value.u_key]
    known = any(getattr(artefact, key, None) for key in keys)
    return None if known or not keys or lines != LENGTH_LINES or not artefact.traced else keys[0]


def figure_error(test: Test, *, figure: str, title: Text, what: str, lines: tuple[str, ...]) -> Statement:
    """A figure of the artefact, everywhere that it has a value, against the limit of a standard."""
    figures = test.artefact.figures(counting(test.recorded.points))
    test.refuse_nothing_measured(figure in figures, what)
    return figure_decided(test, figures[figure], title, say("places"), lines, of_two_sides=False)


def figure_of(
    name: str,
    title: Text,
    what: str,
    conditions: Callable[..., tuple[Condition, ...]],
    *also: str,
    lines: tuple[str, ...] = REPEAT_LINES,
) -> Characteristic:
    figure = also[0] if also else name
    decides = partial(figure_error, figure=figure, title=title, what=what, lines=lines)
    of_length = lines == LENGTH_LINES
    one = Characteristic(name, figure, decides, conditions, length_unstated, lines=lines, also=also)
    return one if of_length else replace(one, unstated=lambda artefact: None, needs="u_repeat_um")


STANDARD = Standard(
    NAME,
    (
        *(
            Characteristic(
                name,
                name,
                partial(decided, name=name),
                unstated=partial(_unstated, lines),
                asks=enough,
                needs="u_repeat_um" if lines == REPEAT_LINES else None,
                lines=lines,
                angle=name in ANGLES,
            )
            for name, (_, _, lines) in FIGURES.items()
        ),
        *(replace(one, asks=enough) for one in positioning.OF_AXES),
    ),
    (
        say(
            "No standard decides this figure: limit, rule and what a complete test consists of are the laboratory's own."
        ),
    ),
)
