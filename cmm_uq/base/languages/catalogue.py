"""Catalogues: what each sentence of the program is in another language, from the ``.po`` files beside this module.

An entry's ``msgid`` is a pattern as :func:`cmm_uq.base.messages.say` has it, placeholders included; those of a
``Plural`` are ``msgid`` and ``msgid_plural``. ``python -m tests.catalogues`` keeps the files in step
with the sentences.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from functools import cache
from pathlib import Path

from cmm_uq.base.languages.language import Code
from cmm_uq.base.messages import fields_of


@dataclass(frozen=True)
class Catalogue:
    """Patterns in one language, by the English ones.

    Parameters
    ----------
    single : of messages.
    plural : of plurals, by both forms of English: the forms of the language, that for one first.
    """

    single: Mapping[str, str]
    plural: Mapping[tuple[str, str], tuple[str, ...]]

    def of_count(self, one: str, many: str, *, singular: bool, exactly_one: bool) -> str | None:
        """The form of a count; ``None`` where the catalogue has none.

        A form that says its number in words ("une longueur") is for one alone, though the grammar of a language may use the
        singular of other counts, as French does of 0.
        """
        forms = self.plural.get((one, many))
        if forms is None:
            return None
        if singular and (exactly_one or fields_of(many) <= fields_of(forms[0])):
            return forms[0]
        return forms[-1]


def file_of(code: Code) -> Path:
    """The file of a language's catalogue."""
    return Path(__file__).with_name(f"{code}.po")


@cache
def catalogue(code: Code) -> Catalogue:
    """The catalogue of a language, read when it is first asked for."""
    single: dict[str, str] = {}
    plural: dict[tuple[str, str], tuple[str, ...]] = {}
    for entry in _entries(file_of(code).read_text(encoding="utf-8")):
        forms = tuple(text for name, text in entry.items() if name.startswith("msgstr"))
        if not entry["msgid"] or not all(forms):
            continue
        if "msgid_plural" in entry:
            plural[entry["msgid"], entry["msgid_plural"]] = forms
        else:
            single[entry["msgid"]] = forms[0]
    return Catalogue(single, plural)


def _entries(text: str) -> Iterator[dict[str, str]]:
    """Texts of each entry that is not fuzzy, by their keywords: ``msgid``, ``msgstr[0]``."""
    entry: dict[str, str] = {}
    fuzzy, ignored, last = False, False, ""
    for line in (*text.splitlines(), 'msgid ""'):
        if line.startswith("#,"):
            fuzzy = "fuzzy" in line
        keyword, quote, rest = line.partition('"')
        if line.startswith("#") or not quote:
            continue
        if keyword == "msgid ":
            if entry:
                yield entry
            entry, ignored, fuzzy = {}, fuzzy, False
        if keyword:
            last = keyword.strip()
        if not ignored:
            entry[last] = entry.get(last, "") + _ESCAPED.sub(lambda found: _MEANT.get(found[1], found[1]), rest[:-1])


_ESCAPED, _MEANT = re.compile(r"\\(.)"), {"n": "\n", "t": "\t"}
