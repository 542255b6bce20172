"""A certificate that somebody received: who says what in it, what that rests on, and whether it holds."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, Literal

from cmm_uq.app.serve import page as p
from cmm_uq.app.serve.page import Block, Cell, PageNotice, PageParagraph, WebPage
from cmm_uq.app.serve.rendering import DESK
from cmm_uq.base.messages import Text, Verbatim, number, say

VERIFY = f"{DESK}/verify"
_HINT = say(
    "PDF, HTML, XML (DCC) or results.json of a certificate, or of the report of a part. It is read once and not kept."
)


def verify_page(name: str = "", found: Mapping[str, Any] | None = None) -> WebPage:
    """The form, below what was found of the file that was dropped."""
    form = p.Drop(VERIFY, say("Drop a certificate here, or choose one"), _HINT, say("Verify it"))
    above = (Cell(say("Desk"), DESK),)
    lead = say("Who says what, what it rests on, and whether it holds.")
    if found is None:
        return WebPage(say("Verify a certificate"), DESK, lead, (form,), above=above)
    word: Text = say("Something in it is wrong: do not rely on it")
    if found["word"] == "VERIFIED":
        word = say("Its files, figures and decisions agree with each other and with its inputs")
    elif not found["findings"]:
        word = say("Nothing in it is wrong, but not all of it could be checked from this file")
    standing: Literal["good", "open", "bad"] = (
        "bad" if found["findings"] else "good" if found["word"] == "VERIFIED" else "open"
    )
    head = PageNotice(Verbatim(found["said"]), standing, (Cell(word), Cell(Verbatim(found["signed"]))))
    rows = tuple(
        (
            Cell(say("wrong") if wrong else say("right"), standing="bad" if wrong else "good"),
            Cell(Verbatim(what)),
            Cell(number(count, ",d")),
        )
        for wrong, what, count in found["checks"]
    )
    headings = p.columns(say("Is"), say("What"), (say("Things"), "number"))
    table = p.PageTable(say("Comparisons"), headings, rows, heard=True)
    wrong: tuple[Block, ...] = tuple(PageParagraph(Verbatim(one)) for one in found["findings"])
    left: tuple[Block, ...] = tuple(PageParagraph(Verbatim(one), "note") for one in found["unchecked"])
    again = p.SourceText(say("Command"), f"cmm-uq verify {name}")
    records = p.Links((Cell(say("Is it in the records of this folder?"), "/file"),))
    sections = [(say("What is wrong"), wrong)] if wrong else []
    sections += [
        (say("What was compared"), (table,)),
        (say("What was not"), (*left, again, records)),
        (say("Another file"), (form,)),
    ]
    return WebPage(say("Verify a certificate"), DESK, Verbatim(name), (head,), tuple(sections), above)
