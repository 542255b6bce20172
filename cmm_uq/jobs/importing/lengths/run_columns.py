"""Deviations at targets along an axis, there and back: down a table, a way and a run in each column or in each row."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from cmm_uq.base.points import Floats
from cmm_uq.jobs.importing.blocks import Block, CutSheet
from cmm_uq.jobs.importing.factors import RUN, hint, says_of, senses, way_of, ways_of
from cmm_uq.jobs.importing.lengths.evidence import differences, families, follows, scatters, without_derived
from cmm_uq.jobs.importing.lengths.length_columns import WIDEST, of_one_sort, settled_base
from cmm_uq.jobs.importing.roles import FigureColumn, SheetReading, columns_in, like

_FEWEST = 3  # targets of an axis
_WIDER = 20  # times, that targets are farther apart than their deviations
_OFF_MM = 1.0  # farther from its target no axis comes to rest


def runs_in(grid: CutSheet, blocks: Sequence[Block], rows: Sequence[int]) -> SheetReading | None:
    """Deviations at targets of rows below one head: ``None`` where there are none, or no sense of travel is named."""
    every = columns_in(grid, blocks, rows)
    columns = [c for c in every if c.may_be_length and not of_other_errors(c.path)]
    target = _target(columns) if len(columns) <= WIDEST else None
    if target is None or not np.isfinite(target.values[0]):
        return None
    values = target.downwards
    if len(np.unique(values)) < _FEWEST:
        return None  # or figures of a title
    filled = replace(target, values=values)
    beside = [c for c in columns if c is not target and c.role in (None, "deviation", "measured")]
    ways = _ways(beside)
    small = [c for c in beside if (c.step < 1 or ways[c.i]) and not like(c.values + 1000, values + 1000)]
    small = [c for c in small if not _limit(c, small, filled)]
    small = [c for c in without_derived(small) if ways[c.i] or not follows(c, filled)]
    directed = [c for c in small if ways[c.i]] or [c for c in small if c.role == "deviation"]
    source = directed or small  # the others are reversals, spreads and what was recorded beside them
    source = sorted((c for own in families(source) if len(own) > 1 for c in own), key=lambda c: c.i) or source
    source = [c for c in source if says_of(c.heading, "linear")] or source
    reading = SheetReading("runs", unit=target.unit, small=next((c.unit for c in source if c.unit), None))
    reading.passed = [text for c in every if c not in columns for text in c.path]
    reached = _reached(columns, target, values)
    given = differences([filled, *reached], small)
    if given:
        source = [c for c in small if any(c is one[0] for one in given)]
        reading.checked = len(source)
    elif reached and not any(ways[c.i] for c in source):
        source, reading.positions = [replace(c, values=c.values - values) for c in reached], True
    left = [c for c in small if c.role is None and c.i not in {o.i for o in source} and of_one_sort(c, source)]
    left = [] if reading.positions else [c for c in without_derived([*source, *left]) if c in left]
    if not source or left or len({c.heading for c in source}) < len(source):
        return None  # or of two instruments, or others were measured as well
    reading.taken = {"target": [target], "reading_um": source}
    reading.collect(grid, rows, columns, [c.i for c in reached])
    for k, row in enumerate(rows):
        for c in source:
            if np.isfinite(c.values[k]):
                reading.add(row, k, c, source, (float(values[k]), float(c.values[k])))
            else:
                reading.blank.append((row, c.i))
    often = np.unique([one[0] for one in reading.figures], return_counts=True)[1]
    again = often.size > 0 and often[0] == often.max() > 1 and not values.min() and values.max() > 10 * _OFF_MM
    from_zero = again and (reading.positions or reading.checked)  # as no lengths do
    sensed = senses(reading.every_label, [one[0] for one in reading.figures]) is not None
    return reading if sensed or from_zero else None


def of_other_errors(path: Sequence[str]) -> bool:
    """Whether a head says an angle, or how straight an axis is."""
    return any(says_of(text) or says_of(text, "straight") for text in path)


def _limit(column: FigureColumn, others: Sequence[FigureColumn], target: FigureColumn) -> bool:
    """Whether a column is a limit, as ``Plus`` and ``Minus``: the same in all rows, or as the one for the other sense."""
    own = column.values[np.isfinite(column.values)]
    if len(own) > _FEWEST and own[0] and not np.ptp(own):
        return True
    twin = any(o is not column and np.array_equal(np.abs(o.values), np.abs(column.values)) for o in others)
    return twin and bool(own.any()) and follows(replace(column, values=np.abs(column.values)), target)


def _ways(columns: Sequence[FigureColumn]) -> dict[int, int]:
    """Sense of travel that the head of each column names, or one level of all heads; 0 where none does."""
    ways = {c.i: way_of(c.heading) for c in columns}
    for level in zip(*(c.path for c in columns), strict=True) if len({len(c.path) for c in columns}) == 1 else ():
        ways |= dict(zip(ways, ways_of(level) or (), strict=False))
    return ways


def _target(columns: Sequence[FigureColumn]) -> FigureColumn | None:
    """The column of targets: called so, or from which others differ by what stands beside them, or the only large one."""
    large = [c for c in columns if np.ptp(c.values[np.isfinite(c.values)]) > 1 and not c.minute]
    called = [c for c in large if c.role in ("target", "nominal")]
    if any(not c.counts for c in called) or (called and not any(c.step < 1 for c in large)):
        return min(called, key=lambda c: (c.counts, not c.round))  # and not their numbers, nor what was reached
    reached = [
        c for c in large if c.role == "reference" and not c.counts
    ]  # as by the laser; a calibrated one is no target
    large = [c for c in large if c.role in (None, "measured") and not c.counts]
    spans = [float(np.ptp(c.values[np.isfinite(c.values)])) for c in columns if not c.counts]
    bare = [c for c in large if c.role is None and np.ptp(c.values[np.isfinite(c.values)]) == max(spans)]
    if bare and sum(span * _WIDER > max(spans) for span in spans) == 1:
        return bare[0]  # beside deviations alone
    near = [c for c in large if any(o is not c and like(c.values + 1000, o.values + 1000) for o in large)]
    alone = [c for c in near if not way_of(c.heading)]
    if len(alone) == 1 and len(near) > 2:
        return alone[0]  # beside what was reached there and back
    small = [c for c in columns if c not in near and c.role != "summary"]
    if near and (base := settled_base(near, differences(near, small))) is not None:
        return base
    again = [
        c for c in large if any(like(c.values + 1000, o.values + 1000) and scatters(o, c) for o in (*near, *reached))
    ]
    if len(again) == 1 and len({c.i for c in (*near, *reached, *again)}) == len({"target", "reached"}):
        return again[0]  # beside what was reached, which is another each time
    counting = [
        c for c in large if c.role == "measured" and hint(c.heading, lengths=True) == RUN
    ]  # ahead of runs across
    large = [c for c in large if (c.role is None or c in counting) and not way_of(c.heading)]
    far = [c for c in large if np.ptp(c.values[np.isfinite(c.values)]) > 10 * _OFF_MM]
    return far[0] if len(far) == 1 else None


def _reached(columns: Sequence[FigureColumn], target: FigureColumn, values: Floats) -> list[FigureColumn]:
    """Positions that were reached."""
    near = [c for c in columns if c is not target and c.role not in ("summary", "deviation")]
    near = [c for c in near if c.step < 1 and like(c.values, values, _OFF_MM)]
    return without_derived(near) if np.nanmax(np.abs(values)) > 10 * _OFF_MM else []
