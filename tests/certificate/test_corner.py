"""The posterior's picture, against what is known of a normal distribution."""

from __future__ import annotations

import numpy as np
import pytest
from matplotlib.font_manager import FontProperties
from matplotlib.textpath import TextPath

from cmm_uq.base.errors import CmmUqError
from cmm_uq.certificate.plots.corner import corner_plot
from cmm_uq.certificate.plots.style import ACCENT, INK, MUTED, farthest_right
from tests.certificate.svg import Drawing, area, outlines, strokes

WORDS = {"caption": "Posterior.", "alternative": "a"}
NORMAL = np.random.default_rng(11).standard_normal((200_000, 2))
X = np.linspace(-6, 6, 400)
DENSITY = np.exp(-0.5 * X**2) / np.sqrt(2 * np.pi)


def test_contours_hold_95_and_50_percent() -> None:
    """The areas of a normal pair's regions are as the quantiles of χ² with two degrees of freedom, 5.991 and 1.386."""
    drawing = Drawing(corner_plot(NORMAL, ["a", "b"], **WORDS).svg)
    outer, inner = (
        area(drawing.drawn(fill=ACCENT, stroke=ACCENT, fill_opacity=alpha)[0]) for alpha in ("0.16", "0.34")
    )
    assert outer / inner == pytest.approx(5.991 / 1.386, rel=0.05)


def test_the_interval_is_shaded_about_the_estimate() -> None:
    plot = corner_plot(NORMAL[:, :1], ["a"], estimates=[0.5], intervals95=[[-1.0, 2.0]], **WORDS)
    drawing = Drawing(plot.svg)
    [shade] = [outlines(d)[0][:, 0] for d in drawing.drawn(fill=ACCENT)]
    [estimate] = [s[0, 0] for d in drawing.drawn(stroke=INK) for s in strokes(d) if np.ptp(s[:, 1]) > 20]
    assert (shade.min() + shade.max()) / 2 == pytest.approx(estimate, abs=0.02)
    [curve] = [outlines(d)[0] for d in drawing.drawn(stroke=ACCENT, fill="none")]
    sixth = curve[np.argmin(curve[:, 1]), 0]  # the mode, at zero
    assert (estimate - sixth) / np.ptp(shade) == pytest.approx(0.5 / 3.0, abs=0.05)


@pytest.mark.parametrize("text", ["12.5", "−3.10", "Scale X / 10⁻⁶", "Squareness YZ / ″", "C", "Ω%&@Sß 8", "ç∂é"])
@pytest.mark.parametrize("weight", ["normal", "bold"])
def test_words_are_as_wide_as_matplotlib_measures_them(text: str, weight: str) -> None:
    path = TextPath((0, 0), text, size=6.8, prop=FontProperties(family="DejaVu Sans", weight=weight))
    assert farthest_right(path) == pytest.approx(path.get_extents().x1, rel=1e-12)


def test_a_prior_is_drawn_to_the_posteriors_scale() -> None:
    """A prior that equals the posterior lies on it."""
    drawing = Drawing(corner_plot(NORMAL[:, :1], ["a"], priors={0: (X, DENSITY)}, **WORDS).svg)
    [prior] = [outlines(d)[0] for s, d in drawing.paths if "stroke-dasharray" in s and s.get("stroke") == MUTED]
    [posterior] = [outlines(d)[0] for d in drawing.drawn(stroke=ACCENT, fill="none")]
    high = [float(np.ptp(curve[:, 1])) for curve in (prior, posterior)]
    assert high[0] == pytest.approx(high[1], rel=0.04)


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
