"""Residuals as arrows in projections of the measured volume."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from cmm_uq.analysis.diagnosis.location import ResidualField
from cmm_uq.base.messages import Text, Verbatim, say
from cmm_uq.base.points import Floats
from cmm_uq.certificate.document import Plot
from cmm_uq.certificate.plots import style
from cmm_uq.certificate.plots.residuals import shown, told
from cmm_uq.certificate.plots.style import ACCENT, BAND, DIVERGING, INK, MUTED, RULE, TINY, WIDTH_MM

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

_PLANES = ((0, 1), (0, 2), (1, 2))
_AXES = "XYZ"
_TITLE = 56.0  # mm that the title of a column needs
_LONGEST = 0.16  # of the drawn width, the longest vector
Shade = tuple[str, float, float]  # axis, and the range of its reading that is shaded


def vector_plot(
    position_mm: ArrayLike, series: Sequence[tuple[Text, ArrayLike]], *,
    axis_labels: tuple[Text, Text] = (say("x / mm"), say("y / mm")), caption: Text, alternative: Text,
) -> Plot:  # fmt: skip
    """(n, 2) vectors in µm at (n, 2) places in mm, one to three series, a panel each, magnified alike, with a scale."""
    place = style.finite("position_mm", position_mm, (None, 2))
    vectors = [style.finite("vectors", values, place.shape) for _, values in series]
    rows = shown([np.linalg.norm(values, axis=1) for values in vectors])
    caption = told(caption, len(rows), len(place))
    place, vectors = place[rows], [values[rows] for values in vectors]
    longest = _longest(vectors)
    low, high = place.min(axis=0), place.max(axis=0)
    span = np.maximum(high - low, 1e-3 * float(np.ptp(place)) + 1.0)
    factor, margin = 0.14 * float(span.max()) / longest, 0.2 * float(span.max())  # mm drawn for one µm, and about all
    width = 170.0 / len(vectors)
    height = min(22 + (width - 16) * float((span[1] + 2 * margin) / (span[0] + 2 * margin)), 150.0)
    edges: dict[str, Any] = {"left": 0.085, "right": 0.995, "bottom": 12 / height, "top": 1 - 8 / height}
    with style.pictures(height, 1, len(vectors), **edges, wspace=0.08) as (figure, axes):
        colours = (MUTED, ACCENT, ACCENT)
        for ax, (title, _), values, colour in zip(axes, series, vectors, colours, strict=False):
            style.dots(ax, place[:, 0], place[:, 1], 2.0, RULE)
            tips = place + factor * values
            arrows(ax, place, tips - place, colour, width=0.006)
            style.panel_title(ax, title, colour)
            ax.set_aspect("equal")
            ax.set(xlim=(low[0] - margin, high[0] + margin), ylim=(low[1] - margin, high[1] + margin))
            ax.set_xlabel(axis_labels[0])
            ax.locator_params(nbins=5)
        axes[0].set_ylabel(axis_labels[1])
        unit = round_length(longest)
        x, y = high[0] + 0.9 * margin - factor * unit, low[1] - 0.75 * margin
        axes[-1].plot([x, x + factor * unit], [y, y], color=ACCENT, lw=1.6, solid_capstyle="butt")
        axes[-1].annotate(say("{length:g} µm", length=unit), (x + factor * unit / 2, y), (0, 3),
                          textcoords="offset points", ha="center", va="bottom", fontsize=TINY)  # fmt: skip
        return style.drawn(figure, caption, alternative)


def _longest(vectors: Sequence[Floats]) -> float:
    return max(float(np.linalg.norm(values, axis=1).max(initial=0.0)) for values in vectors) or 1.0


def arrows(ax: Axes, place: Floats, way: Floats, colour: str, **looks: Any) -> None:
    """Arrows of (n, 2) in the units of the axes."""
    ax.quiver(*place.T, *way.T, angles="xy", scale_units="xy", scale=1, color=colour, **looks)


def scale_bar(
    figure: Figure, ax: Axes, left_mm: float, up_mm: float, factor: float, longest: float, colour: str
) -> float:
    """A round length of vectors to scale, drawn by ``factor`` mm for one µm; where it ends, part of the figure's width."""
    length = round_length(longest)
    start, up = left_mm / WIDTH_MM, up_mm / (float(figure.get_size_inches()[1]) * 25.4)
    return bar(figure, start, up, length * factor * mm_of(ax), 1.8, colour, say("{length:g} µm", length=length))


def mm_of(ax: Axes) -> float:
    """Part of the figure's width that a millimetre of the axes takes."""
    x0, x1 = ax.get_xlim()
    return float(ax.get_position().width / (x1 - x0))


