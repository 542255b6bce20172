"""How much room a text takes in a picture, in the fonts that pictures are measured with."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from cmm_uq.certificate.lettering import measuring_fonts

if TYPE_CHECKING:
    from matplotlib.path import Path

_MM = 25.4 / 72  # of a point


def width_mm(text: str, size: float, weight: str = "normal") -> float:
    """Width of a text in the measuring font."""
    from matplotlib.font_manager import FontProperties
    from matplotlib.textpath import TextPath

    font = FontProperties(family=measuring_fonts(), weight=weight)
    return _MM * max(farthest_right(TextPath((0, 0), str.__str__(text), size=size, prop=font)), size)


def farthest_right(path: Path) -> float:
    """Largest x of a path of lines and quadratic curves, in the steps of its ``get_extents`` but for all curves at once."""
    x, codes = np.asarray(path.vertices)[:, 0], np.asarray(path.codes)
    controls = np.flatnonzero(codes == path.CURVE3)[::2]
    begin, control, end = x[controls - 1], x[controls], x[controls + 1]
    with np.errstate(divide="ignore", invalid="ignore"):
        t = (begin - control) / (begin - 2 * control + end)
    t = np.where((t > 0) & (t < 1), t, 0.0)
    turns = (1 - t) ** 2 * begin + 2 * t * (1 - t) * control + t**2 * end
    corners = x[np.isin(codes, (path.MOVETO, path.LINETO))]
    return float(max(part.max(initial=-np.inf) for part in (corners, turns, end)))
