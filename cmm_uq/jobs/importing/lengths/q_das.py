"""Q-DAS transfer files: characteristics with their nominal values, and of each the values measured in turn."""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Sequence

from cmm_uq.base.errors import CmmUqError
from cmm_uq.base.messages import say
from cmm_uq.jobs.importing.format import Fact, ImportKeys, NotReadError, Row, Sheet, sheets_of
from cmm_uq.jobs.importing.reports import TextReport

_FIELD = re.compile(r"K(?P<key>\d{4})(?:/(?P<which>\d+))?\s+(?P<text>.*)")
_OF_AXIS = re.compile(r"(?<![^\W\d_])[XYZ](?![^\W\d_])", re.IGNORECASE)
_VALID, _INVALID = {"0", ""}, {"255", "256"}  # attributes of a value (K0002)


class Qdas(TextReport):
    """Q-DAS transfer files: of each characteristic name (K2002), nominal value (K2101), unit (K2142) and values.

    A value is a line K0001, or a part of a line without key: characteristics in their order between 0x0F, of each the value,
    its attribute (0 where it is valid, 255 or 256 where it is not), time and more between 0x14.
    """

    name = "q-das"
    title = say("Q-DAS transfer file (.dfq)")
    shows = (re.compile(r"\A\ufeff*\s*K0100\s"),)

    def sheets(self, lines: Sequence[str], where: str, keys: ImportKeys, encoding: Fact) -> Sequence[Sheet]:
        said, counted = dict[tuple[str, str], str](), Counter[str]()
        rows, last, marks = list[Row](), dict[str, int](), dict[int, str]()  # attributes by row
        for line, content in enumerate(lines, 1):
            match, at = _FIELD.fullmatch(content.strip()), f"{where} line {line}"
            values: list[tuple[str, str]] = []
            if match is not None:
                said[match["key"], which := match["which"] or "0"] = match["text"]
                values += [(match["which"] or "", match["text"])] if match["key"] == "0001" else []
                marks |= {last.get(which, len(rows) - 1): match["text"].strip()} if match["key"] == "0002" else {}
            elif content.strip():
                parts = [(*part.split("\x14"), "0")[:2] for part in content.strip("\r\n\x0f").split("\x0f")]
                order = [which for key, which in said if key == "2002"]
                if len(parts) != len(order) or not all(value.strip() for value, _ in parts):
                    what = f"has no key K, and not a value for each of {len(order)} characteristics (K2002)"
                    raise NotReadError(what, where=at, fix="Export values with keys (K0001/1 …)")
                marks |= {len(rows) + k: attribute.strip() for k, (_, attribute) in enumerate(parts)}
                values = [(which, value) for which, (value, _) in zip(order, parts, strict=True)]
            if odd := {*marks.values()} - _VALID - _INVALID:
                what = f"gives a value the attribute {min(odd)} (K0002)"
                raise NotReadError(what, where=at, fix="Say whether it is valid: 0, or 256 where it is not")
            for which, text in values:
                name, nominal = (said.get((one, which), "") for one in ("2002", "2101"))
                if not which or not (nominal or _OF_AXIS.search(name)):
                    raise NotReadError("has no nominal value (K2101)", where=at, fix="Export K2001 ff. too")
                counted[which] += 1
                last[which] = len(rows)
                rows.append(("", [name or which, f"{counted[which]}", nominal, text.strip()], line))
        units = {text for (key, _), text in said.items() if key == "2142"}
        if len(units) > 1:
            raise CmmUqError(f"is in {' and '.join(sorted(units))}", where=where, fix="Export it in one unit")
        void = [row for k, row in enumerate(rows) if marks.get(k) in _INVALID]
        if rows and len(void) == len(rows):
            raise NotReadError("marks every value as invalid (K0002)", where=where, fix="Export it with what is valid")
        left = tuple(f"line {line}: {' '.join(map(str, cells))!r}, invalid (K0002)" for _, cells, line in void)
        rows, heads = [row for row in rows if row not in void], ["name", "run", "nominal", "measured"]
        return sheets_of(rows, heads, unit=next(iter(units), None), facts=(encoding,), left_out=left)
