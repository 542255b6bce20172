"""What of a machine's history is in doubt, and the parts that were measured then: on its page, on the terminal and as data."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from typing import Any

from cmm_uq.base.messages import DASH, Text, Verbatim, day, plural, say, sentences
from cmm_uq.certificate import document as doc
from cmm_uq.certificate.origin import attributes
from cmm_uq.certificate.wording import OUTCOME_WORDS
from cmm_uq.laboratory.due.doubt import DoubtfulPeriod
from cmm_uq.laboratory.due.history import MachineHistory
from cmm_uq.laboratory.records.facts import MeasuredPart

NOTE = say(
    "In doubt are parts that were measured from the last day that found the machine in order, by no certificate of after it "
    "was so again: those that are recorded, and those of other reports beside the records or in the folders that are named."
)
_CERTIFICATE = say("Certificate of the machine")
HEADS = (say("Date"), say("No."), say("Part"), say("Serial number"), _CERTIFICATE, say("Decision"), say("Folder"))
LISTED = 100  # parts that are listed; the data have all


def doubt_words(one: DoubtfulPeriod) -> Text:
    """A period in words: what found the machine out of order, since when it is in doubt, up to when, and how many parts."""
    name, when, count = Verbatim(one.found.number or one.found.job), day(one.found.day), len(one.parts)
    found = say("The certificate {name} of {when} finds the machine beyond its limits.", name=name, when=when)
    if one.found.interim:
        found = say("The interim check {name} of {when} finds the machine out of control.", name=name, when=when)
    since = say("Nothing before found it in order: all that was measured on it is in doubt.")
    if one.after is not None:
        since = say("What was measured on it from {after} on is in doubt.", after=day(one.after))
    again = say("Nothing since finds it in order.")
    if one.until is not None:
        again = say("It is in order again by the calibration of {until}.", until=day(one.until))
    known = say("No report of a part that was measured then is known.")
    if count:
        single = say("The report of one part that was measured then is known.")
        many = say("The reports of {count} parts that were measured then are known.", count=count)
        known = plural(count, one=single, many=many)
    return sentences([found, since, again, known])


def doubtful_parts(history: MachineHistory) -> Iterator[MeasuredPart]:
    return (part for period in history.doubtful for part in period.parts)


def part_rows(parts: Iterable[MeasuredPart]) -> Iterator[tuple[Text, ...]]:
    for one in parts:
        texts = one.number, one.part, one.serial, one.certificate
        outcome = OUTCOME_WORDS.get(one.outcome, DASH)
        yield day(one.day), *(Verbatim(text) if text else DASH for text in texts), outcome, Verbatim(one.folder)


def doubt_section(history: MachineHistory) -> doc.Section:
    words = (doc.Paragraph(doubt_words(one)) for one in history.doubtful)
    rows = part_rows(doubtful_parts(history))
    parts = doc.table(say("Parts measured while the machine was in doubt"), HEADS, rows)
    note = doc.Paragraph(NOTE, "note") if history.doubtful else None
    return doc.section(say("In doubt"), *words, parts, note)


def parts_section(history: MachineHistory) -> doc.Section:
    """The newest first, as the records have them."""
    newest = part_rows(history.parts[: -LISTED - 1 : -1])
    caption = say("The newest {shown} of {count}", shown=min(LISTED, len(history.parts)), count=len(history.parts))
    return doc.section(say("Parts measured on it"), doc.table(caption, HEADS, newest))


def part_data(part: MeasuredPart) -> dict[str, Any]:
    names = ("number", "part", "serial", "certificate", "outcome", "folder")
    days = {"date": part.day.isoformat(), "calibrated": part.calibrated.isoformat()}
    return attributes(part, *names) | days | ({"entry": part.entry} if part.entry else {})


def doubt_data(history: MachineHistory) -> list[dict[str, Any]]:
    return [
        {
            "after": one.after and one.after.isoformat(),
            "found": {"entry": one.found.entry, "date": one.found.day.isoformat(), "interim": one.found.interim},
            "until": one.until and one.until.isoformat(),
            "parts": list(map(part_data, one.parts)),
        }
        for one in history.doubtful
    ]
