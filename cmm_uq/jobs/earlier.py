"""Two recordings of one plate at two dates, made into one: where each ball is now against where it was then.

What the earlier recording found takes the place of a certificate. Errors of the plate and of the machine that were there on
both dates cancel, as long as the plate stands in the same place; what remains is what changed between, and its noise is that
of both recordings.
"""

from __future__ import annotations

import numpy as np

from cmm_uq.base.errors import CmmUqError
from cmm_uq.base.points import AXES, Floats, Ints, Points
from cmm_uq.base.units import REFERENCE_TEMPERATURE

NOISE_RATIO = "noise_ratio"
"""Column: standard uncertainty of a difference over that of one coordinate."""


def against_earlier(later: Points, earlier: Points, cte_per_k: float, where: str) -> Points:
    """The later recording, means over repeats, with the earlier one as its reference positions.

    Parameters
    ----------
    later, earlier : recordings of the same balls in the same placings, numbered alike.
    cte_per_k : of the plate, which brings the earlier positions to 20 °C when their temperature was recorded.
    where : file of the later recording, for messages.

    Returns
    -------
    points with ``reference_x_mm``, ``reference_y_mm``, ``reference_z_mm`` and :data:`NOISE_RATIO`.

    Raises
    ------
    CmmUqError : a ball of the later recording is not in the earlier one.
    """
    now, then = _Balls(later), _Balls(earlier)
    known = {key: i for i, key in enumerate(map(tuple, then.keys.tolist()))}
    rows = []
    for (measurement, point), first in zip(now.keys.tolist(), now.first, strict=True):
        if (measurement, point) not in known:
            line = later.lines[first] if len(later.lines) else 0
            raise CmmUqError(f"measurement {measurement}, point {point} is not in the earlier recording",
                             where=f"{where} line {line}",
                             fix="Number placings and balls as on the earlier date, or leave it out")  # fmt: skip
        rows.append(known[measurement, point])
    references = then.means(earlier.xyz)[rows]
    if "temp_artefact_c" in earlier.columns and cte_per_k:
        excess = then.means(earlier.columns["temp_artefact_c"])[rows] - REFERENCE_TEMPERATURE
        references = references / (1 + cte_per_k * excess)[:, None]
    columns = {name: now.means(values) for name, values in later.columns.items()}
    columns |= {f"reference_{axis}_mm": references[:, i] for i, axis in enumerate(AXES)}
    columns[NOISE_RATIO] = np.sqrt(1 / now.counts + 1 / then.counts[rows])
    return Points(
        now.means(later.xyz), now.keys[:, 0], now.keys[:, 1], np.ones(len(now.keys), dtype=np.int64), later.machine,
        columns, later.lines[now.first] if len(later.lines) else later.lines,
    )  # fmt: skip


class _Balls:
    """Rows of a recording by (measurement, point): ``keys`` (b, 2), ``first`` row, ``counts`` of repeats."""

    def __init__(self, points: Points) -> None:
        numbers = np.column_stack([points.measurement, points.point])
        self.keys, first, inverse, counts = np.unique(
            numbers, axis=0, return_index=True, return_inverse=True, return_counts=True
        )
        self.first: Ints = first.astype(np.int64)
        self.counts: Floats = counts.astype(np.float64)
        self._index: Ints = inverse.ravel().astype(np.int64)

    def means(self, values: Floats) -> Floats:
        """Means of ``values`` (n,) or (n, 3) over the repeats of each ball."""
        sums = np.zeros((len(self.keys), *values.shape[1:]))
        np.add.at(sums, self._index, values)
        return np.asarray(sums / self.counts.reshape((-1,) + (1,) * (values.ndim - 1)), dtype=np.float64)
