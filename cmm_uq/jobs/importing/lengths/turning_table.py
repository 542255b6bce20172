"""Centres of spheres on a rotary table (ISO 10360-3) by its angle, in the coordinates that turn with it."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from cmm_uq.base.points import Floats
from cmm_uq.jobs.importing.cells.figures import figure
from cmm_uq.jobs.importing.factors import Label, codes, in_turn, together
from cmm_uq.jobs.importing.format import NotReadError, Sheet
from cmm_uq.jobs.importing.header import plain_words
from cmm_uq.jobs.importing.lengths.circles import DEGREES, in_words

_LEAST, _STAYS_MM, _SPHERES = 90.0, 1.0, 6  # degrees of a turn; that no sphere moves on a table; spheres on one


def table_spheres(
    labels: Sequence[Label], xyz: Floats, sheets: Sequence[Sheet], sign: str, where: str
) -> dict[str, Floats] | None:
    """Numbers of spheres and positions, and angles, where words say a table and each sphere stays; else ``None``.

    Raises
    ------
    NotReadError
        where spheres go round, as in the coordinates of a machine, whose axis of the table the file does not say.
    """
    texts = [sheet.name for sheet in sheets]
    texts += [cell for sheet in sheets for row in sheet.rows for cell in row if isinstance(cell, str)]
    turned = [one for one in labels if one.sort == "column" and DEGREES.search(one.words)]
    if len(turned) != 1 or not any(in_words(" ".join(plain_words(text)), "others", "table") for text in texts):
        return None
    angles = [figure(value, sign) for value in turned[0].values]
    c_deg = np.array([np.nan if one is None else one[0] for one in angles])
    if not np.ptp(c_deg) > _LEAST:  # or not all are figures
        return None
    at = codes(turned[0].values)
    several = ((int(codes(one.values).max()) + 1, codes(one.values)) for one in labels if one is not turned[0])
    spheres = [(n, own) for n, own in several if 1 < n <= _SPHERES and together(own, at).max() + 1 > at.max() + 1]
    point = min(spheres, key=lambda one: one[0])[1] if spheres else np.zeros(len(xyz), dtype=np.int64)
    own = [xyz[point == one] for one in np.unique(point)]
    if any(np.ptp(one, axis=0).max() > _STAYS_MM for one in own):
        if all(_goes_round(one) for one in own):
            what = f"its spheres go round with {turned[0].words!r}, in the machine's coordinates of a table that turned"
            raise NotReadError(
                what, where=where, fix="Export them in the workpiece's coordinates, which turn with the table"
            )
        return None
    repeat = in_turn(point).astype(np.float64)
    return {"measurement": np.ones(len(xyz)), "point": point + 1.0, "repeat": repeat, "c_deg": c_deg}


def _goes_round(xyz: Floats) -> bool:
    """Whether places lie on a circle in the plane of two axes."""
    flat = [np.delete(xyz, k, axis=1) for k in range(3) if np.ptp(xyz[:, k]) < _STAYS_MM]
    for own in flat:
        best = np.linalg.lstsq(np.column_stack([own, np.ones(len(own))]), (own**2).sum(axis=1), rcond=None)[0]
        away = np.linalg.norm(own - best[:2] / 2, axis=1)
        if np.ptp(away) < _STAYS_MM:
            return True
    return False
