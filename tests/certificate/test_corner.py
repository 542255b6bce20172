"""The picture of a posterior, and pictures of where residuals lie."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from matplotlib.font_manager import FontProperties
from matplotlib.textpath import TextPath

from cmm_uq.analysis.diagnosis.location import ResidualField
from cmm_uq.base.errors import CmmUqError
from cmm_uq.base.messages import say
from cmm_uq.certificate.document import Plot
from cmm_uq.certificate.plots.corner import corner_plot
from cmm_uq.certificate.plots.style import ACCENT, BAND, DIVERGING, INK, MUTED, farthest_right
from cmm_uq.certificate.plots.volume import profile_plot, residual_field_plot
from tests.certificate.svg import Drawing, area, outlines, strokes

WORDS = {"caption": "Posterior.", "alternative": "a"}
NORMAL = np.random.default_rng(11).standard_normal((200_000, 2))


def test_contours_hold_95_and_50_percent() -> None:
    """The areas of a normal pair's regions are as the quantiles of χ² with two degrees of freedom, 5.991 and 1.386."""
    drawing = Drawing(corner_plot(NORMAL, ["a", "b"], **WORDS).svg)
    outer, inner = (
        area(drawing.drawn(fill=ACCENT, stroke=ACCENT, fill_opacity=alpha)[0]) for alpha in ("0.16", "0.34")
    )
    assert outer / inner == pytest.approx(5.991 / 1.386, rel=0.05)


def test_the_interval_is_shaded_and_the_estimate_a_line() -> None:
    """From −1.96 to 1.96 about the mode, where the draws are normal; the line stands at 1."""
    drawing = Drawing(corner_plot(NORMAL[:, :1], ["a"], estimates=[1.0], **WORDS).svg)
    [shade] = [outlines(d)[0][:, 0] for d in drawing.drawn(fill=ACCENT)]
    [estimate] = [s[0, 0] for d in drawing.drawn(stroke=INK) for s in strokes(d) if np.ptp(s[:, 1]) > 20]
    middle = (shade.min() + shade.max()) / 2
    [curve] = [outlines(d)[0] for d in drawing.drawn(stroke=ACCENT, fill="none")]
    mode = curve[np.argmin(curve[:, 1]), 0]
    assert (middle - mode) / np.ptp(shade) == pytest.approx(0.0, abs=0.05)
    assert (estimate - middle) / np.ptp(shade) == pytest.approx(1.0 / 3.92, abs=0.02)


@pytest.mark.parametrize("text", ["12.5", "−3.10", "Scale X / 10⁻⁶", "Squareness YZ / ″", "C", "Ω%&@Sß 8", "ç∂é"])
@pytest.mark.parametrize("weight", ["normal", "bold"])
def test_words_are_as_wide_as_matplotlib_measures_them(text: str, weight: str) -> None:
    path = TextPath((0, 0), text, size=6.8, prop=FontProperties(family="DejaVu Sans", weight=weight))
    assert farthest_right(path) == pytest.approx(path.get_extents().x1, rel=1e-12)


def test_names_carry_their_units() -> None:
    texts = Drawing(corner_plot(NORMAL, ["Scale X", "k"], units=["ppm", ""], **WORDS).svg).texts
    assert {"Scale X / ppm", "k"} <= set(texts)


def test_tick_figures_tell_their_places_apart() -> None:
    draws = np.array([404.2357, 0.0]) + NORMAL[:4000] * np.array([0.0015, 1e4])
    texts = [text for text in Drawing(corner_plot(draws, ["a", "b"], **WORDS).svg).texts if text not in "ab"]
    lower = [text for text in texts if text.startswith("404")]
    assert len(lower) == len(set(lower)) >= 2


def test_of_too_many_parameters_the_most_correlated_are_shown_and_that_is_said() -> None:
    draws = np.random.default_rng(2).standard_normal((4000, 15))
    draws[:, 14] = draws[:, 0] + 0.1 * draws[:, 14]
    plot = corner_plot(draws, [f"p{k}" for k in range(15)], **WORDS)
    shown = [text for text in Drawing(plot.svg).texts if text.startswith("p")]
    assert len(shown) == 12
    assert {"p0", "p14"} <= set(shown)
    assert plot.caption == "Posterior. The 12 of 15 parameters that are correlated most are shown."


@pytest.mark.parametrize("dimension", [1, 3, 8, 12])
def test_its_size_is_modest(dimension: int) -> None:
    draws = np.random.default_rng(5).standard_normal((4000, dimension))
    svg = corner_plot(draws, [f"p{k}" for k in range(dimension)], **WORDS).svg
    assert len(svg) < 300_000


def test_a_parameter_that_never_moves_has_a_picture_too() -> None:
    assert corner_plot(np.column_stack([NORMAL[:500, 0], np.full(500, 3.0)]), ["a", "b"], **WORDS).svg


def test_no_draws_is_an_error() -> None:
    with pytest.raises(CmmUqError, match="at least two draws"):
        corner_plot(np.zeros((1, 2)), ["a", "b"], **WORDS)
    with pytest.raises(CmmUqError, match="not finite"):
        corner_plot(np.array([[1.0], [np.nan]]), ["a"], **WORDS)


LABELS: dict[str, Any] = {"caption": say("c"), "alternative": say("a")}
BEFORE, AFTER = (say("Before"),), (say("Before"), say("After"))
PLACE = np.array([[0.0, 0, 0], [100, 0, 0], [0, 100, 0], [100, 100, 0], [50, 50, 0]])
VECTORS = np.array([[10.0, 0, 0], [0, 8, 0], [-6, 0, 0], [0, -1, 0], [1, 0, 0]])


