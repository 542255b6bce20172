"""Columns that say where lengths lie: starts, ends, directions or angles beside them, by words, else X, Y and Z twice."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING

import numpy as np

from cmm_uq.jobs.importing.lengths import places

if TYPE_CHECKING:
    from cmm_uq.jobs.importing.blocks import Block, CutSheet

_AXIS_LETTER = re.compile(r"(?<![^\W_])[XYZ](?=[012AB]?(?![^\W_]))", re.IGNORECASE)
_ORIGIN = re.compile(r"(?<![^\W_])[XYZ]_?(?:0|A)(?!\w)")  # of the first end, or of ball A
_UNIT_VECTOR = 2e-3
_MEASURED = 0.05  # figures printed finer are no planned places
FINER = 50  # times, that lengths are printed finer than the places where they were measured


def place_columns(grid: CutSheet, block: Block) -> dict[str, list[int]]:
    """Columns of the coordinates of starts, ends or directions beside lengths: by words, else X, Y and Z twice."""
    heads = [(i, " ".join(own)) for i, own in enumerate(block.paths) if any(grid.figure(r, i) for r in block.rows)]
    columns: dict[str, list[int]] = {}
    for i, text in heads:
        columns.setdefault(places.START if _ORIGIN.search(text) else places.role_among(text), []).append(i)
    columns[places.DIRECTION] = columns.get(places.DIRECTION) or _directions(grid, block, [i for i, _ in heads])
    by_words = {of: own for of, own in columns.items() if of and len(own) == (1 if of in places.ANGLES else 3)}
    if {places.START, places.CENTRE} & {*by_words} and len(by_words) > 1:
        _touches(grid, block, by_words)
        return by_words
    named = (next((one for one in path[::-1] if _AXIS_LETTER.search(one)), "") for path in block.paths)
    last = [one or (path[-1] if path else "") for one, path in zip(named, block.paths, strict=True)]
    axes = ["".join(_AXIS_LETTER.findall(text)).upper() for text in last]
    for i, text in enumerate(axes):
        if not any(map(str.strip, last[i + 1 : i + 3])) and text == "XYZ":
            axes[i : i + 3] = "XYZ"  # one head over three
    six = [(i, axes[i]) for i, _ in heads if len(axes[i]) == 1]
    if [axis for _, axis in six] == [*"XYZ"] and not by_words:
        return {"": [i for i, _ in six]}  # of what stands ahead of them
    if len({axis for _, axis in six}) == len(six) < len("XYZ") and not by_words:
        found = {axis: [i] for i, axis in six if i == 0 or axis == last[i].split()[0].upper()}
        steps = [f[1] for own in found.values() for row in block.rows if (f := grid.figure(row, own[0]))]
        return found if min(steps, default=0.0) >= _MEASURED else by_words  # at which lengths were measured
    if "".join(axis for _, axis in six) != "XYZXYZ":
        return by_words
    found = {places.START: [i for i, _ in six[:3]], places.END: [i for i, _ in six[3:]]}
    others = [i for i in range(grid.width) if i not in dict(six) and _as_far(grid, block, found, i)]
    rows = [row for row in block.rows if all(grid.figure(row, i) for i, _ in six)]
    finest = [[f[1] for row in rows for i in own if (f := grid.figure(row, i))] for own in (dict(six), others)]
    step, fine = (min(own, default=1.0) for own in finest)
    # finer ones are measured balls, unless lengths beside them are much finer still, or one was computed from them
    fit = others and (step >= _MEASURED or fine * FINER <= step or (len(others) > 1 and _touches(grid, block, found)))
    return found if fit else by_words


def _directions(grid: CutSheet, block: Block, columns: Sequence[int]) -> list[int]:
    """Three columns side by side, beside which others stand, with directions of the length 1 in each row."""
    for i in columns if len(columns) > len("XYZijk") else ():
        three = np.column_stack([grid.column(block.rows, k)[0] for k in range(i, min(i + 3, grid.width))])
        three = three[np.isfinite(three).any(axis=1)]
        whole = three.shape[1:] == (3,) and len(three) > 0
        if whole and bool((np.abs(np.linalg.norm(three, axis=1) - 1) < _UNIT_VECTOR).all()):
            return [i, i + 1, i + 2]
    return []


def _touches(grid: CutSheet, block: Block, columns: Mapping[str, Sequence[int]]) -> bool:
    """Whether starts and ends were touched: a column has their distance to the printed digits."""
    ends = [i for of in (places.START, places.END) for i in columns.get(of, ())]
    values, steps = zip(*(grid.column(block.rows, i) for i in range(grid.width)), strict=True)
    step = min((float(np.nanmin(steps[i])) for i in ends), default=1.0)
    if len(ends) != 6 or step >= _MEASURED:
        return False
    apart = np.linalg.norm(np.subtract([values[i] for i in ends[3:]], [values[i] for i in ends[:3]]), axis=0)
    if any((np.abs(apart - own) <= 1.6 * step).all() for own in values):
        grid.touched[block.number] = step
    return block.number in grid.touched


def _as_far(grid: CutSheet, block: Block, columns: Mapping[str, Sequence[int]], i: int) -> bool:
    """Whether starts and ends are as far apart as the longest of the lengths in a column that were measured there."""
    longest: dict[float, float] = {}
    apart = np.nan
    for row in block.rows:
        ends = [(grid.figure(row, k) or (np.nan,))[0] for one in (places.START, places.END) for k in columns[one]]
        own = float(np.linalg.norm(np.subtract(ends[3:], ends[:3])))
        apart = own if np.isfinite(own) else apart  # where a line is named once
        if np.isfinite(apart):
            longest[apart] = max(longest.get(apart, 0.0), (grid.figure(row, i) or (0.0,))[0])
    return bool(longest) and all(0.3 * apart < own <= 1.02 * apart + 1 for apart, own in longest.items())
