"""The posterior distribution of several parameters: each density, and each pair, on one set of axes as few paths."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike, NDArray

from cmm_uq.base.errors import CmmUqError
from cmm_uq.base.messages import Text, say
from cmm_uq.base.points import Floats
from cmm_uq.certificate.document import Plot
from cmm_uq.certificate.plots import style
from cmm_uq.certificate.plots.style import ACCENT, INK, MUTED, SMALL, TINY, WIDTH_MM, width_mm

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.path import Path

READABLE = 12  # most parameters that one corner shows
_BINS = 36
_MASSES = (0.95, 0.5)  # probability inside the outer and the inner contour
_SCALE = 0.9  # part of a panel's place that it fills
_HEADROOM = 0.92  # part of a panel's height that its density fills
_LEFT, _BELOW, _ABOVE = 14.0, 11.0, 4.5  # least room for figures and names, mm
_HEIGHT = 80.0  # of all panels, mm, as long as none is smaller than 10 mm: text and tables stand on the same page
_SLANT = 40  # of the figures under the panels, degrees


def corner_plot(
    samples: ArrayLike, names: Sequence[Text], *, units: Sequence[Text] | None = None, estimates: ArrayLike | None = None,
    caption: Text, alternative: Text,
) -> Plot:  # fmt: skip
    """Marginal and pairwise posterior densities; between the 2.5 % and 97.5 % quantiles they are shaded.

    ``samples``: (n, d) draws; beyond twelve parameters the twelve with the strongest correlations are shown, and the caption
    says so; ``names, units``: (d,) words over the densities; ``estimates``: (d,) drawn as lines and crosses, the medians
    where left out.
    """
    total = len(names)
    draws = style.finite("samples", samples, (None, total))
    if len(draws) < 2 or not total:
        raise CmmUqError("the picture of a posterior needs at least two draws of one parameter")
    chosen = _most_correlated(draws)
    if len(chosen) < total:
        caption = say("{caption} The {count} of {total} parameters that are correlated most are shown.",
                      caption=caption, count=len(chosen), total=total)  # fmt: skip
    kept = draws[:, chosen]
    middle = np.median(draws, axis=0) if estimates is None else style.finite("estimates", estimates, (total,))
    between = np.quantile(draws, [0.025, 0.975], axis=0).T
    labels = [names[c] for c in chosen]
    if units:
        labels = [say("{name} / {unit}", name=names[c], unit=units[c]) if units[c] else names[c] for c in chosen]
    with style.house_style():
        low, high = np.quantile(kept, [0.0015, 0.9985], axis=0)
        room = np.where(high > low, (high - low) / 16, np.maximum(np.abs(high), 1.0) * 1e-6)  # never empty
        panels = _Panels(np.column_stack([low - room, high + room]).astype(np.float64), kept)
        panels.densities(middle[chosen], between[chosen])
        panels.pairs(middle[chosen])
        panels.frames()
        panels.words(labels)
        return style.drawn(panels.figure, caption, alternative, "posterior")


def _most_correlated(draws: Floats) -> NDArray[np.intp]:
    dimension = draws.shape[1]
    if dimension <= READABLE:
        return np.arange(dimension)
    with np.errstate(invalid="ignore", divide="ignore"):
        correlation = np.nan_to_num(np.abs(np.corrcoef(draws.T)))
    np.fill_diagonal(correlation, 0.0)
    return np.sort(np.argsort(-correlation.max(axis=0), kind="stable")[:READABLE])


def _smooth(counts: Floats) -> Floats:
    """Counts along one or two axes smoothed by a Gaussian that is wider the fewer they are (Scott's n^(−1/6))."""
    index = np.arange(_BINS)
    width = np.clip(0.22 * _BINS * counts.sum() ** (-1 / 6), 0.8, 0.08 * _BINS)
    kernel = np.exp(-0.5 * ((index[:, None] - index) / width) ** 2)
    kernel /= kernel.sum(axis=0)
    smoothed: Floats = kernel @ counts
    return smoothed if counts.ndim == 1 else smoothed @ kernel.T


class _Panels:
    """The panels on one set of axes: column j starts at x = j, row i of d at y = d − 1 − i; one unit is a panel."""

    def __init__(self, ranges: Floats, draws: Floats) -> None:
        self.ranges, self.count = ranges, len(ranges)
        most = 1 if self.count > 5 else 2 if self.count > 3 else 4
        self.ticks = [_ticks(low, high, most) for low, high in ranges]
        longest = max(width_mm(text, TINY) for _, texts in self.ticks for text in texts)
        self.left = max(_LEFT, longest + 3.0)
        below = max(_BELOW, longest * np.sin(np.radians(_SLANT)) + 4.0)
        self.panel_mm = min(30.0, (WIDTH_MM - self.left - 1) / self.count, max(_HEIGHT / self.count, 10.0))
        height = self.count * self.panel_mm + below + _ABOVE
        self.figure = style.new_figure(height)
        ax = self.figure.add_axes((0, 0, 1, 1))
        # the panels stand at the left, so that the last name, which begins over its own panel, has the room beside them
        ax.set(xlim=np.array([-self.left, WIDTH_MM - self.left]) / self.panel_mm)
        ax.set(ylim=np.array([-below, height - below]) / self.panel_mm)
        ax.set_axis_off()
        ax.set(xticks=[], yticks=[])  # not shown, but made and measured
        self.ax: Axes = ax
        relative = (draws - ranges[:, 0]) / np.ptp(ranges, axis=1)
        self.bins = np.where((relative >= 0) & (relative < 1), np.floor(relative * _BINS).astype(np.intp), -1)

    def across(self, column: int, values: ArrayLike) -> Floats:
        """Values of a parameter as places along x in its column, never beyond its panel."""
        low, high = self.ranges[column]
        relative = (np.asarray(values, dtype=np.float64) - low) / (high - low)
        return np.asarray(column + _SCALE * np.clip(relative, 0, 1))

    def up(self, row: int, values: ArrayLike) -> Floats:
        """Values of a parameter as places along y in its row."""
        return np.asarray(self.across(row, values) - row + self.count - 1 - row)

    def densities(self, estimates: Floats, intervals: Floats) -> None:
        """Marginal density of each parameter, its interval shaded, its estimate a line."""
        for k in range(self.count):
            base = self.count - 1 - k
            index = self.bins[:, k]
            density = _smooth(np.bincount(index[index >= 0], minlength=_BINS).astype(np.float64))
            x = k + _SCALE * (np.arange(_BINS) + 0.5) / _BINS
            y = base + _HEADROOM * _SCALE * density / density.max()
            inside = self.across(k, intervals[k])
            within = np.concatenate([inside[:1], x[(x > inside[0]) & (x < inside[1])], inside[1:]])
            under = np.concatenate([[base], np.interp(within, x, y), [base]])
            self.ax.fill(within[[0, *range(len(within)), -1]], under, color=ACCENT, alpha=0.18, lw=0)
            self.ax.plot(x, y, color=ACCENT, lw=1.1)
            self.ax.plot(np.repeat(self.across(k, estimates[k]), 2), [base, base + _SCALE], color=INK, lw=0.7)

    def pairs(self, estimates: Floats) -> None:
        """Contours of 95 % and 50 % of every pair, and a cross at the estimate."""
        from contourpy import FillType, contour_generator
        from matplotlib.patches import PathPatch
        from matplotlib.path import Path

        areas: tuple[list[Path], list[Path]] = ([], [])
        centres = (np.arange(_BINS) + 0.5) * _SCALE / _BINS
        row_column = [(row, column) for row in range(self.count) for column in range(row)]
        for row, column in row_column:
            i, j = self.bins[:, row], self.bins[:, column]
            good = (i >= 0) & (j >= 0)
            counts = np.bincount(i[good] * _BINS + j[good], minlength=_BINS**2).reshape(_BINS, _BINS)
            density = _smooth(counts.astype(np.float64))
            lines = contour_generator(
                column + centres, self.count - 1 - row + centres, density, fill_type=FillType.OuterCode
            )
            descending = np.sort(density.ravel())[::-1]
            mass = np.cumsum(descending) / descending.sum()
            # heights whose contours hold 95 % and 50 % of the probability
            heights = [float(descending[min(np.searchsorted(mass, inside), mass.size - 1)]) for inside in _MASSES]
            for level, paths in zip(heights, areas, strict=True):
                paths.extend(Path(*outline) for outline in zip(*lines.filled(level, np.inf), strict=True))
        for paths, alpha in zip(areas, (0.16, 0.34), strict=True):
            if paths:
                area = Path.make_compound_path(*paths)
                # as a patch it would be measured, curve by curve, for limits that are fixed
                self.ax.add_artist(PathPatch(area, facecolor=(ACCENT, alpha), edgecolor=ACCENT, linewidth=0.5))
        x = np.array([self.across(column, estimates[column]) for _, column in row_column])
        y = np.array([self.up(row, estimates[row]) for row, _ in row_column])
        arm = 0.7 / self.panel_mm
        self.strokes(np.append(x - arm, x), np.append(x + arm, x), np.append(y, y - arm), np.append(y, y + arm), INK)

    def frames(self) -> None:
        row, column = np.tril_indices(self.count)
        x, y = column.astype(np.float64), self.count - 1.0 - row
        self.strokes(np.append(x, x), np.append(x, x + _SCALE), np.append(y, y), np.append(y + _SCALE, y), MUTED)

    def words(self, labels: Sequence[Text]) -> None:
        """Ticks with their figures along the outer edges, and names with units over the densities."""
        length, distance = 0.8 / self.panel_mm, 1.4 / self.panel_mm
        for k, label in enumerate(labels):
            values, texts = self.ticks[k]
            x, y, edge = self.across(k, values), self.up(k, values), np.zeros(len(values))
            self.strokes(x, x, edge, edge - length, MUTED)
            if k:
                self.strokes(edge, edge - length, y, y, MUTED)
            for place, text in zip(x, texts, strict=True):
                self.ax.text(
                    place, -distance, text, ha="right", va="top", rotation=_SLANT, rotation_mode="anchor", fontsize=TINY
                )
            for place, text in zip(y if k else (), texts, strict=bool(k)):
                self.ax.text(-distance, place, text, ha="right", va="center", fontsize=TINY)
            size = SMALL if self.count <= 8 else TINY
            room = WIDTH_MM - self.left - k * self.panel_mm - 1
            self.ax.text(k, self.count - k - 0.04, label, ha="left", va="bottom", fontweight="bold",
                         fontsize=size * min(1.0, room / width_mm(style.lettered(label), size, "bold")))  # fmt: skip

    def strokes(self, x0: Floats, x1: Floats, y0: Floats, y1: Floats, colour: str) -> None:
        style.strokes(self.ax, x0, x1, y0, y1, color=colour, lw=0.6, solid_capstyle="butt")


def _ticks(low: float, high: float, most: int) -> tuple[Floats, list[str]]:
    """Two or more round figures inside a range, about ``most``, and texts with the decimals that tell them apart."""
    from matplotlib.ticker import MaxNLocator

    room = 0.08 * (high - low)
    for intervals in range(most, most + 6):
        every = np.asarray(MaxNLocator(intervals, steps=[1, 2, 5, 10]).tick_values(low, high))
        values = every[(every >= low + room) & (every <= high - room)]
        if len(values) >= 2:
            break
    values = values[:: -(-len(values) // (most + 1))]
    decimals = int(np.clip(np.ceil(-np.log10(every[1] - every[0]) - 1e-9), 0, 9))
    return values, [f"{value:.{decimals}f}".replace("-", "−") for value in values]
