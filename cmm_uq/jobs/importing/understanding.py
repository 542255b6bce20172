"""A file read by understanding: sheets cut into blocks, every way of reading them tried, the one that figures confirm taken.

It is asked where no head says at once what the columns are. Nothing is guessed: rows between those that are read must be
summaries by word or by arithmetic, observations must be told apart by what stands beside them, and what the file leaves open
(where lines lie, a unit, which points belong together) is asked as of any other.
"""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Iterable, Iterator, Mapping, Sequence
from itertools import permutations

import numpy as np

from cmm_uq.base.messages import DASH, Verbatim, commas, names, say
from cmm_uq.base.points import Floats
from cmm_uq.base.values import dataclass
from cmm_uq.jobs.columns import COORDINATES, WHOLE
from cmm_uq.jobs.importing import format as formats
from cmm_uq.jobs.importing.blocks import CutSheet, heading
from cmm_uq.jobs.importing.cells import left_out
from cmm_uq.jobs.importing.cells.figures import metric, unit_elsewhere, unit_of
from cmm_uq.jobs.importing.columns import SIGNS, by_extent, left_out_fact, settled_unit
from cmm_uq.jobs.importing.coordinates import EitherError, points_in, rows_of_axes
from cmm_uq.jobs.importing.factors import codes, counted, hint
from cmm_uq.jobs.importing.format import Fact, ImportKeys, NotReadError, Sheet, Sources, WrittenUnit, length_named
from cmm_uq.jobs.importing.grouping import on_a_plate, places, scattered
from cmm_uq.jobs.importing.header import Header, is_summary, shown
from cmm_uq.jobs.importing.lengths.axis_runs import axis_in
from cmm_uq.jobs.importing.lengths.circles import circles_in
from cmm_uq.jobs.importing.lengths.deviation_sign import turned_by
from cmm_uq.jobs.importing.lengths.evidence import few_of, passes_over_axes, refuse_certificate, sums_of, take_certified
from cmm_uq.jobs.importing.lengths.length_columns import lengths_in
from cmm_uq.jobs.importing.lengths.line_labels import lengths_of, lines_and_runs
from cmm_uq.jobs.importing.lengths.placing import Elsewhere, place_of_axis, said_elsewhere, stated_places, words_beside
from cmm_uq.jobs.importing.lengths.run_columns import runs_in
from cmm_uq.jobs.importing.lengths.turned import turned
from cmm_uq.jobs.importing.lengths.turning_table import table_spheres
from cmm_uq.jobs.importing.lines import AxisRun, MeasuredLengths
from cmm_uq.jobs.importing.numbering import numbered_points
from cmm_uq.jobs.importing.roles import SheetReading, each, joined, like, said_by

_COMPARED = 5000  # points of sheets
_AIRCRAFT = 100.0  # inches, that points which are none of an artefact may be apart
ROWS_MOST = 20_000  # of a sheet that is understood this way
Found = tuple[SheetReading, CutSheet]


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
            own = _reading_of(sheets, keys, where)
        except NotReadError as error:
            problem, own = problem or error, None
        if own is not None and (points or own.reading.kind != "points"):
            best = own if best is None or own.outdoes(best) else best
            if sheets[0].listed:
                break
    if best is not None:
        left_out.refuse_either_sign(best.reading, best.grid)
    elif problem is not None:
        raise problem
    return best


