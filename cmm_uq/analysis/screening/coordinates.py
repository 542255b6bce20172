"""Which coordinates of a recording are damaged, and how: found against the artefact's own shape, before anything is fitted.

What makes the whole recording wrong is refused. Single rows, bars or placings are reported with what undoes the damage, and
left out; nothing is repaired in silence.
"""

from __future__ import annotations

from collections.abc import Collection

import numpy as np

from cmm_uq.analysis.screening.changes import Change, changes, changes_of_blocks
from cmm_uq.analysis.screening.finding import Finding, at_lines, finding
from cmm_uq.analysis.screening.search import MOST, Search, outside_travel
from cmm_uq.analysis.screening.shape import Shape
from cmm_uq.base.errors import CmmUqError
from cmm_uq.base.messages import say
from cmm_uq.base.points import AXES, Points
from cmm_uq.machine.model.kind import Observed
from cmm_uq.machine.model.placings import Placings

_SEVERAL = 4
_EDGES = 0.05
_ABSURD = (1.0, 2e4)
"""mm; a bar shorter or longer than this is in another unit."""


def coordinate_findings(
    points: Points, shape: Shape, observe: Observed, set_aside: Collection[int], where: str
) -> list[Finding]:
    """Damaged coordinates, each with the rows to leave out.

    Parameters
    ----------
    points : the recording.
    shape : what the artefact asks of the points.
    observe : makes the artefact of points, in whose own checks another one shows.
    set_aside : measurements that the job leaves out of the estimates; however many of them are damaged is no matter.
    where : the recording's name, for messages.

    Raises
    ------
    CmmUqError : a damage of the whole recording, or of too much of it.
    """
    _refuse_absurd_size(shape, where)
    search = Search(points, shape)
    counted = ~np.isin(points.measurement, list(set_aside))
    if search.bad.sum() >= _SEVERAL:
        _refuse_whole(search, where)
    if 2 * int(search.bad[counted].sum()) > counted.sum():
        _refuse_another(search, observe, where)
    found = search.findings() if search.bad.any() else []
    lost = {row for f in found for row in f.rows if counted[row]}
    if len(lost) > max(MOST * len(points), 2):
        raise CmmUqError(
            f"{len(lost)} of {len(points)} points do not fit the artefact; {found[0].why}", where=where,
            fix="So much of a recording cannot be left out: mend it, or measure again",
        )  # fmt: skip
    return found + _reversed_bars(points, shape)


def _refuse_absurd_size(shape: Shape, where: str) -> None:
    """A bar without a certificate has no length to compare, but none is shorter than a millimetre, or twenty metres long."""
    low, high = _ABSURD
    if np.isfinite(shape.size) or not shape.is_bar or low <= shape.extent <= high:
        return
    unit = "metres" if shape.extent < low else "micrometres"
    raise CmmUqError(
        f"the recorded bars are about {shape.extent:.3g} mm long: the coordinates look like {unit}, not mm",
        where=where,
        fix="Give x_mm, y_mm, z_mm in mm",
    )


def _refuse_whole(search: Search, where: str) -> None:
    """Refuse a mistake that concerns the whole recording, or a whole column of it."""
    points, shape = search.points, search.shape
    bad = int(search.bad.sum())
    told = _missed(search)
    best, fewest = None, min(max(2, int(_EDGES * len(points))), bad // _SEVERAL)
    strays = max(_EDGES, _astray(points))
    for change in (*changes(shape), *changes_of_blocks(shape)):
        if _shrinks(change, shape):
            continue
        xyz, reference = search.changed(change, np.arange(len(points)))
        left = int(np.sum(shape.misfit(xyz, reference) > shape.tolerance))
        if left <= fewest and _astray(points.at(xyz)) <= strays:
            best, fewest = change, left - 1
    if best is not None:
        raise CmmUqError(f"{told}, and fit once one mistake is undone: {best.what}",
                         where=f"{where}, column {best.columns[0]}", fix=best.fix)  # fmt: skip
    for axis, column in zip(AXES, points.xyz.T, strict=True):
        if np.ptp(column) == 0 and bad > MOST * len(points):
            raise CmmUqError(
                f"{told}: {axis}_mm is stuck at {column[0]:g} in every row",
                where=f"{where}, column {axis}_mm",
                fix="Export the recording again",
            )


def _astray(points: Points) -> float:
    """Part of the points whose readings lie outside the travel."""
    return float(np.any(outside_travel(points), axis=1).mean())


def _refuse_another(search: Search, observe: Observed, where: str) -> None:
    """Refuse a recording of another artefact, or of none: in the words of the artefact's own checks where these see it."""
    observe(search.points)
    raise CmmUqError(
        _missed(search), where=where, fix="Check [artefact] in job.toml, and the order of rows and columns"
    )


def _missed(search: Search) -> str:
    bad = int(search.bad.sum())
    return f"{bad} of {len(search.points)} points miss the artefact by up to {search.misfit.max():.3g} mm"


def _shrinks(change: Change, shape: Shape) -> bool:
    """Whether a change makes everything fit by making everything small: no proof where the size is free."""
    free = np.isnan(shape.size) and not shape.reference.shape[1]
    return bool(free and change.kind == "unit" and change.apply(np.ones((1, 3)), np.zeros((1, 0)))[0].min() < 1)


def _reversed_bars(points: Points, shape: Shape) -> list[Finding]:
    """Repeats of a bar whose balls are numbered the other way round than in the others."""
    if not shape.together or shape.reference.shape[1]:
        return []
    ends = np.array([rows[np.argsort(points.point[rows])] for rows in shape.rows])
    bars = points.xyz[ends[:, 1]] - points.xyz[ends[:, 0]]
    found = []
    placings = Placings.of(points.measurement[ends[:, 0]])
    for number, own in zip(placings.numbers, placings.rows, strict=True):
        if len(own) < 2:
            continue
        against = bars[own] @ bars[own[0]] < 0
        if not against.any():
            continue
        fewer = own[against] if against.sum() <= len(own) / 2 else own[~against]
        rows = ends[fewer].ravel()
        why = say(
            "{at_lines}: balls 1 and 2 of measurement {number} are exchanged against its other repeats. "
            "The length does not show it; what was recorded beside each ball (approach, temperatures) "
            "may be exchanged too",
            at_lines=at_lines(points, rows),
            number=number,
        )
        found.append(finding("swapped", points, rows, why))
    return found
