"""Which machines are due for calibration."""

from __future__ import annotations

import datetime as dt
from collections import Counter
from collections.abc import Iterable, Mapping, Sequence

from cmm_uq import __version__
from cmm_uq.base.messages import DASH, NOTHING, Text, Verbatim, commas, day, number, plural, say, semicolons, sentences
from cmm_uq.certificate.document import Block, Column, Document, Overview, Paragraph, Section, Standing, Table
from cmm_uq.laboratory.due.due import DueItem, State

STATE_WORDS: Mapping[State, Text] = {
    "overdue": say("overdue"), "due": say("due soon"), "later": say("later"), "unknown": say("no date"),
}  # fmt: skip


def due_document(items: Sequence[DueItem], on: dt.date, within: dt.timedelta) -> Document:
    """The page of what is due.

    ``items``: by day; ``on, within``: the day asked about, and how far ahead something is due soon.
    """
    machines = [one for one in items if one.item == "machine"]
    artefacts = [one for one in items if one.item == "artefact"]
    return Document(
        title=say("What is due for calibration"),
        number=day(on),
        subject=say("on {on}, and within {days} days", on=day(on), days=within.days),
        issuer=(),
        particulars=(),
        warnings=(),
        sections=tuple(
            Section(title, _table(rows, on, within, title))
            for title, rows in ((say("Machines"), machines), (say("Artefacts"), artefacts))
            if rows
        )
        or (Section(say("Machines"), (Paragraph(say("Nothing is due.")),)),),
        statements=(),
        signatures=(),
        attachments=(Verbatim("due.json"),),
        produced_by=say("cmm-uq {version}", version=Verbatim(__version__)),
        end=say("End of list"),
        overview=_overview(items, on, within),
    )


def counts(items: Iterable[DueItem], on: dt.date, within: dt.timedelta) -> tuple[Text, Standing]:
    """How many are overdue, due soon and without a date, in words; and what that means."""
    found = Counter(one.state(on, within) for one in items)
    parts: list[Text] = []
    if found["overdue"]:
        parts.append(say("{count} overdue", count=found["overdue"]))
    if found["due"]:
        parts.append(say("{count} due within {days} days", count=found["due"], days=within.days))
    if found["unknown"]:
        parts.append(say("{count} without a date", count=found["unknown"]))
    standing: Standing = "bad" if found["overdue"] else "open" if parts else "good"
    return (commas(parts) if parts else say("Nothing due within {days} days", days=within.days)), standing


def _overview(items: Sequence[DueItem], on: dt.date, within: dt.timedelta) -> Overview:
    verdict, standing = counts(items, on, within)
    blocked = sum(one.blocked is not None for one in items)
    count = plural(blocked, one=say("one machine"), many=say("{count} machines", count=blocked))
    rows: list[tuple[Text, Text]] = [(say("Looked at"), _looked_at(items))]
    if blocked:
        rows.append((say("Artefact out of date"), count))
    return Overview(verdict, standing, tuple(rows))


def _looked_at(items: Sequence[DueItem]) -> Text:
    found = Counter(one.item for one in items)
    machines, artefacts = found["machine"], found["artefact"]
    return say(
        "{machines} and {artefacts}",
        machines=plural(machines, one=say("one machine"), many=say("{count} machines", count=machines)),
        artefacts=plural(artefacts, one=say("one artefact"), many=say("{count} artefacts", count=artefacts)),
    )


def _table(rows: Sequence[DueItem], on: dt.date, within: dt.timedelta, title: Text) -> tuple[Block, ...]:
    heads = (
        say("Due"),
        say("State"),
        say("Serial number"),
        say("Name"),
        say("Place"),
        say("Last calibrated"),
        say("Why"),
    )
    cells = tuple(
        (
            DASH if one.due is None else day(one.due), STATE_WORDS[one.state(on, within)], Verbatim(one.serial),
            Verbatim(one.name) if one.name else DASH, Verbatim(one.place) if one.place else DASH,
            DASH if one.last is None else day(one.last), reason(one),
        )
        for one in rows
    )  # fmt: skip
    whole = (True, False, False, False, False, True, False)  # dates are not broken at their hyphens
    columns = tuple(Column(head, numeric=kept) for head, kept in zip(heads, whole, strict=True))
    return (Table(title, columns, cells),)


def reason(one: DueItem) -> Text:
    """Why an item is due then, with all that is remarked of it."""
    parts = [one.why, *((one.blocked,) if one.blocked else ())]
    told = say("{parts:capital}.", parts=semicolons(parts))
    return sentences((told, *one.remarks))


def due_row(one: DueItem, on: dt.date, within: dt.timedelta) -> tuple[Text, ...]:
    date = DASH if one.due is None else day(one.due)
    left = NOTHING if one.due is None else _left((one.due - on).days)
    what = say("machine {serial}", serial=Verbatim(one.serial)) if one.item == "machine" else (
        say("artefact {serial}", serial=Verbatim(one.serial)))  # fmt: skip
    return date, STATE_WORDS[one.state(on, within)], left, what, reason(one)


def _left(days: int) -> Text:
    return say("in {days} d", days=number(days)) if days >= 0 else say("{days} d ago", days=number(-days))
