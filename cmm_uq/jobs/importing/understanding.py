"""A file read by understanding: sheets cut into blocks, every way of reading them tried, the one that figures confirm taken.

It is asked where no head says at once what the columns are. Nothing is guessed: rows between those that are read must be
summaries by word or by arithmetic, observations must be told apart by what stands beside them, and what the file leaves open
(where lines lie, a unit, which points belong together) is asked as of any other.
"""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np

from cmm_uq.base.errors import CmmUqError, suggestion
from cmm_uq.base.messages import DASH, Verbatim, commas, names, say
from cmm_uq.base.points import Floats
from cmm_uq.jobs.columns import COORDINATES, WHOLE
from cmm_uq.jobs.importing import format as units
from cmm_uq.jobs.importing.blocks import CutSheet, unit_elsewhere
from cmm_uq.jobs.importing.columns import SIGNS, by_extent, left_out_fact
from cmm_uq.jobs.importing.coordinates import points_in, rows_of_axes, runs_in
from cmm_uq.jobs.importing.factors import (
    Label,
    codes,
    hint,
    lines_and_runs,
)
from cmm_uq.jobs.importing.format import (
    UNITS,
    Fact,
    ImportKeys,
    NotReadError,
    Sheet,
    Sources,
    WrittenUnit,
    length_named,
    sources_of,
    stacked,
    transposed,
)
from cmm_uq.jobs.importing.header import Header, is_summary
from cmm_uq.jobs.importing.interferometer import AxisRun, axis_in, axis_runs
from cmm_uq.jobs.importing.length_columns import lengths_in
from cmm_uq.jobs.importing.lengths import MeasuredLengths
from cmm_uq.jobs.importing.numbering import numbered_points
from cmm_uq.jobs.importing.roles import SheetReading, each, heading, is_void, joined, labels_of, rows_left_out, said_by

ROWS_MOST = 20_000  # of a sheet that is understood this way


def reading_of(
    sheets: Sequence[Sheet], keys: Mapping[str, Sources], where: str
) -> tuple[SheetReading, list[str], CutSheet] | None:
    """What all sheets hold, rows that are left out, and the first sheet that is read; ``None`` where nothing is understood.

    What one sheet asks is asked where no other is read.
    """
    found: list[tuple[SheetReading, CutSheet]] = []
    problem: NotReadError | None = None
    for sheet in sheets:
        own: list[tuple[SheetReading, CutSheet]] = []
        sheet = stacked(sheet)
        both = (sheet, transposed(sheet)) if len(sheet.rows) <= ROWS_MOST else ()
        for one in filter(None, both):
            try:
                own = own or _of_sheet(one, keys, where, turned=one is not sheet)
            except NotReadError as error:
                problem = problem or error
        found += own
    kind = _kind(found)
    chosen = [one for one in found if one[0].kind == kind]
    # deviations of lengths that are there, and small tables beside a large one, are the same again
    chosen = [one for one in chosen if not one[0].deviations] or chosen
    chosen = [one for one in chosen if len(one[0].figures) * 8 > max(len(other[0].figures) for other in chosen)]
    if not chosen and problem is not None:
        raise problem
    if not chosen or (
        kind == "points" and not _counted_sheets([*dict.fromkeys(grid.sheet.name for _, grid in chosen)])
    ):
        return None
    _refuse_unmatched([grid for _, grid in chosen], keys, where)
    if kind == "lengths":
        _refuse_same_lines(chosen, where)
    left_out: list[str] = []
    elsewhere = (
        _tabled_places([*map(stacked, sheets)], {grid.sheet.name for _, grid in chosen}) if kind == "lengths" else {}
    )
    for grid in {id(own): own for _, own in chosen}.values():
        if (told := rows_left_out([reading for reading, own in chosen if own is grid], grid)) is None:
            return None
        left_out += told
    _label(chosen, elsewhere)
    return joined([reading for reading, _ in chosen]), left_out, chosen[0][1]


def _label(chosen: Sequence[tuple[SheetReading, CutSheet]], elsewhere: Mapping[str, str]) -> None:
    """Sheet of every observation, and where its line lies by its own sheet, else by its name in another."""
    for reading, grid in chosen:
        for labels, row in zip(reading.labels, reading.rows, strict=True):
            named = {elsewhere[text] for text in labels.values() if text in elsewhere}
            place = grid.places_of.get(row) or (named.pop() if len(named) == 1 else "")
            labels["sheet", ""] = grid.sheet.name
            labels |= {("place", ""): place} if place else {}


def _refuse_unmatched(grids: Sequence[CutSheet], keys: Mapping[str, Sources], where: str) -> None:
    """A column that the job names must be there."""
    matched = {one for grid in grids for one in grid.matched}
    for source in (str(one) for sources in keys.values() for one in sources_of(sources)):
        if source not in matched:
            headings = [heading(path) for path in grids[0].blocks[-1].paths]
            raise NotReadError(f"no column is {source!r}", where=where, fix=suggestion(source, headings))


