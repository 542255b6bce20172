"""The part itself: its features as they are probed, where it lies, the errors of its points, the form that was measured."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from cmm_uq.analysis.parts.in_words import ASSOCIATIONS, KINDS
from cmm_uq.analysis.parts.plan import Plan, Stylus
from cmm_uq.analysis.parts.result import deviations_of
from cmm_uq.base.messages import DASH, NOTHING, Text, Verbatim, commas, in_a_row, names, number, say, semicolons, signed
from cmm_uq.base.points import Floats
from cmm_uq.base.units import MICROMETRE, unit
from cmm_uq.certificate.document import Block, Column, Facts, Paragraph, Section, Table
from cmm_uq.certificate.part.measurement import PartMeasurement
from cmm_uq.certificate.part.pictures import errors_picture, form_picture, part_picture
from cmm_uq.maths.uncertainty.quantity import nominal

_SHORT = 8  # letters up to which features are lettered in pictures by their names, else by their numbers


def lettered_names(plan: Plan) -> list[Text]:
    """What features are called in pictures: their names where all are short, else their numbers."""
    if all(len(feature.name) <= _SHORT for feature in plan.features):
        return [Verbatim(feature.name) for feature in plan.features]
    return [number(i + 1) for i in range(len(plan.features))]


def part_section(found: PartMeasurement) -> Section:
    """What is probed, with which styli, and where the part lies."""
    plan = found.plan
    several = len(plan.styli) > 1
    columns = (
        Column(say("No.")), Column(say("Feature"), numeric=False), Column(say("Kind"), numeric=False),
        Column(say("Points")), *((Column(say("Stylus"), numeric=False),) if several else ()),
        Column(say("Association"), numeric=False),
    )  # fmt: skip
    rows = tuple(
        (number(i + 1), Verbatim(feature.name), KINDS[feature.kind], number(len(feature.points)),
         *((Verbatim(feature.stylus),) if several else ()),
         ASSOCIATIONS[feature.association] if len(feature.points) > 1 else DASH)
        for i, feature in enumerate(plan.features)
    )  # fmt: skip
    blocks: tuple[Block, ...] = (
        part_picture(plan, found.given.poses[0], lettered_names(plan)),
        Table(say("Features"), columns, rows, (_FEATURES,)),
        Facts(tuple(row for row in _lies(found) if row[1])),
    )
    return Section(say("The part as it is probed"), blocks)


_UM = unit("µm")
_FEATURES = say("Association: how a feature is made of its points, where a characteristic says nothing else.")


def _lies(found: PartMeasurement) -> list[tuple[Text, Text]]:
    facts, given = found.job.facts, found.job.facts.placing
    varied = len(found.given.poses)
    placed = say("origin at {origin} mm, turned by {angles}° about x, y, z of the machine",
                 origin=_three(found.origin_mm), angles=_three(given.rotation_deg))  # fmt: skip
    if varied > 1:
        placed = say("{placed}; drawn in {count} places about it", placed=placed, count=varied)
    datums = commas(names(facts.alignment.datums))
    alignment = say("best fit of all points") if facts.alignment.best_fit else datums
    repeats = facts.probing.repeats
    return [
        (say("Place in the machine"), placed),
        (say("Alignment"), alignment),
        (say("Styli"), semicolons(_stylus(one) for one in found.plan.styli)),
        (say("Repeats of each point"), number(repeats) if repeats > 1 else NOTHING),
    ]


def _stylus(one: Stylus) -> Text:
    return say("{name}: tip of {diameter} mm, offset {offset} mm", name=Verbatim(one.name), diameter=nominal(one.diameter_mm),
               offset=_three(one.offset_mm.tolist()))  # fmt: skip


def _three(values: Sequence[float]) -> Text:
    return in_a_row(nominal(value) for value in values)


def errors_section(found: PartMeasurement) -> Section:
    """The errors of the points, and the form that was measured."""
    blocks: list[Block] = [errors_picture(found.plan, found.displaced)]
    deviations = None if found.job.measured is None else deviations_of(found.plan, found.job.measured)
    if deviations is not None and np.isfinite(deviations).any():
        blocks += [form_picture(found.plan, deviations), _forms(found.plan, deviations)]
    elif found.measured is not None:
        blocks.append(Paragraph(say("No feature has more points than determine it: no form was measured."), "note"))
    return Section(say("Errors of the points"), tuple(blocks))


def _forms(plan: Plan, deviations: Floats) -> Table:
    """Range of the measured deviations of each feature that has some."""
    columns = (
        Column(say("No.")), Column(say("Feature"), numeric=False), Column(say("From"), _UM), Column(say("To"), _UM),
        Column(say("Root mean square"), _UM),
    )  # fmt: skip
    rows = []
    for i, feature in enumerate(plan.features):
        own = deviations[plan.rows[feature.name]] / MICROMETRE
        if np.isfinite(own).all():
            figures = (float(own.min()), float(own.max()), float(np.sqrt(np.mean(own**2))))
            rows.append((number(i + 1), Verbatim(feature.name), *(signed(each, ".1f") for each in figures)))
    note = say("Noise of the machine and its errors are in these distances too; no form is stated here.")
    return Table(say("Distances of the points from their features"), columns, tuple(rows), (note,))
