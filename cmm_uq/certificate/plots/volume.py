"""Positions of an artefact in the measured volume and what further ones gain; residuals as arrows in its projections."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import product
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike

from cmm_uq.analysis.diagnosis.location import ResidualField
from cmm_uq.analysis.planning.set_up import SetUp
from cmm_uq.base.messages import Text, Verbatim, number, say, semicolons
from cmm_uq.base.points import AXES, Floats
from cmm_uq.certificate.document import Plot
from cmm_uq.certificate.plots import style
from cmm_uq.certificate.plots.residuals import shown, told
from cmm_uq.certificate.plots.style import ACCENT, BAND, DIVERGING, INK, MUTED, RULE, TINY, WIDTH_MM

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure


_PLANES = ((0, 1), (0, 2), (1, 2))
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
        return style.drawn(figure, caption, alternative, "vectors")


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
                if shade is not None and shade[0] in (AXES[a], AXES[b]):
                    span_of = ax.axvspan if shade[0] == AXES[a] else ax.axhspan
                    span_of(*shade[1:], color=BAND, lw=0, zorder=0)
                if field.lengths:
                    style.strokes(ax, at[::2, 0], at[1::2, 0], at[::2, 1], at[1::2, 1], color=RULE, lw=0.8, zorder=1)
                beyond = np.linalg.norm(values, axis=1) > limit
                way = factor * values[:, (a, b)]
                (x0, y0), (x1, y1) = at[~beyond].T, (at + way)[~beyond].T
                style.strokes(ax, x0, x1, y0, y1, color=MUTED, lw=0.5, solid_capstyle="round", zorder=2)
                if beyond.any():
                    arrows(ax, at[beyond], way[beyond], colours[column], units="width", width=0.006, headwidth=4, headlength=5,
                           zorder=3)  # fmt: skip
                ax.set(xlim=(low[a], high[a]), ylim=(low[b], high[b]), aspect="equal")
                ax.locator_params(nbins=5)
                ax.set_xlabel(say("{axis} / mm", axis=Verbatim(AXES[a].upper())), labelpad=1)
                if not column:
                    ax.set_ylabel(say("{axis} / mm", axis=Verbatim(AXES[b].upper())))
                if not row:
                    style.panel_title(ax, titles[column], colours[column])
        _key(figure, axes[-1][0], factor, longest, float(np.median(limit)), colours[0])
        return style.drawn(figure, caption, alternative, "field")


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
        return style.drawn(figure, caption, alternative, "profile")


A_ROW = 3  # pictures side by side
DEPTH = 0.5 * np.array([np.cos(np.radians(38.0)), np.sin(np.radians(38.0))])  # how the y axis runs into the picture
_REACH, _BELOW = 0.04, 0.064
"""Distance of the axes' names from the frame, and of that of X below it, in parts of the travel of X."""

_LABEL_MM = 1.7  # half the height of a name, with some room
_ROOM_MM = WIDTH_MM * (1 / A_ROW - 0.05)
_TEXT_MM = 15.0


def placing_pictures(placings: Sequence[SetUp], box: Floats, first: int) -> list[Plot]:
    """Set-ups in the machine's volume, (3, 2) scale readings in mm, seen from the front, three in a row."""
    rows = [placings[i : i + A_ROW] for i in range(0, len(placings), A_ROW)]
    return [_row(row, box, first + A_ROW * i) for i, row in enumerate(rows)]


