"""The noise that a plan reckons with, and what repeats are worth beside placings under it, on the plan's page."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from cmm_uq.analysis.planning.repeats import Repeated
from cmm_uq.app.commands.plan_words import parameter_name, parameter_unit
from cmm_uq.app.commands.planning import RECORDED, Plan
from cmm_uq.base.messages import DASH, NOTHING, Text, Verbatim, number, say
from cmm_uq.base.points import Floats
from cmm_uq.base.units import MICROMETRE, unit
from cmm_uq.certificate.document import Block, Column, Paragraph, Table
from cmm_uq.maths.inference.linear_model import Unknown

SHOWN = 6
"""Repeats in the table; results.json has all that are compared."""

_PRIOR = say("not known: averaged over the prior")


def noise_facts(plan: Plan) -> tuple[tuple[Text, Text], ...]:
    """Reading noise, set-up offset and growth, and where each is from."""
    setting = plan.setting
    source: Text = say("assumed: the job states none")
    if setting.plan.noise_from is not None:
        source = say("from {file}", file=Verbatim(setting.plan.noise_from))
    elif setting.stated is not None:
        source = NOTHING
    elif plan.name == RECORDED:
        source = say("from the recording's residuals")
    reading = _size(setting.sigma, source)
    if setting.noise is None:
        return ((say("Noise of a coordinate"), reading), (say("Set-up offset"), say("taken as none")))
    known = NOTHING if setting.plan.noise_from is None else source
    return (
        (say("Noise of a coordinate"), reading),
        (say("Set-up offset"), _size(setting.noise.placing, known)),
        (say("Noise that grows with length"), _size(setting.noise.growth, known)),
    )


def _size(size: float | None, source: Text) -> Text:
    if size is None:
        return _PRIOR
    if not source:
        return say("{sigma:.2g} µm", sigma=size / MICROMETRE)
    return say("{sigma:.2g} µm ({source})", sigma=size / MICROMETRE, source=source)


def noise_data(plan: Plan) -> dict[str, Any]:
    """For results.json: sizes in µm, ``null`` where they are averaged over."""
    setting, noise = plan.setting, plan.setting.noise
    each = {"coordinate_um": setting.sigma / MICROMETRE, "stated": setting.stated is not None}
    if noise is None:
        return each
    return each | {
        **{f"{axis}_um": size / MICROMETRE for axis, size in zip("xyz", noise.reading, strict=True)},
        "placing_um": None if noise.placing is None else noise.placing / MICROMETRE,
        "growth_um": None if noise.growth is None else noise.growth / MICROMETRE,
        "from": setting.plan.noise_from,
    }


def averaging_note(plan: Plan) -> tuple[Text, ...]:
    """What an expected uncertainty is where part of the noise is not known."""
    noise = plan.setting.noise
    if noise is None or (noise.placing is not None and noise.growth is not None):
        return ()
    return (
        say(
            "What is not known of the noise is averaged over its prior: no set-up offset with a probability of one half, "
            "else about as large as the noise of a reading (half-Cauchy); u is the geometric mean. Better placings are "
            "searched for, and smallest effects predicted, with an offset as large as the noise of a reading. [plan] "
            "noise_from or placing_um would say it."
        ),
    )


def worth(plan: Plan) -> tuple[Block, ...]:
    """Repeats against placings."""
    found = plan.worth
    if found is None:
        return ()
    rows = found.rows[:SHOWN]
    heads = (
        Column(say("Repeats of every point"), numeric=False),
        *(Column(number(row.repeats)) for row in rows),
        Column(say("Unit"), numeric=False),
    )
    cells: list[tuple[Text, ...]] = [
        (say("Readings"), *(_pair(row.readings, row.readings_more, ".0f") for row in rows), NOTHING),
        (say("Time"), *(_pair(row.minutes, row.minutes_more, ".0f") for row in rows), unit("min")),
    ]
    for i, unknown in enumerate(found.unknowns):
        figures = (_figure(unknown, row, i) for row in rows)
        cells.append((parameter_name(unknown), *figures, parameter_unit(unknown)))
    notes = (
        say(
            "Expected u of each parameter with the {count} placings of the plan; in brackets with one more, which tells as "
            "much as they do on average. An offset of a set-up is shared by its repeats.",
            count=found.placings,
        ),
    )
    return (Table(say("Repeats and placings"), heads, tuple(cells), notes), Paragraph(_advice(plan)))


def _advice(plan: Plan) -> Text:
    if plan.worth is None:
        return NOTHING
    enough, most = plan.worth.enough, plan.worth.rows[-1].repeats
    repeats = plan.setting.plan.repeats
    if enough is None:
        return say(
            "Up to {most} repeats, a minute of one more repeat lowers at least one expected uncertainty more than a minute "
            "of one more placing. The plan has {repeats}.",
            most=most - 1, repeats=repeats,
        )  # fmt: skip
    if repeats > enough:
        return say(
            "With {enough} or more repeats, a minute of one more placing lowers every expected uncertainty more than a minute "
            "of one more repeat. The plan has {repeats}: fewer repeats and more placings would tell more in the same time.",
            enough=enough, repeats=repeats,
        )  # fmt: skip
    return say(
        "With {enough} or more repeats, a minute of one more placing lowers every expected uncertainty more than a minute of "
        "one more repeat. The plan has {repeats}.",
        enough=enough, repeats=repeats,
    )  # fmt: skip


def _pair(one: float, other: float, form: str) -> Text:
    return say("{one} ({other})", one=number(one, form), other=number(other, form))


def _figure(unknown: Unknown, row: Repeated, i: int) -> Text:
    if not np.isfinite(row.u[i]):
        return DASH
    unit = MICROMETRE if unknown.unit == "mm" else 1.0
    return _pair(row.u[i] / unit, row.u_more[i] / unit, ".2g")


def worth_data(plan: Plan) -> dict[str, Any] | None:
    """For results.json: uncertainties in the unit of each parameter, ``null`` where it stays free."""
    if plan.worth is None:
        return None

    return {"from_repeats": plan.worth.enough, "rows": [_row_data(plan.worth.unknowns, row) for row in plan.worth.rows]}


def _row_data(unknowns: Sequence[Unknown], row: Repeated) -> dict[str, Any]:
    more = {"readings": row.readings_more, "minutes": row.minutes_more, "u": _by_name(unknowns, row.u_more)}
    return {
        "repeats": row.repeats, "readings": row.readings, "minutes": row.minutes, "u": _by_name(unknowns, row.u),
        "one_placing_more": more,
    }  # fmt: skip


def _by_name(unknowns: Sequence[Unknown], u: Floats) -> dict[str, float | None]:
    return {
        ".".join(one.key): float(each) if np.isfinite(each) else None for one, each in zip(unknowns, u, strict=True)
    }