def _kind(found: Sequence[tuple[SheetReading, CutSheet]]) -> str:
    """What the sheets hold before all else."""
    kinds = Counter[str]()
    for reading, _ in found:
        kinds[reading.kind] += len(reading.figures)
    ends = kinds["points"] >= kinds["lengths"]  # else places of lines, beside lengths that were measured along them
    return next((kind for kind in ("runs", "points", "lengths") if kind in kinds and (kind != "points" or ends)), "")


def _refuse_same_lines(chosen: Sequence[tuple[SheetReading, CutSheet]], where: str) -> None:
    """Sheets with the same lengths beside the same names are two recordings, unless their names count lines or runs."""
    sheets: dict[str, list[object]] = {}
    for reading, grid in chosen:
        columns = [{key: text for key, text in own.items() if key[0] == "column"} for own in reading.labels]
        lines = [key for key in columns[0] if hint(key[1].partition(" ")[2], lengths=True) == "line"]
        labels = [[own.get(key) for key in lines or own] for own in columns]
        sheets.setdefault(grid.sheet.name, []).append(sorted(map(str, labels)))
    words = any(hint(name, lengths=True) or axis_in(name) or name.strip().upper() in {*"XYZ"} for name in sheets)
    hinted = words or len({re.sub(r"\d+", "0", name) for name in sheets}) == 1
    first, *others = sheets
    if (
        others
        and not hinted
        and any(sheets[first] == sheets[other] for other in others)
        and any(map(bool, sheets[first]))
    ):
        what = f"sheets {', '.join(map(repr, sheets))} hold lengths of the same names, each a recording of its own"
        raise NotReadError(what, where=where, fix=f'Say which: sheet = "{first}"')


def _tabled_places(sheets: Sequence[Sheet], others: Collection[str]) -> dict[str, str]:
    """Places of lines by their names, of sheets that have a row for each; of a name with two places neither."""
    found: dict[str, set[str]] = {}
    for sheet in sheets:
        grid = CutSheet(sheet) if sheet.name not in others else None
        for row, place in (grid.places_of if grid else {}).items():
            found.setdefault(grid.text(row, 0) if grid else "", set()).add(place)
    return {name: places.pop() for name, places in found.items() if len(places) == 1}


def _called(reading: SheetReading) -> bool:
    """Whether words say which lengths, or targets, those that were measured are of: else rows are no columns."""
    return any(c.role for name in ("reference_mm", "target") for c in reading.taken.get(name, ()))


def _counted_sheets(sheets: Sequence[str]) -> bool:
    """Whether names of sheets count measurements or repeats, and are no tables of different things."""
    return len({re.sub(r"\d+", "0", name) for name in sheets}) == 1 or all(hint(name, lengths=False) for name in sheets)


def _of_sheet(
    sheet: Sheet, keys: Mapping[str, Sources], where: str, *, turned: bool
) -> list[tuple[SheetReading, CutSheet]]:
    grid = CutSheet(sheet, keys, where)
    found = []
    for blocks, rows in each(grid):
        usable = [
            row for row in rows if not is_summary(sheet.rows[row]) and not is_void(sheet.rows[row], "void", "feature")
        ]
        own = _layout(grid, usable) if usable else []
        readings: list[SheetReading] = []
        places = (points_in, rows_of_axes) if {*keys} <= {*WHOLE} else ()
        lengths = (runs_in, lengths_in)  # before their places, which may stand beside them
        for read in (lengths + places if {*own} <= {*grid.places_of} else places + lengths) if own else ():
            if (reading := read(grid, blocks, own)) is not None and (_called(reading) or not turned):
                readings.append(reading)
                if 2 * len({*reading.rows, *reading.others}) > len(own):
                    break  # else they are places of lines, or a few rows that were taken for others
        if readings:
            reading = max(readings, key=lambda one: len({*one.rows, *one.others}))
            reading.lines = [sheet.lines[row] for row in reading.rows]
            found.append((reading, grid))
    return found


def _layout(grid: CutSheet, rows: list[int]) -> list[int]:
    """Rows that have figures where most of them have."""
    fine = {k for row in rows for k, f in enumerate(grid.figures[row]) if f is not None and f[1] < 1}
    signs = {row: frozenset(k for k in fine if k < len(f := grid.figures[row]) and f[k] is not None) for row in rows}
    common = Counter(k for own in signs.values() for k in own)
    needed = {k for k, n in common.items() if n > 0.6 * len(rows)}
    return [row for row in rows if not needed or len(signs[row] & needed) * 2 > len(needed)]