def _row(placings: Sequence[SetUp], box: Floats, first: int) -> Plot:
    corners = _seen(np.array(list(product(*box))))
    low, high = corners.min(axis=0), corners.max(axis=0)
    span = 1.22 * (high - low)
    width = WIDTH_MM / A_ROW
    below = _BELOW * float(np.ptp(box[0])) + _LABEL_MM * float(span[0]) / width
    span[1] = max(span[1], high[1] - low[1] + 2 * below)  # the name of X needs more room than a share of a low volume
    height = min(width * float(span[1] / span[0]), 75.0) + _TEXT_MM
    with style.house_style():
        figure = style.new_figure(height)
        for i, placing in enumerate(placings):
            ax = figure.add_axes((i / A_ROW, 0.0, 1 / A_ROW, 1 - _TEXT_MM / height))
            _draw(ax, placing, box)
            middle = 0.5 * (low + high)
            ax.set(xlim=middle[0] + np.array([-0.5, 0.5]) * span[0], ylim=middle[1] + np.array([-0.5, 0.5]) * span[1])
            ax.set_aspect("equal")
            ax.axis("off")
            left = i / A_ROW + 0.008
            figure.text(left, 1 - 4.5 / height, f"{first + i}", fontsize=10, color=ACCENT, fontweight="bold")
            lines = _title(placing.title)
            size = min(map(_size, lines))
            for line, below in zip(lines, (4.5,) if len(lines) == 1 else (3.6, 6.4), strict=True):
                figure.text(left + 0.035, 1 - below / height, line, fontsize=size, color=INK, fontweight="bold")
            figure.text(left, 1 - 9.5 / height, placing.ends, fontsize=TINY, color=MUTED)
        last, numbers = first + len(placings) - 1, say("Set-up {first}", first=first)
        if last > first:
            numbers = say("Set-ups {first} to {last}", first=first, last=last)
        told = say(
            "{numbers}: scale readings in mm; ○ is the first point, dashed lines drop to the table.", numbers=numbers
        )
        words = [say("{first}: {title}, {ends} mm", first=first + i, title=p.title, ends=p.ends)
                 for i, p in enumerate(placings)]  # fmt: skip
        return style.drawn(figure, told, semicolons(words), "set-ups")


def _seen(xyz: Floats) -> Floats:
    """Points (n, 3) as drawn (n, 2): x to the right, z up, y into the picture."""
    return np.asarray(xyz[:, [0, 2]] + xyz[:, 1:2] * DEPTH)


def _draw(ax: Axes, placing: SetUp, box: Floats) -> None:
    _frame(ax, box)
    readings = placing.points.machine_xyz[placing.points.repeat == placing.points.repeat.min()]
    floor = readings.copy()
    floor[:, 2] = box[2, 0]
    outline = _outline(readings)
    _line(ax, floor[outline], RULE, 2.0)
    for row in outline[:-1] if len(outline) > 2 else outline:
        _line(ax, np.vstack([readings[row], floor[row]]), MUTED, 0.5, dashed=True)
    _line(ax, readings[outline], ACCENT, 1.6)
    seen = _seen(readings)
    style.dots(ax, seen[:, 0], seen[:, 1], 4.6 if len(readings) <= 3 else 2.2, ACCENT, zorder=5)
    style.dots(ax, seen[:1, 0], seen[:1, 1], 6.0, ACCENT, hollow=True, zorder=6)


def _frame(ax: Axes, box: Floats) -> None:
    """Edges of the volume, those behind lighter, and the names of the axes."""
    x, y, z = box
    floor = np.array([[x[i], y[j], z[0]] for i, j in ((0, 0), (1, 0), (1, 1), (0, 1), (0, 0))])
    polygon = _seen(floor)
    ax.fill(polygon[:, 0], polygon[:, 1], color="#f4f7f8", zorder=0)
    _line(ax, floor, MUTED, 0.6)
    _line(ax, floor + np.array([0.0, 0.0, z[1] - z[0]]), RULE, 0.6)
    for i in range(4):
        _line(ax, np.vstack([floor[i], floor[i] + [0.0, 0.0, z[1] - z[0]]]), RULE, 0.6)
    reach = _REACH * (x[1] - x[0])
    at = _seen(np.array([[x.mean(), y[0], z[0]], [x[1], y.mean(), z[0]], [x[0], y[0], z.mean()]]))
    for (across, up), name, shift in zip(at, AXES, ((0.0, -_BELOW / _REACH), (1.4, -1.0), (-1.4, 0.0)), strict=True):
        ax.text(across + shift[0] * reach, up + shift[1] * reach, name.upper(), fontsize=TINY, color=MUTED, ha="center",
                va="center")  # fmt: skip


