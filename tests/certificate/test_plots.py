"""Pictures: what is drawn, how it is lettered, and which of very many marks."""

from __future__ import annotations

import subprocess
import sys
from typing import Any

import matplotlib as mpl
import numpy as np
import pytest

from cmm_uq.base.errors import CmmUqError
from cmm_uq.base.messages import Verbatim, say
from cmm_uq.certificate.document import Plot
from cmm_uq.certificate.part.plots import told_apart
from cmm_uq.certificate.plots.residuals import MOST, budget_bars, curve_with_band, length_plot, shown, told, volume_plot
from cmm_uq.certificate.plots.style import (
    ACCENT,
    DIVERGING,
    MUTED,
    NAMES_MM,
    WIDTH_MM,
    as_svg,
    dots,
    house_style,
    narrowed,
    new_figure,
)
from cmm_uq.certificate.plots.volume import vector_plot
from tests.certificate.samples import plots
from tests.certificate.svg import Drawing, outlines, strokes

RANDOM = np.random.default_rng(3)
WORDS = {"caption": "c", "alternative": "a"}


def lengths(count: int = 20, **changed: Any) -> Plot:
    given = {
        "position": np.arange(1, count + 1),
        "before_um": np.linspace(-100, 80, count),
        "after_um": np.linspace(9, -8, count) ** 3 / 20,
        "expanded_before_um": 8.0,
        "expanded_after_um": np.linspace(3, 9, count),
        "reference": "certified length",
        **WORDS,
    } | changed
    return length_plot(**given)


def volume(residual: list[float], **changed: Any) -> Plot:
    start = np.array([[0.0, 0, 0], [0, 100, 0], [0, 0, 100], [50, 50, 50]])[: len(residual)]
    end = start + np.array([[100.0, 0, 0], [0, 100, 0], [0, 0, 100], [10, 10, 10]])[: len(residual)]
    return volume_plot(**({"start_mm": start, "end_mm": end, "residual_um": residual, **WORDS} | changed))


def linear_misfit(values: Any, drawn: Any) -> float:
    """Largest distance of drawn places from a straight line through the values, pt."""
    line = np.polynomial.Polynomial.fit(values, drawn, 1)
    return float(np.abs(line(np.asarray(values)) - drawn).max())


def test_every_length_is_drawn_at_its_deviation() -> None:
    drawing = Drawing(lengths().svg)
    for colour, values in ((MUTED, np.linspace(-100, 80, 20)), (ACCENT, np.linspace(9, -8, 20) ** 3 / 20)):
        [dots] = drawn = [d for d in drawing.drawn(stroke=colour, stroke_linecap="round") if len(outlines(d)) == 20]
        assert len(drawn) == 1
        place = strokes(dots)[:, 0]
        assert linear_misfit(values, place[:, 1]) < 0.02
        assert linear_misfit(np.arange(20), place[:, 0]) < 0.02
        assert np.polyfit(values, place[:, 1], 1)[0] < 0  # SVG counts downwards


def test_bars_are_as_long_as_the_expanded_uncertainty() -> None:
    drawing = Drawing(lengths().svg)
    [bars] = [d for d in drawing.drawn(stroke=ACCENT) if len(outlines(d)) == 20 and np.ptp(strokes(d)[0, :, 1]) > 0]
    long = np.ptp(strokes(bars)[:, :, 1], axis=1)
    np.testing.assert_allclose(long / long[0], np.linspace(3, 9, 20) / 3, atol=0.01)


def test_flagged_positions_wear_a_ring_in_both_panels() -> None:
    plain, ringed = Drawing(lengths().svg), Drawing(lengths(flagged=np.arange(20) == 4).svg)
    rings = [mark for mark in ringed.marks if mark not in plain.marks]
    drawn = [d for colour in (MUTED, ACCENT) for d in ringed.drawn(stroke=colour, stroke_linecap="round")]
    dots = [d for d in drawn if len(outlines(d)) == 20]
    expected = sorted(tuple(strokes(d)[4, 0]) for d in dots)
    assert np.allclose(sorted(rings), expected, atol=0.02)
    assert any("flagged by screening" in text for text in ringed.texts)
    assert not any("flagged by screening" in text for text in plain.texts)


def test_repeats_of_a_position_stand_side_by_side_near_their_number() -> None:
    drawing = Drawing(lengths(6, position=[1, 1, 1, 2, 2, 2]).svg)
    [dots] = [d for d in drawing.drawn(stroke=ACCENT, stroke_linecap="round") if len(outlines(d)) == 6]
    x = strokes(dots)[:, 0, 0]
    spacing = (x[3:].mean() - x[:3].mean()) * np.array([-0.2, 0, 0.2])
    np.testing.assert_allclose(x[:3] - x[:3].mean(), spacing, atol=0.02)