def _reading_of(sheets: Sequence[Sheet], keys: Mapping[str, Sources], where: str) -> Understanding | None:
    """What all sheets hold; ``None`` where nothing is understood. What one sheet asks is asked where no other is read."""
    found: list[Found] = []
    problem: NotReadError | None = None
    upright, across = [*map(formats.stacked, sheets)], list[CutSheet]()
    for sheet in upright:
        for read in _ways_of(sheet, keys, where):
            try:
                own = _of_sheet(*read)
            except NotReadError as error:
                problem, own = problem or error, []
            own = [one for one in own if problem is None or one[0].kind != "points" or not read[1]]
            if own:
                found += own
                across += [read[0]] if read[1] else []
                break
    chosen = _chosen(found)
    if not chosen and problem is not None:
        raise problem
    of = list(dict.fromkeys(grid.sheet.name for _, grid in chosen))
    # names of sheets with points must count measurements or repeats, and be no tables of different things
    counted = len({re.sub(r"\d+", "0", name) for name in of}) == 1 or all(hint(name, lengths=False) for name in of)
    counted = counted or (not sheets[0].listed and _elsewhere(chosen))
    if not chosen or (chosen[0][0].kind == "points" and not counted):
        return None
    left_out.refuse_unmatched([grid for _, grid in chosen], keys, where)
    elsewhere = said_elsewhere(upright, chosen)
    _refuse_same_lines(chosen, where)
    apart = [(grid.sheet, reading) for reading, grid in found if all(grid is not other for _, other in chosen)]
    without = [told for sheet in sheets for told in sheet.left_out]
    without += [shown(sheet, reading.rows[0], "another table") for sheet, reading in apart]
    without += [text for reading, _ in chosen for text in reading.told]
    _take_results(found, chosen)
    for grid in {id(own): own for _, own in chosen}.values():
        if (told := left_out.rows_left_out([reading for reading, own in chosen if own is grid], grid)) is None:
            return None
        without += told
    _label(chosen)
    grid = chosen[0][1]
    whole = joined([reading for reading, _ in chosen])
    left_out.refuse_mixed(whole, chosen, where)
    take_certified(whole, [*map(CutSheet, upright)])
    return Understanding(whole, sheets, without, grid, chosen, elsewhere, across=grid in across)


def _take_results(found: Sequence[Found], chosen: Sequence[Found]) -> None:
    """A few points beside many are results of those, as the centre of a ball, and belong to them."""
    own = {id(reading) for reading, _ in chosen}
    for reading, grid in found if chosen[0][0].kind == "points" else ():
        beside = next((one for one, other in chosen if other is grid), None)
        if beside is not None and id(reading) not in own:
            beside.others = [*beside.others, *reading.rows, *reading.others]


def _elsewhere(chosen: Sequence[Found]) -> bool:
    """Whether the points of each sheet lie elsewhere than those of the others."""
    sheets = codes([grid.sheet.name for reading, grid in chosen for _ in reading.figures])
    xyz = np.array([own for reading, _ in chosen for own in reading.figures])
    if len(xyz) > _COMPARED or chosen[0][0].kind != "points":
        return False
    at = places(xyz)
    return len({*zip(sheets.tolist(), at.tolist(), strict=True)}) == int(at.max()) + 1


def _ways_of(sheet: Sheet, keys: Mapping[str, Sources], where: str) -> Iterator[tuple[CutSheet, bool]]:
    """A sheet as it is, then with what stands across it turned."""
    if len(sheet.rows) <= ROWS_MOST:
        grid = CutSheet(sheet, keys, where)
        yield grid, False
        if (other := turned(grid)) is not None:
            yield CutSheet(other, keys, where), True
        if (other := formats.transposed(sheet)) is not None:
            yield CutSheet(other, keys, where), True


def _label(chosen: Sequence[Found]) -> None:
    """Sheet of every observation, and what may say where its line lies."""
    for reading, grid in chosen:
        for labels, row in zip(reading.labels, reading.rows, strict=True):
            labels["sheet", ""] = grid.sheet.name
            heads = (text for (sort, _), text in labels.items() if sort == "head")
            labels["place", ""] = "\n".join((grid.sheet.name, *grid.says(row), *heads))


def _chosen(found: Sequence[Found]) -> list[Found]:
    """What the sheets hold before all else."""
    kinds = Counter[str]()
    for reading, _ in found:
        kinds[reading.kind] += len(reading.figures)
    if kinds["points"] < kinds["lengths"]:  # places of lines, beside lengths that were measured along them
        del kinds["points"]
    kind = next((kind for kind in ("circles", "runs", "points", "lengths") if kind in kinds), "")
    chosen = [one for one in found if one[0].kind == kind]
    # deviations of lengths that are there, and small tables beside a large one, are the same again
    chosen = [one for one in chosen if not one[0].deviations] or chosen
    for one, other in permutations(chosen, 2):
        if one[1] is other[1] and sums_of(one[0].source, other[0].source):
            other[0].summaries, one[0].figures = [*other[0].summaries, *one[0].rows], []
    chosen = [one for one in chosen if one[0].figures]
    # lengths of another sheet that have no reference, and are near none, are no lengths of the artefact
    references = [own[0] for one, _ in chosen if one.taken.get("reference_mm") for own in one.figures]
    lengths = references if kind == "lengths" else []
    chosen = [one for one in chosen if one[0].taken.get("reference_mm") or _near(one[0], lengths)]
    return [one for one in chosen if len(one[0].figures) * 8 > max(len(other[0].figures) for other in chosen)]