def _outline(readings: Floats) -> list[int]:
    """Rows to join: along a line from end to end, about a surface through its outermost points."""
    about = readings - readings.mean(axis=0)
    if np.abs(about).max() < 1e-6:  # nothing but a rotary axis moves
        return [0, 0]
    _, size, axes = np.linalg.svd(about, full_matrices=False)
    if len(size) < 2 or size[1] < 1e-3 * size[0]:
        along = about @ axes[0]
        return [int(np.argmin(along)), int(np.argmax(along))]
    from scipy.spatial import ConvexHull

    hull = [int(row) for row in ConvexHull(about @ axes[:2].T).vertices]
    return [*hull, hull[0]]


def _line(ax: Axes, xyz: Floats, colour: str, width: float, *, dashed: bool = False) -> None:
    ax.plot(*_seen(xyz).T, lw=width, color=colour, ls=(0, (3, 2)) if dashed else "-", zorder=2)


def gain_plot(
    labels: Sequence[Text], before: Sequence[float | None], after: Sequence[float | None], *, names: tuple[Text, Text],
    quantity: Text,
) -> Plot:  # fmt: skip
    """Before and after, smaller is better, over the larger of the two; ``None``, infinite, stands at the right edge."""
    pairs = np.array([[np.inf if value is None else value for value in series] for series in (before, after)]).T
    largest = np.where(np.isfinite(pairs), pairs, 0.0).max(axis=1)
    ratio = pairs / np.where(largest > 0, largest, 1.0)[:, None]
    shown = np.where(np.isfinite(ratio), ratio, 1.3)
    height, never = 20.0 + 5.2 * len(labels), say("not at all")
    with style.picture(height, left=0.36, right=0.98, bottom=11 / height, top=1 - 8 / height) as (figure, ax):
        y = np.arange(len(labels), dtype=np.float64)[::-1]
        for i, row in enumerate(y):
            ax.plot(shown[i], [row, row], color=RULE, lw=2.2, solid_capstyle="butt", zorder=1)
        style.dots(ax, shown[:, 0], y, 5.0, MUTED, hollow=True)
        style.dots(ax, shown[:, 1], y, 5.0, ACCENT, zorder=4)
        ax.set_yticks(y, labels)
        ax.set(xlim=(0.0, _edge(never)), ylim=(-0.7, len(labels) - 0.3))
        ax.set_xticks([0, 0.25, 0.5, 0.75, 1.0, 1.3], ["0", "¼", "½", "¾", "1", never])
        ax.grid(axis="x")
        ax.set_xlabel(say("{quantity}, over the larger of the two", quantity=quantity))
        figure.text(0.36, 1 - 4.5 / height, say("○ {plan}", plan=names[0]), color=MUTED, fontsize=8)
        figure.text(0.66, 1 - 4.5 / height, say("● {plan}", plan=names[1]), color=ACCENT, fontsize=8, fontweight="bold")
        figures = ([number(value, ".2g") if np.isfinite(value) else never for value in pair] for pair in pairs)
        words = semicolons(
            say("{label}: {before} before, {after} after", label=label, before=a, after=b)
            for label, (a, b) in zip(labels, figures, strict=True)
        )
        both = say("{quantity} with {one} and with {other}.", quantity=quantity, one=names[0], other=names[1])
        return style.drawn(figure, both, words, "gain")


def _title(title: Text) -> list[Text]:
    """In two lines where one would have to be of smaller letters than are used anywhere."""
    return [title] if _size(title) >= TINY else style.folded(title, _ROOM_MM, TINY, "bold")


def _size(title: Text) -> float:
    """Of the letters of a placing's title, smaller where it is longer than its picture is wide."""
    return style.SMALL * min(1.0, _ROOM_MM / style.width_mm(style.lettered(title), style.SMALL, "bold"))


def _edge(last: Text) -> float:
    """Right end of the axis, so that the text of its last tick, at 1.3, has room."""
    axis, beside = 0.62 * WIDTH_MM, style.width_mm(style.lettered(last), style.SMALL) / 2 - 0.02 * WIDTH_MM
    return max(1.38, 1.3 * axis / (axis - beside))