@pytest.mark.parametrize("count", [1, 2, 20, 600])
def test_a_big_recording_is_not_a_big_picture(count: int) -> None:
    values = RANDOM.standard_normal(count)
    start = RANDOM.uniform(0, 500, (count, 3))
    pictures = [
        lengths(count, before_um=values, after_um=values, expanded_after_um=1.0),
        volume_plot(start, values, end_mm=start + 100, **WORDS),
    ]
    assert all(len(plot.svg) < 300_000 for plot in pictures)


@pytest.mark.long
def test_the_three_projections_have_one_scale() -> None:
    """Bars of 100 mm along X, Y and Z are drawn equally long in the projections that show them."""
    drawn = [stroke for colour in DIVERGING for d in Drawing(volume([1.0, -1.0, 0.0]).svg).drawn(stroke=colour)
             for stroke in strokes(d)]  # fmt: skip
    long = [float(np.hypot(*(b - a))) for a, b in drawn]
    shown = [value for value in long if value > 1]
    assert len(shown) == 6  # each of three bars is seen in two of the three projections
    np.testing.assert_allclose(shown, shown[0], atol=0.03)


def test_colours_are_symmetrical_about_zero() -> None:
    def colour_of(residual: float) -> set[str]:
        drawing = Drawing(volume([7.0, residual]).svg)
        return {c for c in DIVERGING for d in drawing.drawn(stroke=c)} - {colour_of_largest}

    colour_of_largest = DIVERGING[-1]
    assert colour_of(-7.0) == {DIVERGING[0]}
    assert colour_of(0.5) == colour_of(-0.5) == {DIVERGING[3]}
    texts = Drawing(volume([7.0, -2.0]).svg).texts
    assert {"−7.0", "+7.0"} <= set(texts)


def test_sign_shows_without_colour() -> None:
    """Only negative residuals have a white dot on theirs, once in each projection."""

    def hollow(*residual: float) -> int:
        return sum(len(outlines(d)) for d in Drawing(volume(list(residual)).svg).drawn(stroke="#ffffff"))

    assert (hollow(3.0, 2.0), hollow(3.0, -2.0), hollow(-3.0, -2.0)) == (0, 3, 6)


def test_no_residual_at_all_is_a_picture_too() -> None:
    assert "+1.0" in Drawing(volume([0.0, 0.0]).svg).texts


def test_points_are_shown_as_well_as_bars() -> None:
    assert volume_plot(RANDOM.uniform(0, 9, (5, 3)), np.arange(5.0), **WORDS).svg.startswith("<svg ")


def test_a_band_is_as_wide_as_the_expanded_uncertainty() -> None:
    x, y, expanded = np.linspace(0, 440, 23), np.sin(np.linspace(0, 6, 23)), np.linspace(0.1, 0.4, 23)
    drawing = Drawing(curve_with_band(x, y, expanded, x_label="x / mm", y_label="e / µm", **WORDS).svg)
    [curve] = [outlines(d)[0] for d in drawing.drawn(stroke=ACCENT, fill="none")]
    [band] = [outlines(d)[0] for d in drawing.drawn(fill=ACCENT)]
    scale = -np.polyfit(y, curve[:, 1], 1)[0]
    for k in range(23):
        edges = band[np.abs(band[:, 0] - curve[k, 0]) < 0.02][:, 1]
        assert np.ptp(edges) / scale == pytest.approx(2 * expanded[k], abs=0.03 / scale * 2)


def test_a_budget_shows_shares_largest_first() -> None:
    plot = budget_bars(["small", "large", "taken away"], [0.25, 0.8, -0.05], **WORDS)
    drawing = Drawing(plot.svg)
    assert [text for text in drawing.texts if text.endswith("%")] == ["80.0 %", "25.0 %", "−5.0 %"]
    names = [text for text in drawing.texts if not text.endswith("%")]
    assert names == ["large", "small", "taken away"]
    wide = [float(np.ptp(outlines(d)[0][:, 0])) for d in drawing.drawn(fill=ACCENT)]
    assert wide[0] / wide[1] == pytest.approx(0.8 / 0.25, abs=0.01)
    assert len(drawing.drawn(fill=MUTED)) == 1


def test_a_figure_that_is_not_finite_is_refused_not_left_out() -> None:
    with pytest.raises(CmmUqError, match="not finite"):
        lengths(3, after_um=[1.0, np.nan, 2.0])
    with pytest.raises(CmmUqError, match="not finite"):
        volume([np.inf, 1.0])
    with pytest.raises(CmmUqError, match=r"shape \(20,\)"):
        lengths(20, after_um=[1.0, 2.0])
    with pytest.raises(CmmUqError, match="without a source"):
        budget_bars([], [], **WORDS)


def test_any_text_is_text() -> None:
    label = 'Price $5 & $6 <b> 中文 d="1.23456" id="x" \\alpha'
    texts = Drawing(curve_with_band([0, 1], [0, 1], [1, 1], x_label=label, y_label="y", **WORDS).svg).texts
    assert label in texts


def test_two_runs_give_the_same_bytes_and_leave_no_trace() -> None:
    before = dict(mpl.rcParams)
    assert [plot.svg for plot in plots()] == [plot.svg for plot in plots()]
    assert dict(mpl.rcParams) == before


