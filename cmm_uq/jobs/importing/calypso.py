"""Tables of Calypso (ZEISS): ``…_chr.txt``, a characteristic a line; ``…_fet.txt``, a feature a line; ``…_hdr.txt``, the head.

Of the characteristics those are taken whose ``idsymbol`` is the value of a coordinate (``xValue``, ``yValue``, ``zValue``):
the ``actual`` of the three that have one ``featureid`` is a point.
"""

from __future__ import annotations

from collections.abc import Sequence

from cmm_uq.base.errors import CmmUqError
from cmm_uq.base.files.limits import ROWS
from cmm_uq.base.messages import Verbatim, number, say
from cmm_uq.jobs.importing.encodings import decoded, head_text, report_lines
from cmm_uq.jobs.importing.format import Format
from cmm_uq.jobs.importing.keys import ImportKeys
from cmm_uq.jobs.importing.sheet import Fact, Row, Sheet, sheets_of

_AXES = {"xvalue": "X", "yvalue": "Y", "zvalue": "Z"}
_NEEDED = ("idsymbol", "actual", "featureid")


class Calypso(Format):
    """A table of characteristics."""

    name = "calypso"
    title = say("Calypso table of characteristics (chr.txt)")

    def recognises(self, head: bytes) -> bool:
        """See :meth:`Format.recognises`: by the names of its first columns."""
        return _first_line(head).startswith("planid\tpartnb")

    def read(self, content: bytes, where: str, keys: ImportKeys) -> Sequence[Sheet]:
        text, encoding = decoded(content, where, keys.encoding)
        lines = report_lines(text, where)
        header = [word.strip() for word in lines[0].split("\t")]
        _refuse_another_table(header, lines, where, keys)
        if keys.columns:
            rows = [[cell.strip() for cell in line.split("\t")] for line in lines if line.strip()]
            return [Sheet("", rows, [i for i, line in enumerate(lines, 1) if line.strip()],
                          facts=(Fact("encoding", say("Encoding"), Verbatim(encoding)),))]  # fmt: skip
        return self._characteristics(header, lines, encoding, where)

    def _characteristics(self, header: list[str], lines: Sequence[str], encoding: str, where: str) -> Sequence[Sheet]:
        index = {name: i for i, name in enumerate(header)}
        found: dict[str, dict[str, str]] = {}
        at: dict[str, int] = {}
        units: dict[str, int] = {}
        others = 0
        for line, content in enumerate(lines[1:], 2):
            cells = [cell.strip() for cell in content.split("\t")]
            if not any(cells) or cells[0].casefold() == "end":
                continue
            if len(cells) <= max(index[name] for name in _NEEDED):
                raise CmmUqError(f"the row ends after {len(cells)} of {len(header)} cells", where=f"{where} line {line}",
                                 fix="Export it again: the file was cut off or changed")  # fmt: skip
            axis = _AXES.get(cells[index["idsymbol"]].casefold())
            if axis is None:
                others += 1
                continue
            feature = cells[index["featureid"]]
            if axis in found.setdefault(feature, {}):
                raise CmmUqError(f"{axis} of {feature!r} is there twice", where=f"{where} line {line}",
                                 fix="Export each run as a file of its own, or name the features of each run")  # fmt: skip
            found[feature][axis] = cells[index["actual"]]
            at.setdefault(feature, line)
            if "unit" in index and len(cells) > index["unit"] and cells[index["unit"]]:
                units.setdefault(cells[index["unit"]], line)
        return self._sheets(found, at, units, others, encoding, where)

    def _sheets(
        self, found: dict[str, dict[str, str]], at: dict[str, int], units: dict[str, int], others: int, encoding: str,
        where: str,
    ) -> Sequence[Sheet]:  # fmt: skip
        if not found or len(found) > ROWS.most:
            raise CmmUqError(f"holds {others} characteristics and no coordinate of a feature", where=where,
                             fix="Report the X, Y and Z value of every ball or point as characteristics")  # fmt: skip
        partly = next((name for name, axes in found.items() if len(axes) < 3), None)
        if partly is not None:
            missing = next(axis for axis in _AXES.values() if axis not in found[partly])
            raise CmmUqError(f"{partly!r} has no {missing} value", where=f"{where} line {at[partly]}",
                             fix="Report X, Y and Z of every feature; if it is the last one, it was cut off")  # fmt: skip
        if len(units) > 1:
            one, other = list(units)[:2]
            raise CmmUqError(f"coordinates are in {one} and in {other}: the file mixes units",
                             where=f"{where} line {units[other]}", fix="Export it in one unit")  # fmt: skip
        facts = [Fact("encoding", say("Encoding"), Verbatim(encoding))]
        if others:
            facts.append(
                Fact("characteristics_not_used", say("Characteristics that are no coordinate"), number(others))
            )
        rows: list[Row] = [
            ("", [name, *(axes[axis] for axis in _AXES.values())], at[name]) for name, axes in found.items()
        ]
        return sheets_of(rows, ["name", "x", "y", "z"], unit=next(iter(units), None), facts=tuple(facts))


def _first_line(head: bytes) -> str:
    return head_text(head).lstrip("\ufeff").partition("\n")[0].strip().casefold()


def _refuse_another_table(header: Sequence[str], lines: Sequence[str], where: str, keys: ImportKeys) -> None:
    if all(name in header for name in _NEEDED) or keys.columns:
        return
    if len(lines) <= 3:
        raise CmmUqError("is the head of a Calypso table (hdr.txt), which has no measured value", where=where,
                         fix="Name the file that ends in _chr.txt and was written with it")  # fmt: skip
    raise CmmUqError("is a Calypso table whose columns are not known here (fet.txt?)", where=where,
                     fix="Name the file ending in _chr.txt, or columns = { x_mm = 9, y_mm = 10, z_mm = 11 }")  # fmt: skip
