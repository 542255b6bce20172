"""Output of DMIS programs (ISO 22093, ANSI/CAM-I 105.0): the actual features, ``FA(SPH1)=FEAT/SPHERE,OUTER,CART,x,y,z,d``."""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence

from cmm_uq.base.errors import CmmUqError
from cmm_uq.base.files.limits import LINE
from cmm_uq.base.messages import Verbatim, number, say
from cmm_uq.jobs.importing.encodings import decoded, head_text, report_lines
from cmm_uq.jobs.importing.format import Format
from cmm_uq.jobs.importing.keys import ImportKeys
from cmm_uq.jobs.importing.sheet import Cell, Fact, Row, Sheet, sheets_of

PLACED = {"SPHERE": 0, "POINT": 3, "CIRCLE": 3, "ARC": 3, "ELLIPS": 0}
"""Features whose first three numbers are their place, and how many of the next are a direction."""

_UNITS = {"MM": "mm", "CM": "cm", "M": "m", "INCH": "inch", "FEET": "ft"}
_UNIT = re.compile(r"^UNITS\s*/\s*(\w+)", re.IGNORECASE)
_ACTUAL = re.compile(r"^FA\s*\((?P<name>[^)]*)\)\s*=\s*FEAT\s*/\s*(?P<sort>\w+)\s*,(?P<rest>.*)$", re.IGNORECASE)
_ANY = re.compile(
    r"^[ \t]*(?:FA\s*\([^)]*\)\s*=\s*FEAT\s*/|OUTPUT\s*/\s*FA|DMISMN\s*/|DMISMD\s*/|FILNAM\s*/)",
    re.IGNORECASE | re.MULTILINE,
)
_POLAR = ("POL", "CYL", "SPH")


class Dmis(Format):
    """A file of output."""

    name = "dmis"
    title = say("DMIS output (ISO 22093)")

    def recognises(self, head: bytes) -> bool:
        return _ANY.search(head_text(head)) is not None

    def read(self, content: bytes, where: str, keys: ImportKeys) -> Sequence[Sheet]:
        text, encoding = decoded(content, where, keys.encoding)
        unit, rows, others = None, [], 0
        for line, statement in statements(report_lines(text, where), where):
            if found := _UNIT.match(statement):
                unit = _one_unit(unit, found[1], f"{where} line {line}")
            elif found := _ACTUAL.match(statement):
                row = _feature(found, line, where)
                rows += [row] if row else []
                others += row is None
        if not rows:
            what = (
                f"holds {others} actual features, none of them a sphere, point or circle"
                if others
                else "holds no actual feature"
            )
            raise CmmUqError(f"{what} (FA)", where=where, fix="Put the spheres or points out: OUTPUT/FA(…)")
        facts = [Fact("encoding", say("Encoding"), Verbatim(encoding))]
        if others:
            facts.append(Fact("features_not_used", say("Features that are no place"), number(others)))
        return sheets_of(rows, ["name", "x", "y", "z", "i", "j", "k"], unit=unit, decimal=".", facts=tuple(facts))


def statements(lines: Sequence[str], where: str) -> Iterator[tuple[int, str]]:
    """Statements without comments, those over several lines joined, with the line that each begins on."""
    begun, start = "", 0
    for line, content in enumerate(lines, 1):
        part = content.strip()
        if part.startswith("$$"):
            continue
        start = start if begun else line
        begun += part
        if len(begun) > LINE.most:
            raise CmmUqError(f"the statement goes on for more than {LINE.most} characters", where=f"{where} line {start}",
                             fix="Export it again: a line may not end in $ where its statement does")  # fmt: skip
        if begun.endswith("$"):
            begun = begun[:-1].rstrip() + " "
            continue
        yield start, begun
        begun = ""
    if begun:
        yield start, begun


def _one_unit(before: str | None, word: str, place: str) -> str:
    if word.upper() not in _UNITS:
        raise CmmUqError(f"UNITS/{word} is no unit of length of DMIS", where=place, fix=f"DMIS has {', '.join(_UNITS)}")
    unit = _UNITS[word.upper()]
    if before not in (None, unit):
        raise CmmUqError(f"the unit changes from {before} to {unit}: the file mixes units", where=place,
                         fix="Put all features out in one unit")  # fmt: skip
    return unit


def _feature(found: re.Match[str], line: int, where: str) -> Row | None:
    """Name and place of an actual feature; ``None`` of one that is no place."""
    sort, place = found["sort"].upper(), f"{where} line {line}, FA({found['name']})"
    if sort not in PLACED:
        return None
    words = [word.strip() for word in found["rest"].split(",")]
    if any(word.upper() in _POLAR for word in words):
        raise CmmUqError("is given in polar coordinates", where=place, fix="Put it out with CART")
    numbers: list[Cell] = [word for word in words if not word[:1].isalpha()]
    if len(numbers) < 3 or any(cell == "" for cell in numbers):
        raise CmmUqError(f"has {len([cell for cell in numbers if cell])} of the three coordinates of its place", where=place,
                         fix="Export it again: the line is damaged or the file was cut off")  # fmt: skip
    vector: list[Cell] = numbers[3:6] if PLACED[sort] and len(numbers) >= 6 and sort == "POINT" else ["", "", ""]
    return sort.lower(), [found["name"], *numbers[:3], *vector], line