def field(place: Any = PLACE, before: Any = VECTORS, *, lengths: bool = False) -> ResidualField:
    place, before = np.asarray(place, dtype=float), np.asarray(before, dtype=float)
    n = len(place)
    return ResidualField(place, before, 0.1 * before, np.ones(n), np.full(n, 2), lengths)


def picture(given: ResidualField, **how: Any) -> Plot:
    return residual_field_plot(given, np.full(len(given.place), 3.0), **({"titles": BEFORE} | LABELS | how))


def heads(plot: Plot, colour: str) -> int:
    """Arrows, which alone are filled in the colour."""
    return len([style for style, _ in Drawing(plot.svg).paths if style.get("fill") == colour])


def test_what_is_longer_than_its_u_is_an_arrow_and_the_rest_a_thin_line() -> None:
    """Of 10, 8, 6, 1, 1 µm three exceed a U of 3 µm."""
    plot = picture(field())
    assert heads(plot, DIVERGING[-1]) == 3
    [thin] = [d for d in Drawing(plot.svg).drawn(stroke=MUTED, stroke_width="0.5") if len(outlines(d)) == 2]
    assert len(strokes(thin)) == 2


def test_before_and_after_are_magnified_alike_and_after_is_a_tenth() -> None:
    """Lines without heads: all after, where nothing exceeds U; the first before is as long as ten of it."""
    before = residual_field_plot(field(), np.full(5, 99.0), titles=AFTER, **LABELS)
    one, other = (d for d in Drawing(before.svg).drawn(stroke=MUTED, stroke_width="0.5") if len(outlines(d)) == 5)
    long, short = (np.diff(strokes(d), axis=1)[:, 0] for d in (one, other))
    np.testing.assert_allclose(short, 0.1 * long, atol=0.02)
    np.testing.assert_allclose(long[0] / 10.0, [long[0, 0] / 10.0, 0.0], atol=1e-9)
    assert long[0, 0] > 0  # towards plus X is to the right
    assert long[1, 1] < 0  # towards plus Y is up, which SVG counts downwards
    np.testing.assert_allclose(np.linalg.norm(long[1]) / np.linalg.norm(long[0]), 0.8, atol=0.01)


def test_a_flat_field_is_seen_from_above_alone_and_another_from_two_sides() -> None:
    assert [t for t in Drawing(picture(field()).svg).texts if t.endswith("/ mm")] == ["X / mm", "Y / mm"]
    tall = PLACE + [[0, 0, z] for z in (0, 40, 80, 20, 60)]
    texts = [t for t in Drawing(picture(field(tall)).svg).texts if t.endswith("/ mm")]
    assert texts[:2] == ["X / mm", "Y / mm"]
    assert texts[3] == "Z / mm"
    across = VECTORS[:, [2, 1, 0]]  # of a flat field whose vectors leave the plane
    assert "Z / mm" in Drawing(picture(field(before=across)).svg).texts


def test_the_region_is_shaded_across_the_axis_that_it_belongs_to() -> None:
    for axis, side in (("x", 0), ("y", 1)):
        shaded = Drawing(picture(field(), shade=(axis, 20.0, 60.0)).svg).drawn(fill=BAND)
        [box] = [outlines(d)[0] for d in shaded]
        whole = np.ptp(box, axis=0)
        assert whole[side] < whole[1 - side]
    assert not Drawing(picture(field(), shade=("z", 20.0, 60.0)).svg).drawn(fill=BAND)


def test_both_ends_of_a_length_are_drawn_and_the_length_between_them() -> None:
    ends = np.array([[0.0, 0, 0], [100, 0, 0], [0, 50, 0], [100, 90, 0]])
    found = field(ends, [[-5.0, 0, 0], [5, 0, 0], [0, 0, 0], [0, 0, 0]], lengths=True)
    assert heads(picture(found), DIVERGING[-1]) == 2
    many = np.tile(ends, (1000, 1)) + np.repeat(np.arange(1000.0), 4)[:, None]
    plot = picture(field(many, np.tile(found.before, (1000, 1)), lengths=True))
    assert "Drawn are 3000 of 4000" in plot.caption  # fifteen hundred lengths, both ends of each


def test_the_profile_has_its_band_above_and_each_observation_over_the_range_of_its_points_below() -> None:
    x = np.linspace(0, 400, 9)
    y = 5.0 - x / 40
    data = (np.array([10.0, 50.0, 300.0]), np.array([110.0, 50.0, 380.0]), np.array([4.0, 1.0, -3.0]))
    plot = profile_plot(
        (x, y, np.full(9, 2.0)), data, (250.0, 400.0), x_label=say("X / mm"), y_label=say("e / µm"), **LABELS
    )
    drawing = Drawing(plot.svg)
    [curve] = [d for d in drawing.drawn(stroke=ACCENT) if len(outlines(d)[0]) == 9]
    points = outlines(curve)[0]
    assert np.abs(np.diff(points, n=2, axis=0)).max() < 0.03  # the straight line that it is
    assert points[-1, 1] > points[0, 1]  # falling
    [spans] = drawing.drawn(stroke=DIVERGING[-1], stroke_width="0.6")
    wide = strokes(spans)
    assert len(wide) == 2  # what lies at one reading has no range
    per_mm = (points[-1, 0] - points[0, 0]) / 400.0
    np.testing.assert_allclose(np.diff(wide[:, :, 0], axis=1)[:, 0], per_mm * np.array([100.0, 80.0]), atol=0.03)
    boxes = [outlines(d)[0] for d in drawing.drawn(fill=BAND)]
    assert len(boxes) == 2
    for box in boxes:
        np.testing.assert_allclose(np.ptp(box[:, 0]), 150.0 * per_mm, atol=0.03)
