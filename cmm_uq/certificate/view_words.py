"""What both views say by themselves: the labels of a decision, the head of the warnings, the foot of a page."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from cmm_uq.base.languages.language import Code
from cmm_uq.base.languages.saying import said_in
from cmm_uq.base.messages import Text, Verbatim, say

_BREAK = Verbatim("\x1f")

WORDS: Mapping[str, Text] = {
    "number": say("No."), "quantity": say("Quantity"), "measured": say("Measured"), "limit": say("Limit"),
    "rule": say("Decision rule"), "missing": say("Missing"), "warning": say("Warning"), "warnings": say("Warnings"),
    "warning_mark": say("Warning."), "in_short": say("In short"), "particulars": say("Particulars"),
    "authorised": say("Authorised by"),
    "attachments": say("Files that belong to this document: {files}", files=_BREAK),
    "page": say("Page {page} of {pages}", page=_BREAK, pages=_BREAK),
    "replaced": say("□ stands for a character that the fonts of this file lack: {codes}. The HTML view shows it.",
                    codes=_BREAK),
    "annex": say("Annex: opinions and interpretations"),
    "annex_clause": say("Opinions and interpretations by ISO/IEC 17025:2017, 7.8.7."),
    "annex_note": say(
        "What stands in this annex interprets the results above. It is no result of the "
        "calibration, and no statement of conformity rests on it."
    ),
    "pass": say("Pass"), "fail": say("Fail"), "undecided": say("Undecided"), "incomplete": say("Incomplete"),
    "conditional pass": say("Conditional pass"), "conditional fail": say("Conditional fail"), "remeasure": say("Remeasure"),
}  # fmt: skip
"""By the names that the templates use."""


def view_words(language: Code) -> dict[str, Any]:
    """The same as plain text in a language; what a view fills in parts it into a list."""
    said = {name: str.__str__(said_in(text, language)) for name, text in WORDS.items()}
    return {name: text.split(_BREAK) if _BREAK in text else text for name, text in said.items()}


def label(kind: str, number: int) -> Text:
    """What a table or a picture is called: ``Table 2``."""
    return say("Table {number}", number=number) if kind == "table" else say("Figure {number}", number=number)


def described(name: str, *, outcome: bool) -> Text:
    """What an attached file is."""
    if outcome:
        return say("Results in machine-readable form: {name}", name=Verbatim(name))
    return say("Input of this document: {name}", name=Verbatim(name))