@dataclass
class Understanding:
    """What a file holds: places with their numbers, lengths on lines, or runs along axes."""

    reading: SheetReading
    sheets: Sequence[Sheet]
    left_out: list[str]
    grid: CutSheet
    labels: list[Label]
    places: dict[str, str] = field(default_factory=dict)  # of lines, where the file says them

    @property
    def kind(self) -> str:
        return self.reading.kind

    def unit(self, keys: ImportKeys, where: str, reach_mm: float | None) -> tuple[WrittenUnit, Fact]:
        """The unit of lengths: of heads, file or job, the one that the file mentions, or by the size of the machine."""
        of_file, of_job = length_named(self.sheets[0].unit or ""), length_named(keys.unit or "")
        every = [
            (self.reading.unit, say("in the headings")),
            (of_file, say("in the file")),
            (of_job, say("by the key unit")),
        ]
        stated = [(unit, how) for unit, how in every if unit is not None]
        if len({unit.name for unit, _ in stated}) > 1:
            each_ = " and ".join(f"{unit.name} {how}" for unit, how in stated)
            raise CmmUqError(f"the unit is {each_}", where=where, fix="Mend the file, or leave out unit")
        if not stated and (unit := unit_elsewhere(self.sheets, small=False)) is not None:
            stated = [(unit, say("the only one that the file mentions"))]
        figures = np.array(self.reading.figures).T
        named = zip(COORDINATES if self.kind == "points" else ("reference_mm", "length_mm"), figures, strict=True)
        written = {name: [(own, None, 0)] for name, own in named if np.isfinite(own).all()}
        unit, how = stated[0] if stated else by_extent(written, where, reach_mm)
        return unit, Fact("unit", say("Unit of lengths"), say("{unit}, {how}", unit=Verbatim(unit.name), how=how))

    def facts(self, of_unit: Fact, used: Sequence[str]) -> tuple[Fact, ...]:
        heads = [
            say("heads of columns") if word.isdecimal() else Verbatim(word) for word in dict.fromkeys(used) if word
        ]
        words = commas(heads or [DASH])
        arithmetic = say("words and figures, {count} of them by arithmetic", count=self.reading.checked)
        unused = [name for name in dict.fromkeys(self.reading.unused) if name not in used]
        found = [of_unit, Fact("decimal", say("Decimal sign"), SIGNS[self.grid.sign])]
        found.append(Fact("understood", say("Columns understood by"), arithmetic))
        found.append(Fact("told_apart", say("Told apart by"), words))
        found += [Fact("not_used", say("Columns not used"), commas(names(unused)))] if unused else []
        sheet = (
            [Fact("sheet", say("Sheet"), commas(names([one.name for one in self.sheets])))]
            if self.sheets[0].name
            else []
        )
        return (*sheet, *self.sheets[0].facts, *found, *left_out_fact(self.left_out))

    @property
    def sources(self) -> dict[str, str]:
        further = {name: name for name in self.reading.covariates}
        return {
            name: ", ".join(heading(c.path) for c in own) for name, own in self.reading.taken.items() if own
        } | further

    @property
    def header(self) -> Header:
        """Head of the first block that is read, and which of its columns are taken."""
        row = self.reading.rows[0]
        block = next(block for block in self.grid.blocks if row in block.rows)
        taken = {name: tuple(c.i for c in own if c.i >= 0) for name, own in self.reading.taken.items()}
        return Header(
            block.head[-1] if block.head else row, block.rows[0], [heading(path) for path in block.paths], taken
        )

    def lengths(self, keys: ImportKeys, where: str, reach_mm: float | None) -> MeasuredLengths:
        unit, of_unit = self.unit(keys, where, reach_mm)
        figures, place = np.array(self.reading.figures), self.grid.at(self.header.row)
        lines, runs, used = lines_and_runs(
            self.labels, codes([None if np.isnan(one) else one for one in figures[:, 0]]), place
        )
        reference, measured = (units.converted(own, unit, "length_mm") for own in figures.T)
        if self.reading.deviations:
            said_mm = UNITS["mm"] if "deviation_mm" in keys.columns else None
            if (small := self.reading.small or said_mm or unit_elsewhere(self.sheets, small=True)) is None:
                bare = self.reading.taken["deviation_um"]
                what = f"nothing says the unit of {heading(bare[0].path)!r}: µm or mm"
                raise NotReadError(what, where=place, fix=said_by("deviation_um", bare, ", or deviation_mm"))
            measured = reference + units.converted(figures[:, 1], small, "length_mm")
        self.places = _places(lines, self.reading, measured, unit)
        bare_ = [None if np.isnan(one) else float(one) for one in reference]
        facts, own, out = self.facts(of_unit, used), self.reading, tuple(self.left_out)
        numbers, values = runs.tolist(), measured.tolist()
        return MeasuredLengths(lines, bare_, numbers, values, own.lines, own.covariates, self.sources, facts, out)

    def points(
        self, keys: ImportKeys, where: str, reach_mm: float | None
    ) -> tuple[dict[str, Floats], tuple[Fact, ...]]:
        if self.reading.bare and keys.points_per_measurement is None:
            known = keys.unit or self.sheets[0].unit or unit_elsewhere(self.sheets, small=False)
            what = f"no line names the columns: {', '.join(map(str, self.reading.bare))} may be x, y and z"
            unit_ = "" if known else ', and unit = "mm" or "inch"'
            fix = f'If they are, say how many rows in turn are one measurement, points_per_measurement = N (or "all"){unit_}'
            raise NotReadError(what, where=where, fix=fix)
        unit, of_unit = self.unit(keys, where, reach_mm)
        xyz = np.column_stack([units.converted(own, unit, "x_mm") for own in np.array(self.reading.figures).T])
        numbers, facts = numbered_points(self.labels, xyz, keys, where)
        further = {name: np.array(own) for name, own in self.reading.covariates.items()}
        used = [label.words.strip() for label in self.labels if len({*label.values}) > 1 and label.sort != "block"]
        return {**numbers, **dict(zip(COORDINATES, xyz.T, strict=True)), **further}, (
            *self.facts(of_unit, used),
            *facts,
        )

    def runs(self, where: str) -> list[AxisRun]:
        return axis_runs(self.reading, self.labels, self.sheets, where)