def _near(reading: SheetReading, references: Sequence[float]) -> bool:
    return not references or bool(np.isclose(reading.figures[0][1], references, rtol=2e-3).any())


def _refuse_same_lines(chosen: Sequence[Found], where: str) -> None:
    """Sheets with the same lengths on lines of the same names are two recordings, unless their names count lines or runs."""
    sheets: dict[str, list[object]] = {}
    for reading, grid in chosen if chosen[0][0].kind == "lengths" else ():
        of_line = [label.values for label in reading.every_label if counted(label, lengths=True) == "line"]
        of_line = of_line or [label.values for label in reading.every_label if label.sort == "column"]
        lengths = [own[0] for own in reading.figures]
        sheets.setdefault(grid.sheet.name, []).append(sorted(map(str, zip(lengths, *of_line, strict=True))))
    words = any(hint(name, lengths=True) or axis_in(name) or name.strip().upper() in {*"XYZ"} for name in sheets)
    hinted = words or len({re.sub(r"\d+", "0", name) for name in sheets}) == 1
    first, *others = sheets or [""]
    if not hinted and any(any(map(bool, sheets[first])) and sheets[first] == sheets[other] for other in others):
        what = f"sheets {', '.join(map(repr, sheets))} hold lengths of the same names, each a recording of its own"
        raise NotReadError(what, where=where, fix=f'Say which: sheet = "{first}"')


def _of_sheet(grid: CutSheet, across: bool) -> list[Found]:
    sheet, found = grid.sheet, list[Found]()
    problem: NotReadError | None = None
    for blocks, rows in each(grid):
        usable = [k for k in rows if not is_summary(sheet.rows[k])]
        usable = [k for k in usable if not left_out.is_void(sheet.rows[k], "void", "feature")]
        angles = left_out.below_angles(grid, usable)
        others = left_out.below_deviations(grid, usable) | angles  # beside what they are of
        own = left_out.layout(grid, [row for row in usable if row not in others]) if usable else []
        readings: list[SheetReading] = []
        places = (*(() if across else (rows_of_axes,)), points_in) if {*grid.keys} <= {*WHOLE} else ()
        lengths = (runs_in, lengths_in)  # before their places, which may stand beside them
        placed = grid.placed(own)
        every = (*(() if across else (circles_in,)), *(lengths + places if placed else places + lengths))
        for read in every if own else ():
            try:
                of_places = [row for row in own if not left_out.of_feature(grid, row)] or own
                reading = read(grid, blocks, own if read in lengths else of_places)
            except EitherError as error:
                problem, reading = problem or error, None
            if reading is None or (not placed and passes_over_axes(reading, blocks[0].paths)):
                continue
            # of a turned sheet words must say which lengths, or targets, those that were measured are of
            sure = bool(reading.checked) if reading.kind == "lengths" else reading.kind == "runs" or not reading.bare
            if not across or ((reading.called or sure) and not few_of(reading, grid, own)):
                readings.append(reading)
                # else they are places of lines or of features, or a few rows that were taken for others
                if 2 * len({*reading.rows, *reading.others}) > len(own) and not reading.beside_lengths:
                    break
        if readings:
            called = [one.checked for one in readings if one.kind == "lengths" and one.called]
            readings = [o for o in readings if not (o.beside_lengths and (any(called) or (o.planned and called)))]
            reading = max(readings, key=lambda one: len({*one.rows, *one.others}))
            reading.lines = [sheet.lines[row] for row in reading.rows]
            titles = (text for row in angles for text in grid.block_of[row].titles[row].values())
            reading.passed = [*reading.passed, *titles]
            found.append((reading, grid))
    if problem is not None and not found:
        raise problem
    return found


def _head_of(reading: SheetReading, grid: CutSheet) -> Header:
    block = grid.block_of[row := reading.rows[0]]
    taken = {name: tuple(c.i for c in own if c.i >= 0) for name, own in reading.taken.items()}
    return Header(block.head[-1] if block.head else row, block.rows[0], [heading(path) for path in block.paths], taken)