def bar(figure: Figure, left: float, up: float, length: float, width: float, colour: str, text: Text) -> float:
    """A line of a key with what it means behind its end."""
    from matplotlib.lines import Line2D

    end = left + length
    figure.add_artist(Line2D([left, end], [up, up], color=colour, lw=width, solid_capstyle="butt"))
    figure.text(end + 0.008, up, text, ha="left", va="center", fontsize=TINY, color=INK)
    return end


def round_length(longest: float) -> float:
    """The largest of 1, 2, 5 times a power of ten that is not longer than the longest vector."""
    power = 10.0 ** np.floor(np.log10(longest))
    return float(max(step * power for step in (1.0, 2.0, 5.0) if step * power <= longest))


def residual_field_plot(
    field: ResidualField, expanded_um: Floats, *, titles: tuple[Text, Text] | tuple[Text], shade: Shade | None = None,
    caption: Text, alternative: Text,
) -> Plot:  # fmt: skip
    """Vectors in the two planes that show most of them, a column before and a column after, all magnified alike.

    What is longer than its expanded uncertainty is an arrow; what lies within it is a thin line without a head.

    ``expanded_um``: (q,) expanded uncertainty of the length of each vector, µm.
    """
    place, limit = (
        style.finite("place", field.place, (None, 3)),
        style.finite("expanded_um", expanded_um, (len(field.place),)),
    )
    series = [style.finite("vectors", v, place.shape) for v in (field.before, field.after)[: len(titles)]]
    sizes = [np.linalg.norm(values, axis=1) for values in series]
    rows = shown([size[::2] for size in sizes] if field.lengths else sizes)
    if field.lengths:  # both ends of each
        rows = np.column_stack([2 * rows, 2 * rows + 1]).ravel()
    caption = told(caption, len(rows), len(place))
    place, limit, series = place[rows], limit[rows], [values[rows] for values in series]
    planes, longest = _planes(place, series[0]), _longest(series)
    low, high = place.min(axis=0), place.max(axis=0)
    span = max(float((high - low).max()), 1.0)
    factor = _LONGEST * span / longest  # mm drawn for one µm
    low, high = low - 0.19 * span, high + 0.19 * span
    colours = (DIVERGING[-1], ACCENT)
    with style.house_style():
        figure, axes = _panels(planes, len(titles), high - low)
        for row, (a, b) in enumerate(planes):
            for column, values in enumerate(series):
                ax, at = axes[row][column], place[:, (a, b)]
                if shade is not None and shade[0] in (_AXES[a].lower(), _AXES[b].lower()):
                    span_of = ax.axvspan if shade[0] == _AXES[a].lower() else ax.axhspan
                    span_of(*shade[1:], color=BAND, lw=0, zorder=0)
                if field.lengths:
                    style.strokes(ax, at[::2, 0], at[1::2, 0], at[::2, 1], at[1::2, 1], color=RULE, lw=0.8, zorder=1)
                beyond = np.linalg.norm(values, axis=1) > limit
                _vectors(ax, at, factor * values[:, (a, b)], beyond, colours[column])
                ax.set(xlim=(low[a], high[a]), ylim=(low[b], high[b]), aspect="equal")
                ax.locator_params(nbins=5)
                ax.set_xlabel(say("{axis} / mm", axis=Verbatim(_AXES[a])), labelpad=1)
                if not column:
                    ax.set_ylabel(say("{axis} / mm", axis=Verbatim(_AXES[b])))
                if not row:
                    style.panel_title(ax, titles[column], colours[column])
        _key(figure, axes[-1][0], factor, longest, float(np.median(limit)), colours[0])
        return style.drawn(figure, caption, alternative)


def _planes(place: Floats, vectors: Floats) -> list[tuple[int, int]]:
    """The two planes that show most; one alone where the third direction has neither places nor vectors."""
    span = np.ptp(place, axis=0)
    content = np.sqrt(np.mean(vectors**2, axis=0))
    weight = span / max(float(span.max()), 1e-9) + content / max(float(content.max()), 1e-9)
    order = sorted(_PLANES, key=lambda plane: -(weight[plane[0]] + weight[plane[1]]))
    third = weight[next(i for i in range(3) if i not in order[0])]
    return order[:1] if third < 0.05 else order[:2]


