"""Traces of I++ DME (version 1.4 to 1.7): the answers to ``PtMeas``, as ``00169 # X(12.5), Y(0), Z(-3), IJK(0, 0, 1)``.

Lengths are millimetres by the specification. An answer to ``Get`` looks like one to ``PtMeas``, so a trace without the
requests is read only where all its answers report the same quantities.
"""

from __future__ import annotations

import re
from collections.abc import Sequence

from cmm_uq.base.errors import CmmUqError
from cmm_uq.base.messages import Verbatim, number, say
from cmm_uq.jobs.importing.encodings import decoded, head_text, report_lines
from cmm_uq.jobs.importing.format import Format
from cmm_uq.jobs.importing.keys import ImportKeys
from cmm_uq.jobs.importing.sheet import Cell, Fact, Row, Sheet, sheets_of

_LINE = re.compile(r"(?:^|[\s>\]:])(?P<tag>[E\d]\d{4})\s+(?P<what>[#&%!]|[A-Za-z]\w*\s*\()\s*(?P<rest>.*)$")
_TERM = re.compile(r"\b(X|Y|Z|IJK)\s*\(([^)]*)\)")
_ANY = re.compile(r"\b\d{5}[ \t]+(?:StartSession[ \t]*\(|PtMeas[ \t]*\(|[&%#])", re.MULTILINE)
_SCANS = ("ScanOn", "ScanIn", "ScanUnknown")


class Ipp(Format):
    """A trace."""

    name = "ipp"
    title = say("I++ DME trace")

    def recognises(self, head: bytes) -> bool:
        """See :meth:`Format.recognises`: by two lines with the tags and signs of the protocol."""
        return len(_ANY.findall(head_text(head))) >= 2

    def read(self, content: bytes, where: str, keys: ImportKeys) -> Sequence[Sheet]:
        text, encoding = decoded(content, where, keys.encoding)
        requests, answers, others, scans = _lines(report_lines(text, where))
        if not answers:
            what = (
                f"reports no measured point, and {scans} scans, which are not read"
                if scans
                else "reports no measured point"
            )
            raise CmmUqError(what, where=where, fix="Record the answers of the server (lines with #) with the requests")
        measured = {tag for tag, name in requests.items() if name == "PtMeas"}
        if requests:
            others += sum(tag not in measured for tag, *_ in answers)
            answers = [answer for answer in answers if answer[0] in measured]
        elif len({frozenset(terms) for _, terms, _ in answers}) > 1:
            raise CmmUqError("answers report different quantities, and no request tells which are measured points",
                             where=f"{where} line {answers[0][2]}", fix="Record the requests (PtMeas) too")  # fmt: skip
        _refuse_unanswered(measured, answers, where)
        rows = [_row(tag, terms, line, where) for tag, terms, line in answers]
        facts = [Fact("encoding", say("Encoding"), Verbatim(encoding))]
        if others:
            facts.append(Fact("answers_not_used", say("Answers that are no measured point"), number(others)))
        return sheets_of(rows, ["name", "x", "y", "z", "i", "j", "k"], unit="mm", decimal=".", facts=tuple(facts))


Answer = tuple[str, dict[str, str], int]
"""Tag, terms, line."""


def _lines(lines: Sequence[str]) -> tuple[dict[str, str], list[Answer], int, int]:
    """Requests by tag, answers with a place, number of other answers, number of scans."""
    requests: dict[str, str] = {}
    answers: list[Answer] = []
    others = scans = 0
    for line, content in enumerate(lines, 1):
        found = _LINE.search(content)
        if found is None or found["tag"].startswith("E"):
            continue
        if found["what"] not in "#&%!":
            name = found["what"].rstrip("( ")
            requests[found["tag"]] = name
            scans += name.startswith(_SCANS)
        elif found["what"] == "#":
            terms = dict(_TERM.findall(found["rest"]))
            if {"X", "Y", "Z"} <= set(terms):
                answers.append((found["tag"], terms, line))
            else:
                others += 1
    return requests, answers, others, scans


def _refuse_unanswered(measured: set[str], answers: Sequence[Answer], where: str) -> None:
    missing = sorted(measured - {tag for tag, *_ in answers})
    if missing:
        raise CmmUqError(f"PtMeas {missing[0]} has no answer: the trace was cut off, or the probing failed", where=where,
                         fix="Record the trace to its end, and measure the point again")  # fmt: skip


def _row(tag: str, terms: dict[str, str], line: int, where: str) -> Row:
    vector: list[Cell] = ["", "", ""]
    if "IJK" in terms:
        parts = [part.strip() for part in terms["IJK"].split(",")]
        if len(parts) != 3:
            raise CmmUqError(
                f"IJK({terms['IJK']}) is no direction", where=f"{where} line {line}", fix="Record the trace again"
            )
        vector = [*parts]
    return "", [tag, terms["X"].strip(), terms["Y"].strip(), terms["Z"].strip(), *vector], line