@dataclass
class Understanding:
    """What a file holds: places with their numbers, lengths on lines, or runs along axes."""

    reading: SheetReading
    sheets: Sequence[Sheet]
    left_out: list[str]
    grid: CutSheet
    parts: Sequence[Found]  # that make the reading, each with its sheet
    elsewhere: Elsewhere = ()  # that may say where lines lie
    across: bool = False  # whether rows and columns were exchanged

    def outdoes(self, other: Understanding) -> bool:
        """Whether it is upright, or arithmetic confirms more, of not far fewer figures."""
        if self.across != other.across:
            return other.across
        (checked, of, size), (others, less, least) = (
            (one.reading.checked, len(one.reading.figures), np.size(one.reading.figures)) for one in (self, other)
        )
        if self.reading.kind == other.reading.kind == "lengths" and checked and others:
            return (of, checked) > (less, others)  # a column that one of them loses was measured
        return 2 * size >= least and ((checked, of) > (others, less) or size > 2 * least)

    def unit(self, keys: ImportKeys, where: str, reach_mm: float | None) -> tuple[WrittenUnit, Fact]:
        """The unit of lengths: of heads, file or job, the one that the file mentions, or by the size of the machine."""
        every = [
            (self.reading.unit, say("in the headings")),
            (length_named(self.sheets[0].unit or ""), say("in the file")),
            (length_named(keys.unit or ""), say("by the key unit")),
        ]
        stated = [(unit, how) for unit, how in every if unit is not None]
        if not stated and (unit := unit_elsewhere(self.sheets, small=False)) is not None:
            stated = [(unit, say("the only one that the file mentions"))]
        small = self.reading.small or unit_elsewhere(self.sheets, small=True)
        figures, points = np.array(self.reading.figures).T, self.reading.kind == "points"
        if not stated and small is not None:
            if points and all(unit_of([one]) != small for one in self.reading.unused(self.grid, self.header, ())):
                what = f"the file mentions {small.name} alone, which may be the unit of the places"
                raise NotReadError(what, where=where, fix=f'Say unit = "{small.name}", or unit = "mm"')
            system = formats.UNITS["inch" if small.name == "microinch" else "mm"]
            stated = [(system, say("as its deviations are in {unit}", unit=Verbatim(small.name)))]
        largest = float(np.nanmax(np.ptp(figures, axis=1) if points else figures))
        if points and not on_a_plate(figures.T[np.unique(places(figures.T), return_index=True)[1]]):
            largest = min(largest, _AIRCRAFT)
        if not stated and metric(self.sheets, self.grid.sign, largest):
            stated = [(formats.UNITS["mm"], say("as the texts of the file are of those who measure in mm"))]
        named = zip(COORDINATES if points else ("reference_mm", "length_mm"), figures, strict=True)
        written = {name: [(own, None, 0)] for name, own in named if np.isfinite(own).all()}
        return settled_unit(stated, where, lambda: by_extent(written, where, reach_mm))

    def facts(self, of_unit: Fact, used: Sequence[str], *, placed: bool = False) -> tuple[Fact, ...]:
        words = (word for word in dict.fromkeys(used) if word)
        heads = [say("heads of columns") if word.isdecimal() else Verbatim(word) for word in words]
        arithmetic = say("words and figures, {count} of them by arithmetic", count=self.reading.checked)
        sheet = [one.name for one in self.sheets] if self.sheets[0].name else []
        return (
            *([Fact("sheet", say("Sheet"), commas(names(sheet)))] if sheet else []),
            *(*self.sheets[0].facts, of_unit, Fact("decimal", say("Decimal sign"), SIGNS[self.grid.sign])),
            Fact("understood", say("Columns understood by"), arithmetic),
            Fact("told_apart", say("Told apart by"), commas(heads or [DASH])),
            *self.passed_over(used, placed=placed),
        )

    def passed_over(self, used: Sequence[str], *, placed: bool = False) -> list[Fact]:
        """Columns and rows that are not read."""
        each = [one.unused(grid, _head_of(one, grid), used, placed=placed) for one, grid in self.parts]
        unused = dict.fromkeys(name for own in each for name in own)
        columns = [Fact("not_used", say("Columns not used"), commas(names(unused)), (*unused,))] if unused else []
        return [*columns, *left_out_fact(self.left_out)]

    @property
    def sources(self) -> dict[str, str]:
        taken = {name: ", ".join(c.heading for c in own) for name, own in self.reading.taken.items() if own}
        return taken | {name: name for name in self.reading.covariates}

    @property
    def header(self) -> Header:
        """Head of the first block that is read, and which of its columns are taken."""
        return _head_of(self.reading, self.grid)

    def lengths(self, keys: ImportKeys, where: str, reach_mm: float | None) -> MeasuredLengths:
        unit, of_unit = self.unit(keys, where, reach_mm)
        own, figures, place = self.reading, np.array(self.reading.figures), self.grid.at(self.header.row)
        lengths = lengths_of(figures[:, 0])
        stated = [one["place", ""] for one in own.labels]
        if np.isnan(figures[:, 0]).all() and not like(figures[:, 1], figures[:1, 1]):
            what = "its lengths are of several sizes, and no column says what each of them is of"
            raise NotReadError(what, where=place, fix="Say which does: columns = { reference_mm = … }, or nominal_mm")
        lines, runs, used = lines_and_runs(own.every_label, lengths, place, stated)
        if not keys.columns and {*lines} == {"1"} and runs.max() == 1:
            refuse_certificate(own, self.header.headings, place)
        reference, measured = (formats.converted(one, unit, "length_mm") for one in figures.T)
        if own.deviations:
            said_mm = formats.UNITS["mm"] if "deviation_mm" in keys.columns else None
            if (small := own.small or said_mm or unit_elsewhere(self.sheets, small=True)) is None:
                bare = own.taken["deviation_um"]
                what = f"nothing says the unit of {bare[0].heading!r}: µm or mm"
                raise NotReadError(what, where=place, fix=said_by("deviation_um", bare, ", or deviation_mm"))
            turn = turned_by(self.sheets, (c.heading for c in own.taken["deviation_um"]), place)
            measured = reference + formats.converted(figures[:, 1], small, "length_mm") * (-1 if turn else 1)
        places = stated_places(lines, stated, self.elsewhere, measured.tolist(), unit.up / unit.down, self.grid.sign)
        bare_ = [None if np.isnan(one) else float(one) for one in reference]
        return MeasuredLengths(
            *(lines, bare_, runs.tolist(), measured.tolist(), own.lines, own.covariates, self.sources),
            *(self.facts(of_unit, used, placed=bool(places)), tuple(self.left_out)),
            *(places, words_beside(lines, stated)),
        )

    def axis_places(self, runs: Sequence[AxisRun]) -> dict[str, tuple[str, str]]:
        """Where runs along axes lie, by the texts above them; of one axis alone by any."""
        axes, found = dict.fromkeys(run.axis for run in runs), dict[str, tuple[str, str]]()
        unit = self.reading.unit or unit_elsewhere(self.sheets, small=False) or formats.UNITS["mm"]
        for axis in axes:
            lines = {line for run in runs if run.axis == axis for *_, line in run.targets}
            own = zip(self.reading.lines, self.reading.labels, strict=True)
            texts = [text for line, labels in own if line in lines for text in labels["place", ""].split("\n")]
            texts += [line for _, text, _ in self.elsewhere if len(axes) == 1 for line in text.split("\n")]
            targets = sorted(
                target / (unit.up / unit.down) for run in runs if run.axis == axis for target, *_ in run.targets
            )
            place = place_of_axis(axis, dict.fromkeys(texts), unit.up / unit.down, self.grid.sign, targets)
            found |= {axis: place} if place else {}
        return found

    def points(
        self, keys: ImportKeys, where: str, reach_mm: float | None
    ) -> tuple[dict[str, Floats], tuple[Fact, ...]]:
        try:
            unit, of_unit = self.unit(keys, where, reach_mm)
            xyz = np.column_stack([formats.converted(own, unit, "x_mm") for own in np.array(self.reading.figures).T])
            labels = self.reading.every_label
            spheres = table_spheres(labels, xyz, self.sheets, self.grid.sign, where)
            numbers, facts = (spheres, []) if spheres else numbered_points(labels, xyz, keys, where)
            alone = keys.points_per_measurement is None and not {*numbers.get("repeat", ())}
            if self.reading.bare and alone and not np.ptp(numbers["measurement"]) and scattered(xyz):
                raise NotReadError(
                    "nothing says that they are one measurement", where=where, fix='points_per_measurement = "all"'
                )
        except NotReadError as error:
            if not self.reading.bare:
                raise
            bare = f"no line names the columns: {', '.join(map(str, self.reading.bare))} may be x, y and z"
            raise NotReadError(f"{bare}; {error.problem}", where=where, fix=f"If they are: {error.fix}") from None
        further = {name: np.array(own) for name, own in self.reading.covariates.items()}
        used = [label.words.strip() for label in labels if len({*label.values}) > 1 and label.sort != "block"]
        columns = {**numbers, **dict(zip(COORDINATES, xyz.T, strict=True)), **further}
        return columns, (*self.facts(of_unit, used), *facts)
