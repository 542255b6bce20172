"""Whether the records agree with their chain: the head to be filed elsewhere, and a comparison when it is asked for."""

from __future__ import annotations

from cmm_uq.app.serve.checking import MOST, Checked
from cmm_uq.app.serve.exchange import Asked
from cmm_uq.app.serve.page import Block, Cell, Column, Facts, Links, Notice, Page, Paragraph, Press, Section, Table
from cmm_uq.app.serve.view import View
from cmm_uq.app.serve.words import moment
from cmm_uq.base.messages import NOTHING, Verbatim, number, plural, say
from cmm_uq.laboratory.records.place import shown as shown_place

_WHAT = say(
    "Every entry carries the hash of the one before. A comparison finds entries that were altered, deleted or exchanged, and "
    "tables and files that are not what was recorded. Whether entries are missing at the end, only a head that was filed "
    "elsewhere can show."
)


def integrity_page(view: View, asked: Asked) -> Page:
    """The head of the records, and what the last comparison found.

    Raises
    ------
    Refused : the address asks for something that the page does not know.
    """
    asked.only(())
    count, head = view.records.head()
    rows = (
        (say("Entries"), Cell(number(count, ",d"))),
        (say("Head"), Cell(Verbatim(head) if count else say("none yet"))),
        (say("Records"), Cell(Verbatim(shown_place(view.records.place)))),
    )
    return Page(
        say("Integrity"), "/integrity", lead=NOTHING,
        blocks=(*_found(view, (count, head)), Facts(rows, wide=True)),
        sections=(Section(say("Compare the records with their chain"), _forms(view)),),
    )  # fmt: skip


def _forms(view: View) -> tuple[Block, ...]:
    if (since := view.checking.since) is not None:
        told = say("A comparison is under way since {moment}.", moment=moment(since))
        return (Paragraph(told), Links((Cell(say("Look again"), "/integrity"),)))
    return (
        Paragraph(_WHAT),
        Press("/integrity/chain", say("Compare entries and tables")),
        Press("/integrity/files", say("Compare entries, tables and all files")),
    )  # fmt: skip


def _found(view: View, head: tuple[int, str]) -> tuple[Block, ...]:
    last = view.checking.last
    if last is None:
        return (Notice(say("Not compared since cmm-uq serve was started"), "open"),)
    at = say("Compared on {moment}, {what}, up to entry {number}.", moment=moment(last.at), number=number(last.head[0]),
             what=say("with all files") if last.files else say("without files"))  # fmt: skip
    later = (Cell(say("Entries were added since.")),) if last.head != head else ()
    if last.failed:
        failed = Cell(Verbatim(last.failed))
        return (Notice(say("The records could not be compared"), "bad", (failed, Cell(at))),)
    if not last.count:
        return (Notice(say("The records agree with their chain"), "good", (Cell(at), *later)),)
    head_text = plural(last.count, one=say("One thing is not as it was recorded"),
                       many=say("{count} things are not as they were recorded", count=number(last.count, ",d")))  # fmt: skip
    return (Notice(head_text, "bad", (Cell(at), *later)), _table(last))


def _table(last: Checked) -> Table:
    kinds = {"chain": say("Entry"), "index": say("Table"), "file": say("File"), "missing": say("Missing file")}
    rows = tuple(
        (Cell(say("Entry {number}", number=number(one.entry)) if one.entry is not None else say("Records")),
         Cell(kinds.get(one.kind, Verbatim(one.kind))), Cell(Verbatim(one.problem)))
        for one in last.findings
    )  # fmt: skip
    more = (say("Shown are the first {most}.", most=number(MOST)),) if last.count > len(rows) else ()
    return Table(say("What is not as it was recorded"), (Column(say("Where")), Column(say("What")), Column(say("Finding"))),
                 rows, notes=more)  # fmt: skip
