"""Which way round deviations are, where a file says it: ``e = certified value − indicated value`` is not the usual one."""

from __future__ import annotations

import re
from collections.abc import Iterable, Sequence

from cmm_uq.jobs.importing.format import NotReadError, Sheet
from cmm_uq.jobs.importing.header import plain_words, words_of
from cmm_uq.jobs.importing.roles import said

_FORMULA = re.compile(
    r"([^\s=＝:;,(][^=＝:;,(]{0,40}?)\s*[=＝]\s*([^=＝;()]{1,60}?)\s*(?:(?<=\s)-(?=\s)|[−–－])\s*([^=＝;(),.−–－]{1,60})"
)
_RANK = {"measured": 0, "reference": 1, "nominal": 2, "target": 2}


def turned_by(sheets: Sequence[Sheet], heads: Iterable[str], where: str, *, targets: bool = False) -> bool:
    """Whether the texts of a file say that deviations are what they are of less what was measured.

    heads : of the columns of deviations; targets : whether these are at targets, which a laser measures.
    """
    own = {" ".join(plain_words(head)) for head in heads}
    told, unknown = dict[bool, str](), ""
    for text in dict.fromkeys(cell for sheet in sheets for row in sheet.rows for cell in row if isinstance(cell, str)):
        for match in _FORMULA.finditer(text):
            left = " ".join(plain_words(match[1]))
            if said(match[1]) != "deviation" and left not in own:
                continue
            first, second = (_rank(match[k]) for k in (2, 3))
            if first is None and second is None:
                unknown = unknown or match[0].strip()
                continue
            # of two the one that words know says what the other is
            first = first if first is not None else 0 if second else 2
            second = second if second is not None else 0 if first else 2
            if first != second and (not targets or 2 in (first, second)):
                told.setdefault(first > second, match[0].strip())
    if unknown and not told and not targets:
        what = f"says {unknown!r}, and no word of it which of both was measured"
        raise NotReadError(
            what, where=where, fix='Write it as "deviation = measured - reference", or the other way round'
        )
    if len(told) > 1:
        what = f"says that deviations are {told[False]!r}, and {told[True]!r}"
        raise NotReadError(what, where=where, fix="Take out what is not so")
    return True in told


def _rank(text: str) -> int | None:
    """How far words are from what a machine measured: that itself, a calibrated value, a nominal one; ``None`` of others."""
    if not {*plain_words(text)}.isdisjoint(words_of("lengths")["machine"]):
        return 0
    role = said(text)
    return _RANK.get(role) if role else None