def test_matplotlib_is_imported_late_and_pyplot_never() -> None:
    code = (
        "import sys, cmm_uq.certificate.plots.residuals as p, cmm_uq.certificate.plots.corner\n"
        "assert 'matplotlib' not in sys.modules\n"
        "p.curve_with_band([0, 1], [0, 1], [1, 1], x_label='x', y_label='y', caption='c', alternative='a')\n"
        "assert 'matplotlib.pyplot' not in sys.modules\n"
    )
    subprocess.run([sys.executable, "-c", code], check=True)


def test_points_lie_on_the_curve_that_they_give() -> None:
    x, y = np.linspace(0, 10, 11), np.linspace(-3, 7, 11) ** 2
    drawing = Drawing(curve_with_band(x, y, np.ones(11), x_label="x", y_label="y", points=(x, y), **WORDS).svg)
    [curve] = [outlines(d)[0] for d in drawing.drawn(stroke=ACCENT, fill="none")]
    [dots] = [d for d in drawing.drawn(stroke=MUTED, stroke_linecap="round") if len(outlines(d)) == 11]
    np.testing.assert_allclose(strokes(dots)[:, 0], curve, atol=0.02)


@pytest.mark.parametrize(("x", "path"), [
    ([1.0], "M 10 5 L 10.01 5"), ([1.0, 1.0], "M 10 5 L 10.01 5"), ([1.0, 2.0], "M 10 5 L 10 5 M 20 5 L 20 5"),
])  # fmt: skip
def test_dots_in_one_place_have_an_extent_without_which_viewers_of_pdf_leave_them_out(
    x: list[float], path: str
) -> None:
    """Seen with poppler 22.12: a path of no extent is not drawn, however wide and round its stroke."""
    with house_style():
        figure = new_figure(10 * 25.4 / 72)
        ax = figure.add_axes((0, 0, 100 * 25.4 / 72 / WIDTH_MM, 1))
        dots(ax, np.array(x), np.ones(len(x)), 4.0, ACCENT)
        ax.set(xlim=(0, 10), ylim=(0, 2))
        ax.axis("off")
        assert f'd="{path}"' in as_svg(figure)


@pytest.mark.long
def test_long_names_that_begin_alike_keep_their_ends() -> None:
    names = [Verbatim(f"Drawing 4711-0815 sheet 3 of the cover, balloon number {i}") for i in range(1, 21)]
    found = told_apart(names, NAMES_MM)
    assert len(set(map(str, found))) == len(names)
    assert all(str(one).endswith(f" {i}") for i, one in enumerate(found, start=1))


def test_other_names_are_cut_as_they_were() -> None:
    names = [
        Verbatim("A"),
        Verbatim("A"),
        Verbatim("one name that is far too long for the room that it has beside bars"),
    ]
    assert told_apart(names, NAMES_MM) == [narrowed(name, NAMES_MM) for name in names]


def test_few_values_are_all_drawn_and_the_caption_stays() -> None:
    assert np.array_equal(shown([np.arange(float(MOST))]), np.arange(MOST))
    assert told(say("Residuals."), 20, 20) == "Residuals."


def test_of_many_the_largest_of_each_series_and_what_is_flagged_are_drawn_and_no_more_than_the_most() -> None:
    random = np.random.default_rng(1)
    first, second, flagged = (
        random.standard_normal(50_000),
        random.standard_normal(50_000),
        np.zeros(50_000, dtype=bool),
    )
    flagged[[17, 40_000]] = True
    rows = shown([first, second], flagged)
    assert len(rows) == len(np.unique(rows)) == MOST
    assert {17, 40_000, int(np.argmax(np.abs(first))), int(np.argmin(second)), int(np.argmax(second))} <= set(
        rows.tolist()
    )
    assert np.diff(rows).max() < 100  # the others are spread over all


def test_every_picture_of_a_large_recording_says_how_many_it_draws_and_stays_small() -> None:
    count, random = 20_000, np.random.default_rng(2)
    values, words = random.standard_normal(count), {"caption": say("Residuals."), "alternative": say("a")}
    places = random.uniform(0, 500, (count, 3))
    pictures = (
        length_plot(np.arange(count), values, values, expanded_before_um=1.0, expanded_after_um=1.0,
                    reference=say("zero"), **words),
        volume_plot(places, values, **words),
        vector_plot(places[:, :2], [(say("Residuals"), places[:, 1:])], **words),
    )  # fmt: skip
    for picture in pictures:
        assert picture.caption.startswith(f"Residuals. Drawn are {MOST} of {count}")
        assert len(picture.svg) < 500_000


def test_of_few_that_are_drawn_half_are_the_largest() -> None:
    sizes = np.zeros(1000)
    sizes[[3, 500, 999]] = 5.0
    rows = shown([sizes], most=20)
    assert len(rows) == 20
    assert {3, 500, 999} <= set(rows.tolist())
