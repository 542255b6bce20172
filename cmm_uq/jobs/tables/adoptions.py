"""National names of international standards: which edition each adopts, and where that is said.

A certificate keeps the name that the job has, and says what it is taken for. An edition that adopts another one than is
decided here has no entry, for an older text asks for something else: JIS B 7440-2:2003 is ISO 10360-2:2001.
"""

from __future__ import annotations

import re
from collections.abc import Collection
from typing import NamedTuple

from cmm_uq.base.errors import suggestion
from cmm_uq.base.messages import Text, Verbatim, say


class Adoption(NamedTuple):
    """What a national name stands for; ``name``: without an edition where the one that it adopts is not decided here."""

    name: str
    source: Text | None


_MITUTOYO = say("Mitutoyo, introduction to the standards of the series JIS B 7440, which names the editions adopted")
_REPORTED = say("as commonly reported")
_EUROPEAN = say("CEN and CENELEC Internal Regulations, Part 2: an EN ISO is adopted unchanged by every member")
_BY_NUMBER = say("the national number repeats that of the international standard")
# national standard, its edition, and the international standard with the edition that it adopts
_TABLE: dict[tuple[str, int], tuple[str, Text]] = {
    ("JIS B 7440-2", 2013): ("ISO 10360-2:2009", _MITUTOYO),
    ("JIS B 7440-3", 2003): ("ISO 10360-3:2000", _MITUTOYO),
    ("JIS B 7440-5", 2013): ("ISO 10360-5:2010", _MITUTOYO),
    ("GB/T 16857.2", 2017): ("ISO 10360-2:2009", _REPORTED),
    ("GB/T 16857.3", 2009): ("ISO 10360-3:2000", _REPORTED),
    ("GB/T 16857.5", 2017): ("ISO 10360-5:2010", _REPORTED),
    ("GB/T 16857.8", 2022): ("ISO 10360-8:2013", _REPORTED),
}
_NUMBERED = {
    "JIS B 7440-": "ISO 10360-",
    "GB/T 16857.": "ISO 10360-",
    "JIS B 6190-": "ISO 230-",
    "GB/T 17421.": "ISO 230-",
}
_NATIONAL = re.compile(
    r"(?P<name>(?:JIS ?B ?|GB/?T ?)\d{4,5}[-.]\d{1,3})(?:[:-](?P<year>\d{4})(?:-\d\d)?)?", re.IGNORECASE
)
_MEMBER = "DIN|BS|NF|UNI|UNE|PN|ČSN|CSN|STN|SS|NS|DS|SFS|SN|NEN|ÖNORM|OENORM|MSZ|SIST|NBN|IS|EVS|LVS|LST|HRN|BDS|SR|TS|NP|ELOT"
_EUROPE = re.compile(
    rf"(?:(?:{_MEMBER})[ -])?EN ?ISO ?(?P<number>\d+-\d+)(?:[:-](?P<year>\d{{4}})(?:-\d\d)?)?", re.IGNORECASE
)
_REPEATED = re.compile(
    r"(?:KS ?B ?ISO|ABNT NBR ISO|NBR ISO|IS/ISO|SANS|AS ISO|ГОСТ Р ИСО|GOST R ISO|BS ISO|DIN ISO|NF ISO|TS ISO)"
    r" ?(?P<number>\d+-\d+)"
    r"(?:[:-](?P<year>\d{4})(?:-\d\d)?)?",
    re.IGNORECASE,
)
_AMERICAN = re.compile(r"(?:ANSI/|ANSI )ASME ?(?P<rest>B89.*)", re.IGNORECASE)
_YEAR = re.compile(r"[:-](\d{4})$")


def adopted(name: str, known: Collection[str]) -> Adoption | None:
    """What a national name is taken for, of the standards that are ``known``; ``None`` where it is no such name.

    Examples
    --------
    >>> adopted("JIS B 7440-2:2013", ["ISO 10360-2:2009"]).name, adopted("DIN EN ISO 10360-2:2002", ["ISO 10360-2:2009"]).name
    ('ISO 10360-2:2009', 'ISO 10360-2')
    """
    plain = " ".join(name.split())
    if match := _AMERICAN.fullmatch(plain):
        own = f"ASME {match['rest']}"
        editions = [one for one in known if one == own or _YEAR.sub("", one) == own]
        return Adoption(
            editions[0] if len(editions) == 1 else own, say("ANSI approves standards of ASME under their names")
        )
    if match := _NATIONAL.fullmatch(plain):
        number = re.sub(r"^(JIS) ?B ?|^(GB)/?T ?", lambda of: "JIS B " if of[1] else "GB/T ", match["name"].upper())
        found = [own for (of, year), own in _TABLE.items() if of == number and match["year"] in (None, str(year))]
        if len(found) == 1 and found[0][0] in known:
            return Adoption(*found[0])
        begins = next((begin for begin in _NUMBERED if number.startswith(begin)), None)
        return None if begins is None else Adoption(number.replace(begins, _NUMBERED[begins]), None)
    for pattern, source in ((_EUROPE, _EUROPEAN), (_REPEATED, _BY_NUMBER)):
        if match := pattern.fullmatch(plain):
            return _of_edition(f"ISO {match['number']}", match["year"], known, source)
    return None


def _of_edition(standard: str, year: str | None, known: Collection[str], source: Text) -> Adoption:
    """The only edition, unless the national one is older; of several the last that it follows within two years."""
    editions = sorted((int(one.rpartition(":")[2]), one) for one in known if one.startswith(f"{standard}:"))
    if year is not None:
        late = 2 if len(editions) > 1 or source is _EUROPEAN else 30
        editions = [(of, one) for of, one in editions if of <= int(year) <= of + late][-1:]
    return Adoption(editions[0][1], source) if len(editions) == 1 else Adoption(standard, None)


def taken_for(name: str, adoption: Adoption) -> tuple[Text, ...]:
    """What a certificate says of a national name."""
    if adoption.source is None:
        return ()
    own, of, by = Verbatim(name), Verbatim(adoption.name), adoption.source
    return (say("{name} is taken for the adoption of {standard}: {source}.", name=own, standard=of, source=by),)


def nearest(name: str, known: Collection[str]) -> str:
    """Answer to an unknown name of a standard: of a national one the editions of what it adopts."""
    adoption = adopted(name, known)
    if adoption is None:
        return suggestion(name, known)
    editions = [one for one in known if _YEAR.sub("", one) == adoption.name]
    here = f"decided here is {' or '.join(map(repr, editions))}" if editions else "which is not decided here"
    return f"It adopts an edition of {adoption.name}: {here}"
