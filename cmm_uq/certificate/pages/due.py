"""Which machines are due for calibration."""

from __future__ import annotations

import datetime as dt
from collections import Counter
from collections.abc import Iterable, Mapping, Sequence

from cmm_uq import __version__
from cmm_uq.base.messages import DASH, NOTHING, Text, Verbatim, commas, day, number, plural, say, semicolons, sentences
from cmm_uq.certificate.document import Column, Document, Overview, Paragraph, Section, Standing, Table, text_columns
from cmm_uq.certificate.pages.fleet_summary import counted
from cmm_uq.laboratory.due.due import DueItem, State

STATE_WORDS: Mapping[State, Text] = {
    "overdue": say("overdue"), "due": say("due soon"), "later": say("later"), "unknown": say("no date"),
}  # fmt: skip


def due_document(items: Sequence[DueItem], on: dt.date, within: dt.timedelta) -> Document:
    """The page of what is due, by day; within ``within`` something is due soon."""
    each = [(say("Machines"), [one for one in items if one.item == "machine"]),
            (say("Artefacts"), [one for one in items if one.item == "artefact"])]  # fmt: skip
    sections = tuple(Section(title, (_table(rows, on, within, title),)) for title, rows in each if rows)
    return Document(
        title=say("What is due for calibration"),
        number=day(on),
        subject=say("on {on}, and within {days} days", on=day(on), days=within.days),
        sections=sections or (Section(say("Machines"), (Paragraph(say("Nothing is due.")),)),),
        attachments=(Verbatim("due.json"),),
        produced_by=say("cmm-uq {version}", version=Verbatim(__version__)),
        end=say("End of list"),
        overview=_overview(items, on, within),
    )


def counts(items: Iterable[DueItem], on: dt.date, within: dt.timedelta) -> tuple[Text, Standing]:
    """How many are overdue, due soon and without a date, in words; and what that means."""
    found = Counter(one.state(on, within) for one in items)
    words: tuple[tuple[State, Text], ...] = (
        ("overdue", say("{count} overdue", count=found["overdue"])),
        ("due", say("{count} due within {days} days", count=found["due"], days=within.days)),
        ("unknown", say("{count} without a date", count=found["unknown"])),
    )
    parts = [text for state, text in words if found[state]]
    standing: Standing = "bad" if found["overdue"] else "open" if parts else "good"
    return (commas(parts) if parts else say("Nothing due within {days} days", days=within.days)), standing


def _overview(items: Sequence[DueItem], on: dt.date, within: dt.timedelta) -> Overview:
    verdict, standing = counts(items, on, within)
    found, blocked = Counter(one.item for one in items), sum(one.blocked is not None for one in items)
    count = found["artefact"]
    artefacts = plural(count, one=say("one artefact"), many=say("{count} artefacts", count=count))
    looked_at = say("{machines} and {artefacts}", machines=counted(found["machine"]), artefacts=artefacts)
    out_of_date = ((say("Artefact out of date"), counted(blocked)),) if blocked else ()
    return Overview(verdict, standing, ((say("Looked at"), looked_at), *out_of_date))


def _table(rows: Sequence[DueItem], on: dt.date, within: dt.timedelta, title: Text) -> Table:
    cells = tuple(
        (
            DASH if one.due is None else day(one.due), STATE_WORDS[one.state(on, within)], Verbatim(one.serial),
            Verbatim(one.name) if one.name else DASH, Verbatim(one.place) if one.place else DASH,
            DASH if one.last is None else day(one.last), reason(one),
        )
        for one in rows
    )  # fmt: skip
    columns = (  # dates are not broken at their hyphens
        Column(say("Due")), *text_columns(say("State"), say("Serial number"), say("Name"), say("Place")),
        Column(say("Last calibrated")), *text_columns(say("Why")),
    )  # fmt: skip
    return Table(title, columns, cells)


def reason(one: DueItem) -> Text:
    """Why an item is due then, with all that is remarked of it."""
    parts = semicolons([one.why, *((one.blocked,) if one.blocked else ())])
    return sentences((say("{parts:capital}.", parts=parts), *one.remarks))


def due_row(one: DueItem, on: dt.date, within: dt.timedelta) -> tuple[Text, ...]:
    date: Text = DASH
    left: Text = NOTHING
    if one.due is not None:
        date, days = day(one.due), (one.due - on).days
        left = say("in {days} d", days=number(days)) if days >= 0 else say("{days} d ago", days=number(-days))
    serial = Verbatim(one.serial)
    what = say("machine {serial}", serial=serial) if one.item == "machine" else say("artefact {serial}", serial=serial)
    return date, STATE_WORDS[one.state(on, within)], left, what, reason(one)
