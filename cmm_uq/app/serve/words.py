"""The records' words as a reader sees them: states, decisions, verdicts, origins, each with how it is to be taken."""

from __future__ import annotations

import datetime as dt
from collections.abc import Mapping

from cmm_uq.app.serve.page import Cell
from cmm_uq.base.messages import DASH, NOTHING, Day, Text, Verbatim, day, say
from cmm_uq.certificate.document import Standing

Word = tuple[Text, Standing | None]

STATES: Mapping[str, Word] = {
    "draft": (say("Draft, not released"), "open"), "released": (say("Released"), "good"),
    "withdrawn": (say("Withdrawn"), "bad"), "replaced": (say("Replaced"), "bad"),
}  # fmt: skip

DECISIONS: Mapping[str, Word] = {
    "pass": (say("Pass"), "good"), "conditional pass": (say("Conditional pass"), "open"),
    "incomplete": (say("Incomplete"), "open"), "undecided": (say("Undecided"), "open"),
    "remeasure": (say("Remeasure"), "open"), "conditional fail": (say("Conditional fail"), "bad"),
    "fail": (say("Fail"), "bad"), "none": (say("None stated"), None),
}  # fmt: skip

VERDICTS: Mapping[str, Word] = {
    "consistent": (say("Consistent"), "good"), "explained": (say("Explained"), "open"),
    "partial": (say("Partly explained"), "open"), "unexplained": (say("Unexplained"), "bad"),
}  # fmt: skip

ORIGINS: Mapping[str, Text] = {
    "measured": say("Measured"), "simulated": say("Simulated"), "compensated": say("Compensated"),
}  # fmt: skip

NOT_MEASURED: Mapping[str, Text] = {
    "simulated": say("Nothing was measured: the recording was simulated"),
    "compensated": say("The recording was corrected by an error map, not measured so"),
}
"""What must not be overlooked of a recording that was not measured."""


def cell_of(words: Mapping[str, Word], word: str, *, address: str = "") -> Cell:
    """A word of the records in a cell; one that is not known, as it stands."""
    if not word:
        return Cell(DASH)
    text, standing = words.get(word, (Verbatim(word), "open"))
    return Cell(text, address, standing)


def day_cell(date: dt.date | None, *, before: dt.date | None = None, note: Text = NOTHING) -> Cell:
    """A date; one that lies before another is marked."""
    if date is None:
        return Cell(DASH, note=note)
    return Cell(day(date), standing="bad" if before is not None and date < before else None, note=note)


def moment(at: dt.datetime) -> Text:
    """A moment to the minute."""
    return say("{moment} UTC", moment=Day(f"{at:%Y-%m-%d %H:%M}"))


def shown(text: str) -> Text:
    """A name of the records, or a dash where it is empty."""
    return Verbatim(text) if text else DASH
