"""Lengths, residuals, errors against limits, curves and budgets as pictures; nothing is computed but where the ink goes."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from cmm_uq.base.errors import CmmUqError
from cmm_uq.base.messages import NOTHING, Text, holding, say, semicolons, signed
from cmm_uq.base.points import Floats, Ints
from cmm_uq.base.units import MICROMETRE
from cmm_uq.certificate.document import Plot
from cmm_uq.certificate.plots import style
from cmm_uq.certificate.plots.style import ACCENT, BAND, DIVERGING, INK, MUTED, RULE, WIDTH_MM
from cmm_uq.certificate.result import Result
from cmm_uq.certificate.wording import deviating
from cmm_uq.maths.uncertainty.quantity import alike

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

_NOTE_MM = 128.0  # room of the note beside a title of thirty letters
_PANELS, _AXES = ((0, 1), (0, 2), (1, 2)), (say("X / mm"), say("Y / mm"), say("Z / mm"))


def length_plot(
    position: ArrayLike, before_um: ArrayLike, after_um: ArrayLike | None = None, *, expanded_before_um: ArrayLike | float,
    expanded_after_um: ArrayLike | float | None = None, reference: Text, reference_expanded_um: float = 0.0,
    flagged: ArrayLike | None = None, position_label: Text = say("Position of the bar"),
    before_label: Text = say("Before the model"), after_label: Text = say("After the fitted model"), caption: Text,
    alternative: Text,
) -> Plot:  # fmt: skip
    """Deviations from a reference with their U by position, such as bar lengths before and after the fitted model.

    ``position``: (n,) number of each position; repeats carry the same number and are drawn side by side; ``before_um,
    after_um``: (n,) length minus reference, µm, a panel each; ``expanded_before_um, expanded_after_um``: (n,) or one for
    all, µm, after as before where it is left out; ``reference``: what zero is, with its figure, such as "certified length
    404.2357 mm"; ``reference_expanded_um``: its U, µm: the half width of the band about zero; ``flagged``: (n,) true where
    screening flagged the position.
    """
    from matplotlib.ticker import MaxNLocator, MultipleLocator, NullFormatter, NullLocator

    expanded_after_um = expanded_before_um if expanded_after_um is None else expanded_after_um
    given = [(before_label, before_um, expanded_before_um, ACCENT if after_um is None else MUTED)]
    if after_um is not None:
        given.append((after_label, after_um, expanded_after_um, ACCENT))
    count, two = np.asarray(given[0][1]).shape[0], len(given) == 2
    x = _side_by_side(style.finite("position", position, (count,)))
    series = [(label, style.finite("deviation", values, (count,)), U, colour) for label, values, U, colour in given]
    marked = np.zeros(count, dtype=bool) if flagged is None else np.asarray(flagged, dtype=bool)
    rows = shown([values for _, values, _, _ in series], marked)
    caption, x, marked = told(caption, len(rows), count), x[rows], marked[rows]
    size = float(np.clip(60.0 / count**0.75, 1.3, 4.2))
    below, above = (0.105, 0.945) if two else (0.16, 0.92)
    with style.pictures(
        84 if two else 62, len(series), left=0.082, right=0.995, bottom=below, top=above, hspace=0.27
    ) as (figure, axes):
        for ax, (label, whole, expanded, colour) in zip(axes, series, strict=True):
            every = np.broadcast_to(np.asarray(expanded, dtype=float), (count,))
            half, values = style.finite("expanded uncertainty", every, (count,))[rows], whole[rows]
            ax.axhspan(-reference_expanded_um, reference_expanded_um, color=BAND, lw=0, zorder=0)
            ax.axhline(0, color=INK, lw=0.7, zorder=1)
            style.bars(ax, x, values - half, values + half, max(0.28 * size, 0.6), colour)
            style.dots(ax, x, values, size, colour, hollow=colour == MUTED)  # the two series differ in grey too
            if marked.any():
                ax.plot(x[marked], values[marked], ls="", marker="o", ms=size + 4, mfc="none", mec=DIVERGING[-1], mew=1.1,
                        zorder=4)  # fmt: skip
            ax.grid(axis="y")
            ax.margins(y=0.08)
            ax.set_ylabel(say("Deviation / µm"))
            style.panel_title(ax, label, colour)
        for ax in axes[:-1]:
            ax.xaxis.major = type(ax.xaxis.major)()  # or ticks as of the last panel are made, and not shown
            ax.xaxis.set(major_locator=NullLocator(), major_formatter=NullFormatter())
        room = 0.8 + 0.01 * float(np.ptp(x))
        axes[-1].set(xlabel=position_label, xlim=(x.min() - room, x.max() + room))
        axes[-1].xaxis.set_major_locator(MultipleLocator(1) if np.ptp(x) <= 30 else MaxNLocator(12, integer=True))
        figure.align_ylabels(axes)
        zero_is = say("zero: {reference}", reference=reference)
        if reference_expanded_um:
            zero_is = say("zero: {reference}, band: its U = {U:.2g} µm", reference=reference, U=reference_expanded_um)
        marks = say("bars: U, rings: flagged by screening") if marked.any() else say("bars: U")
        legend = semicolons((zero_is, marks))
        if style.width_mm(style.lettered(legend), style.TINY) > _NOTE_MM:
            figure.subplots_adjust(top=0.905 if two else 0.86)  # the note has a line of its own
        style.note(figure, legend, 0.995, 0.985)
        return style.drawn(figure, caption, alternative, "lengths")


def _side_by_side(position: Floats) -> Floats:
    _, inverse, counts = np.unique(position, return_inverse=True, return_counts=True)
    order = np.argsort(inverse, kind="stable")
    rank = np.empty(len(position))
    rank[order] = np.arange(len(position)) - np.repeat(np.cumsum(counts) - counts, counts)
    return position + 0.6 * ((rank + 0.5) / counts[inverse] - 0.5)


def volume_plot(
    start_mm: ArrayLike, residual_um: ArrayLike, *, end_mm: ArrayLike | None = None, travel_mm: ArrayLike | None = None,
    caption: Text, alternative: Text,
) -> Plot:  # fmt: skip
    """Residuals where they lie in the machine's volume, in three orthogonal projections to one scale.

    Sign and size show twice: by colour, and by a dot that is full for a positive residual, hollow for a negative one,
    and grows with it, so the picture also works in grey.

    ``start_mm``: (n, 3) one end of each bar, or the points themselves; ``residual_um``: (n,); ``end_mm``: (n, 3) the other
    ends; none for points; ``travel_mm``: (3, 2) the machine's volume in the same frame, drawn as an outline where given.
    """
    start = style.finite("start_mm", start_mm, (None, 3))
    end = start if end_mm is None else style.finite("end_mm", end_mm, (len(start), 3))
    residual = style.finite("residual_um", residual_um, (len(start),))
    rows = shown([residual])
    caption = told(caption, len(rows), len(residual))
    start, end, residual = start[rows], end[rows], residual[rows]
    box = None if travel_mm is None else style.finite("travel_mm", travel_mm, (3, 2))
    limit = float(np.abs(residual).max(initial=0.0)) or 1.0
    edges = limit * np.linspace(-1, 1, len(DIVERGING) + 1)
    step = np.clip(np.searchsorted(edges, residual, side="right") - 1, 0, len(DIVERGING) - 1)
    extremes_last = np.argsort(np.abs(np.arange(len(DIVERGING)) - len(DIVERGING) // 2), kind="stable")
    everything = np.vstack([start, end] if box is None else [start, end, box.T])
    low, high = everything.min(axis=0), everything.max(axis=0)
    margin = 0.06 * float((high - low).max()) + 1e-9
    low, high = low - margin, high + margin
    with style.house_style():
        figure, axes, scale_axes = _projections(high - low)
        for ax, (a, b) in zip(axes, _PANELS, strict=True):
            for index in extremes_last:
                chosen = step == index
                _members(ax, start[chosen][:, (a, b)], end[chosen][:, (a, b)], residual[chosen] / limit,
                         DIVERGING[index], len(start))  # fmt: skip
            if box is not None:
                (left, right), (bottom, top) = box[a], box[b]
                around = [left, right, right, left, left], [bottom, bottom, top, top, bottom]
                ax.plot(*around, color=RULE, lw=0.7, zorder=0)
            ax.set(xlabel=_AXES[a], ylabel=_AXES[b], xlim=(low[a], high[a]), ylim=(low[b], high[b]))
            ax.locator_params(nbins=4)
        scale_axes.bar(edges[:-1], 1, np.diff(edges), align="edge", color=DIVERGING, lw=0)
        digits = max(0, 1 - int(np.floor(np.log10(limit))))
        scale_axes.set_xticks(edges, [f"{edge:+.{digits}f}".replace("-", "−") for edge in edges])
        scale_axes.set(xlim=(edges[0], edges[-1]), yticks=[])
        label = say("{quantity}  (full dot: positive, hollow dot: negative)", quantity=say("Residual / µm"))
        scale_axes.set_xlabel(label, labelpad=2)
        scale_axes.spines[:].set_visible(False)
        return style.drawn(figure, caption, alternative, "residuals")


def _projections(spans: Floats) -> tuple[Figure, list[Axes], Axes]:
    """Three panels side by side on one base line and to one scale, and a strip below for the colours."""
    across, up = [spans[a] for a, _ in _PANELS], [spans[b] for _, b in _PANELS]
    label, right, base = 14.0, 4.0, 25.0  # mm beside each panel, at the right edge, below the panels
    scale = min((WIDTH_MM - 3 * label - right) / sum(across), 70.0 / max(up))
    height = base + scale * max(up) + 2.0
    figure = style.new_figure(height)
    spare = (WIDTH_MM - 3 * label - right - scale * sum(across)) / 3
    axes, x = [], label
    for w, h in zip(across, up, strict=True):
        axes.append(figure.add_axes((x / WIDTH_MM, base / height, scale * w / WIDTH_MM, scale * h / height)))
        x += scale * w + label + spare
    return figure, axes, figure.add_axes((0.28, 9.5 / height, 0.44, 2.6 / height))


def _members(ax: Axes, start: Floats, end: Floats, relative: Floats, colour: str, total: int) -> None:
    """Bars of one colour step, with dots at their middles in four sizes."""
    width = float(np.clip(14 / np.sqrt(total), 0.7, 2.2))
    (x0, y0), (x1, y1), (x, y) = start.T, end.T, ((start + end) / 2).T
    style.strokes(ax, x0, x1, y0, y1, color=colour, lw=width, solid_capstyle="round", zorder=2)
    classes = np.minimum(np.floor(np.abs(relative) * 4), 3)
    for size_class in np.unique(classes):
        size = float(np.clip(28 / np.sqrt(total), 1.4, 4.5)) * (0.6 + 0.4 * size_class)
        for positive in (True, False):
            some = (classes == size_class) & ((relative >= 0) == positive)
            if some.any():
                style.dots(ax, x[some], y[some], size, colour, hollow=not positive)


def curve_with_band(
    x: ArrayLike, y: ArrayLike, expanded: ArrayLike, *, x_label: Text, y_label: Text,
    points: tuple[ArrayLike, ArrayLike] | None = None, caption: Text, alternative: Text,
) -> Plot:  # fmt: skip
    """A curve (n,) with the band of its expanded uncertainty (n,), and optional points that it was drawn through."""
    across = style.finite("x", x, (None,))
    values, half = style.finite("y", y, across.shape), style.finite("expanded uncertainty", expanded, across.shape)
    # room for ticks of six characters
    with style.picture(72, left=0.105, right=0.975, bottom=0.14, top=0.97) as (figure, ax):
        style.band(ax, across, values, half, alpha=0.16)
        ax.plot(across, values, color=ACCENT, lw=1.3)
        ax.axhline(0, color=INK, lw=0.6, zorder=1)
        if points is not None:
            px, py = (style.finite("points", part, (None,)) for part in points)
            style.dots(ax, px, py, 2.5, MUTED)
        ax.grid(axis="y")
        ax.margins(x=0.01)
        ax.set(xlabel=x_label, ylabel=y_label)
        return style.drawn(figure, caption, alternative, "curve")


def deviations_plot(
    result: Result, off_um: Floats, what: Text, from_reference: Text = NOTHING, *, position: ArrayLike | None = None,
    after_um: Floats | None = None, expanded_um: Floats | float | None = None, spec: str = ".1f", **shown: Any,
) -> Plot:  # fmt: skip
    """Deviations (n,) from a reference, µm, by measurement or ``position``, and what the fitted model leaves.

    ``what``: deviates, with a verb, ``from_reference``; ``after_um``: the residuals where it is left out, ``expanded_um``:
    U, that of their noise; ``shown``: as of :func:`length_plot`.
    """
    after = result.residuals / MICROMETRE if after_um is None else after_um
    return length_plot(
        result.artefact.measurement.astype(float) if position is None else position, off_um, after,
        expanded_before_um=result.noise.expanded if expanded_um is None else expanded_um,
        **{"flagged": result.flagged if after_um is None else None} | shown,
        alternative=deviating(what, from_reference, off_um, after, spec),
    )  # fmt: skip


def positioning_plot(
    targets: ArrayLike, mean: Floats, s: Floats, arrows: str, unit: Text, *, label: Text, caption: Text, alternative: Text
) -> Plot:  # fmt: skip
    """Mean deviations ``mean`` (d, t) at targets (t,) of each direction, with two standard deviations ``s`` (d, t)."""
    across = style.finite("target", targets, (None,))
    with style.picture(62, left=0.105, right=0.975, bottom=0.16, top=0.92) as (figure, ax):
        for arrow, values, sd in zip(arrows, mean, s, strict=True):
            back, colour = arrow in "↓↻", MUTED if arrow in "↓↻" else ACCENT
            half = 2 * style.finite("standard deviation", sd, across.shape)
            style.band(ax, across, style.finite("mean", values, across.shape), half, colour, alpha=0.16)
            ax.plot(across, values, color=colour, lw=1.1, ls="--" if back else "-")
            style.dots(ax, across, values, 3.0, colour, hollow=back)
        ax.axhline(0, color=INK, lw=0.6, zorder=1)
        ax.grid(axis="y")
        ax.margins(x=0.02)
        ax.set(xlabel=label, ylabel=say("Deviation / {unit}", unit=unit))
        return style.drawn(figure, caption, alternative, "positioning")


def budget_bars(sources: Sequence[Text], shares: ArrayLike, *, caption: Text, alternative: Text) -> Plot:
    """Share of every source in the variance (0 … 1; negative where a correlation takes away), largest first."""
    share = style.finite("shares", shares, (len(sources),))
    if not len(share):
        raise CmmUqError("a budget without a source has no picture")
    from matplotlib import rcParams

    order, rows = np.argsort(-share, kind="stable"), np.arange(len(share))
    names = [style.folded(sources[index], style.NAMES_MM) for index in order]
    height = 10 + (7.0 if any(len(lines) > 1 for lines in names) else 6.0) * len(order)
    with style.picture(height, left=0.34, right=0.93, bottom=1.5 / height, top=1 - 1.5 / height) as (figure, ax):
        colours = [ACCENT if value >= 0 else MUTED for value in share[order]]
        ax.barh(rows, share[order], 0.55, color=colours, lw=0)
        ax.axvline(0, color=MUTED, lw=0.6)
        for row, value in zip(rows, share[order], strict=True):
            text = say("{share} %", share=signed(100 * value, ".1f"))
            ax.annotate(text, (max(value, 0), row), (4, 0), textcoords="offset points", va="center", color=INK)
        style.named_rows(ax, rows, [lines[0] if len(lines) == 1 else NOTHING for lines in names])
        ax.set(xlim=(min(share.min() * 1.15, 0), max(share.max(), 1e-9) * 1.02), xticks=[])
        left = -rcParams["ytick.major.pad"] - rcParams["ytick.major.size"]
        for place, lines in enumerate(names):
            for line, up in zip(lines, (0.6, -0.6), strict=True) if len(lines) > 1 else ():
                ax.annotate(line, (0, place), (left, up * style.SMALL), xycoords=("axes fraction", "data"),
                            textcoords="offset points", ha="right", va="center", fontsize=style.SMALL, color=INK)  # fmt: skip
        ax.spines["bottom"].set_visible(False)
        return style.drawn(figure, caption, alternative, "budget")


def residual_volume(result: Result, what: Text) -> Plot:
    """Residuals of points, or of pairs (bars), over the scale readings; ``what``: the points in words, ``faces``."""
    artefact, residuals = result.artefact, result.residuals / MICROMETRE
    readings, travel = artefact.points.machine_xyz, artefact.points.machine.travel_mm
    ends = readings[artefact.rows]
    low, high = alike(residuals.min(), residuals.max())
    return volume_plot(
        ends[:, 0], residuals, end_mm=ends[:, -1] if ends.shape[1] > 1 else None,
        travel_mm=travel if np.all(np.isfinite(travel)) else None,
        caption=say("Residuals after the fitted model in the machine's volume (scale readings)."),
        alternative=say("Three projections of the {what}; residuals of {low} to {high} µm.", what=what, low=low, high=high),
    )  # fmt: skip


def trumpet(
    length_mm: ArrayLike, error_um: ArrayLike, *, limit_um: ArrayLike, acceptance_um: Sequence[float | None],
    expanded_um: ArrayLike, outside: ArrayLike, quantity: Text, caption: Text, alternative: Text,
) -> Plot:  # fmt: skip
    """Errors against limits on both sides of zero, all (m,), µm; U with k = 2; ``acceptance_um`` None: none is accepted."""
    x = style.finite("length_mm", length_mm, (None,))
    y, top, U = (style.finite(name, values, x.shape) for name, values in
                 (("error_um", error_um), ("limit_um", limit_um), ("expanded_um", expanded_um)))  # fmt: skip
    accepted = np.array([np.nan if value is None else value for value in acceptance_um], dtype=np.float64)
    marked = np.asarray(outside, dtype=bool)
    size = float(np.clip(45.0 / len(x) ** 0.6, 1.6, 4.0))
    with style.picture(76, left=0.082, right=0.985, bottom=0.145, top=0.91) as (figure, ax):
        _limits(ax, x, top, accepted)
        ax.axhline(0, color=INK, lw=0.7, zorder=1)
        style.bars(ax, x, y - U, y + U, max(0.28 * size, 0.6), MUTED)
        style.dots(ax, x[~marked], y[~marked], size, ACCENT)
        style.crosses(ax, x[marked], y[marked], size + 2.5, 1.3)
        ax.set(xlabel=say("Length / mm"), ylabel=quantity, xlim=(0.0, 1.04 * float(x.max())))
        ax.margins(y=0.08)
        ax.grid(axis="y")
        between = say("dashed: limits of acceptance, with the guard band between")
        style.note(figure, semicolons(holding(
            (True, say("lines: ±MPE")), (np.isfinite(accepted).any(), between), (U.any(), say("bars: U (k = 2)")),
            (marked.any(), say("crosses: not accepted")),
        )))  # fmt: skip
        return style.drawn(figure, caption, alternative, "trumpet")


def _limits(ax: Axes, x: Floats, top: Floats, accepted: Floats) -> None:
    """±MPE as lines, what lies between it and the acceptance limit as bands; level where only one length is there."""
    length, first = np.unique(x, return_index=True)
    limit, inner = top[first], accepted[first]
    if len(length) == 1:
        length, limit, inner = np.array([0.0, length[0]]), np.repeat(limit, 2), np.repeat(inner, 2)
    for side in (1.0, -1.0):
        known = np.isfinite(inner) & (inner < limit - 1e-9)
        ax.fill_between(length, side * np.where(known, inner, limit), side * limit, color=BAND, lw=0, zorder=0)
        ax.plot(length, side * limit, color=INK, lw=1.1, zorder=2)
        ax.plot(length, side * np.where(known, inner, np.nan), color=INK, lw=0.7, ls=(0, (4, 3)), zorder=2)


_FARTHEST = 3.0  # times the tolerance that the picture reaches; what lies beyond is drawn at its edge with its figure
_MANY = 8  # rows beyond which they stand closer together


def tolerance_plot(
    names: Sequence[Text], ratio: ArrayLike, low: ArrayLike, high: ArrayLike, *, caption: Text, alternative: Text
) -> Plot:
    """Parameters over their tolerances, (n,), a row each: the estimate, signed, and the ends of its coverage interval."""
    value = style.finite("ratio", ratio, (len(names),))
    ends = style.finite("low", low, value.shape), style.finite("high", high, value.shape)
    rows = np.arange(len(value), dtype=np.float64)
    reach = float(np.clip(1.15 * max(np.abs(ends[0]).max(), np.abs(ends[1]).max()), 1.3, _FARTHEST))
    out = (np.minimum(np.abs(ends[0]), np.abs(ends[1])) > 1) & (np.sign(ends[0]) == np.sign(ends[1]))
    height = 14 + (5.5 if len(value) <= _MANY else 4.5) * len(value)
    with style.picture(height, left=0.3, right=0.985, bottom=9 / height, top=1 - 2 / height) as (figure, ax):
        ax.axvspan(-1, 1, color=BAND, lw=0, zorder=0)
        ax.axvline(0, color=INK, lw=0.7, zorder=1)
        for chosen, colour in ((~out, ACCENT), (out, DIVERGING[-1])):
            inside, own = np.clip(value[chosen], -reach, reach), rows[chosen]
            left, right = (np.clip(end[chosen], -reach, reach) for end in ends)
            style.strokes(ax, left, right, own, own, lw=1.6, color=colour, solid_capstyle="butt", zorder=2)
            if colour == ACCENT:
                style.dots(ax, inside, own, 4.0, colour)
            else:
                style.crosses(ax, inside, own, 6.0, 1.6)
        for row in np.flatnonzero(np.abs(value) > reach):
            side = np.sign(value[row])
            ax.annotate(f"{value[row]:+.1f}".replace("-", "−"), (side * reach, row), (-6 * side, 4),
                        textcoords="offset points", ha="right" if side > 0 else "left", color=MUTED)  # fmt: skip
        style.named_rows(ax, rows, names)
        label = say("Parameter over its tolerance (band: inside; cross: outside)")
        ax.set(xlim=(-1.02 * reach, 1.02 * reach), xlabel=label)
        return style.drawn(figure, caption, alternative, "tolerances")


MOST = 1500  # marks of one series: more would run into each other, and a page with them would take a browser seconds
_LARGEST = 300


def shown(sizes: Sequence[Floats], flagged: NDArray[np.bool_] | None = None, most: int = MOST) -> Ints:
    """Rows to draw, ascending: of more than ``most`` those flagged, the largest of each size (n,), and some others."""
    count = len(sizes[0])
    if count <= most:
        return np.arange(count)
    largest = min(_LARGEST, most // 2)
    each = largest // len(sizes)
    first = [np.argsort(-np.abs(size), kind="stable")[:each] for size in sizes]
    marked = np.flatnonzero(flagged)[:largest] if flagged is not None else np.zeros(0, dtype=np.int64)
    chosen = np.unique(np.concatenate([*first, marked]))
    rest = np.setdiff1d(np.arange(count), chosen, assume_unique=True)
    evenly = np.linspace(0, len(rest) - 1, most - len(chosen)).astype(np.int64)
    return np.sort(np.concatenate([chosen, rest[evenly]]))


def told(caption: Text, drawn: int, count: int) -> Text:
    """A caption that says how many of all are drawn, where it is not all."""
    if drawn == count:
        return caption
    return say(
        "{caption} Drawn are {drawn} of {count}: the largest, and some of the others from all over the recording.",
        caption=caption, drawn=drawn, count=count,
    )  # fmt: skip