def _panels(planes: list[tuple[int, int]], columns: int, spans: Floats) -> tuple[Figure, list[list[Axes]]]:
    """Panels to one scale, a row for each plane, above the room for the key."""
    left, gap, right, label, top, base = 14.0, 12.0, 2.0, 9.0, 6.0, 11.0
    wide = max(float(spans[a]) for a, _ in planes)
    width = (WIDTH_MM - left - right - gap * (columns - 1)) / max(columns, 2)
    scale = min(width / wide, 94.0 / sum(float(spans[b]) for _, b in planes))
    heights = [scale * float(spans[b]) for _, b in planes]
    height = top + base + sum(heights) + label * len(planes)
    figure, step = style.new_figure(height), max(scale * wide, _TITLE) + gap
    axes, y = [], height - top
    for (a, _), tall in zip(planes, heights, strict=True):
        y -= tall
        size = y / height, scale * float(spans[a]) / WIDTH_MM, tall / height
        axes.append([figure.add_axes(((left + column * step) / WIDTH_MM, *size)) for column in range(columns)])
        y -= label
    return figure, axes


def _vectors(ax: Axes, place: Floats, way: Floats, beyond: NDArray[np.bool_], colour: str) -> None:
    (x0, y0), (x1, y1) = place[~beyond].T, (place + way)[~beyond].T
    style.strokes(ax, x0, x1, y0, y1, color=MUTED, lw=0.5, solid_capstyle="round", zorder=2)
    if beyond.any():
        arrows(ax, place[beyond], way[beyond], colour, units="width", width=0.006, headwidth=4, headlength=5, zorder=3)


def _key(figure: Figure, ax: Axes, factor: float, longest: float, limit: float, colour: str) -> None:
    """A round length to scale, and the expanded uncertainty to the same scale."""
    end = scale_bar(figure, ax, 14.0, 3.2, factor, longest, colour)
    left, up, length = end + 0.14, 3.2 / (float(figure.get_size_inches()[1]) * 25.4), limit * factor * mm_of(ax)
    if length < 0.3:
        text = say("U = {limit:.2g} µm; within it a thin line without a head", limit=limit)
        bar(figure, left, up, length, 0.8, MUTED, text)
    else:
        text = say("U = {limit:.2g} µm, longer than any vector", limit=limit)
        figure.text(left, up, text, va="center", fontsize=TINY, color=INK)


def profile_plot(
    curve: tuple[Floats, Floats, Floats], data: tuple[Floats, Floats, Floats], region: tuple[float, float], *,
    x_label: Text, y_label: Text, caption: Text, alternative: Text,
) -> Plot:  # fmt: skip
    """A function with its band above, what each observation leaves below, the region where it matters shaded in both.

    ``curve``: covariate, function in µm and its expanded uncertainty, each (p,); ``data``: lowest and highest covariate
    of each observation, and its residual in µm, each (m,).
    """
    x, y, half = (style.finite("curve", values, np.shape(curve[0])) for values in curve)
    low, high, residual = (style.finite("data", values, np.shape(data[0])) for values in data)
    rows = shown([residual])
    caption = told(caption, len(rows), len(low))
    low, high, residual = low[rows], high[rows], residual[rows]
    middle = 0.5 * (region[0] + region[1])
    seen = max(0.5 * (region[1] - region[0]), 0.005 * float(np.ptp(x)))  # a hundredth of the picture at least
    edges: dict[str, Any] = {"left": 0.105, "right": 0.985, "bottom": 0.115, "top": 0.94, "hspace": 0.22}
    with style.pictures(90, 2, height_ratios=(1.0, 0.8), **edges) as (figure, (above, below)):
        for ax in (above, below):
            ax.axvspan(middle - seen, middle + seen, color=BAND, lw=0, zorder=0)
            ax.axhline(0, color=INK, lw=0.6, zorder=1)
            ax.grid(axis="y")
        style.band(above, x, y, half, alpha=0.18, zorder=2)
        above.plot(x, y, color=ACCENT, lw=1.4, zorder=3)
        above.set_ylabel(y_label)
        style.panel_title(above, say("What the observations show together, with U"), ACCENT)
        wide = high - low > 1e-3 * np.ptp(x)
        if wide.any():
            ends = low[wide], high[wide], residual[wide], residual[wide]
            style.strokes(below, *ends, color=DIVERGING[-1], lw=0.6, zorder=2)
        size = float(np.clip(60.0 / len(low) ** 0.75, 1.3, 3.6))
        style.dots(below, 0.5 * (low + high), residual, size, DIVERGING[-1], hollow=True)
        below.set(xlabel=x_label, ylabel=say("Residual / µm"))
        style.panel_title(below, say("What each observation leaves"), DIVERGING[-1])
        below.margins(x=0.02, y=0.1)
        figure.align_ylabels((above, below))
        return style.drawn(figure, caption, alternative)