def _places(names: Sequence[str], reading: SheetReading, measured: Floats, unit: WrittenUnit) -> dict[str, str]:
    """Where lines lie, by the starts and ends that stand above them, which must be as far apart as their lengths need."""
    places = {}
    for name in dict.fromkeys(names):
        own = [k for k, one in enumerate(names) if one == name]
        stated = {reading.labels[k].get(("place", ""), "") for k in own}
        parted = [text.split() for text in stated if text]
        each = [np.array([[float(one) for one in part.split(",")] for part in (p[0], p[2])]) for p in parted]
        ways = [ends[1] - ends[0] if parts[1] == "end" else ends[1] for parts, ends in zip(parted, each, strict=True)]
        ways = [way / max(np.linalg.norm(way), 1e-9) for way in ways]
        alike = all(
            np.allclose([ends[0], way], [each[0][0], ways[0]], atol=1e-4) for ends, way in zip(each, ways, strict=True)
        )
        if each and len(each) == len(stated) and alike:
            ends, which = max(
                zip(each, parted, strict=True), key=lambda one: float(np.linalg.norm(one[0][1] - one[0][0]))
            )
            if which[1] == "direction":
                ends[1] = ends[0] + ways[0] * measured[own].max() * unit.down / unit.up
            ends = units.converted(ends, unit, "x_mm")
            if measured[own].max() * 0.98 - 1 <= np.linalg.norm(ends[1] - ends[0]) <= 3 * measured[own].max():
                places[name] = "from " + " to ".join(",".join(f"{one:.10g}" for one in end) for end in ends)
    return places


def understand(
    alternatives: Iterable[Sequence[Sheet]], keys: Mapping[str, Sources], where: str, *, points: bool
) -> Understanding | None:
    """The reading that figures confirm most, of the ways of cutting a file into cells; ``None`` where there is none.

    points : whether one of points is looked for; what words and figures leave open is asked where no way is read.
    """
    best: Understanding | None = None
    problem: NotReadError | None = None
    for sheets in alternatives:
        try:
            found = reading_of(sheets, keys, where)
        except NotReadError as error:
            problem, found = problem or error, None
        if found is None or (found[0].kind == "points" and not points):
            continue
        own = Understanding(found[0], sheets, found[1], found[2], labels_of(found[0]))
        if best is None or (own.reading.checked, len(own.reading.figures)) > (
            best.reading.checked,
            len(best.reading.figures),
        ):
            best = own
        if sheets[0].listed:
            break
    if best is None and problem is not None:
        raise problem
    if best is not None:
        _refuse_either_sign(best.grid)
    return best


_THOUSANDS = re.compile(r"[+-]?\d{1,3}(?:,\d{3})+")


def _refuse_either_sign(grid: CutSheet) -> None:
    """Figures that may be thousands or thousandths, where none of the sheet tells."""
    texts = [
        (row, i) for row, own in enumerate(grid.figures) for i, f in enumerate(own) if f and "," in grid.text(row, i)
    ]
    if grid.sheet.decimal is None and texts and all(_THOUSANDS.fullmatch(grid.text(*one)) for one in texts):
        first = grid.text(*texts[0])
        both = (
            f"{first!r} can be {first.replace(',', '')} or {first.replace(',', '.')}, and no number of the sheet tells"
        )
        raise CmmUqError(both, where=grid.at(*texts[0]), fix='Say decimal = "," or decimal = "."')
