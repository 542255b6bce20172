"""Pictures without their colours: what differs still differs, and every ink is dark enough on white."""

from __future__ import annotations

import re
from typing import Any

import numpy as np
import pytest

from cmm_uq.base.messages import say
from cmm_uq.certificate.document import Plot
from cmm_uq.certificate.plots.residuals import length_plot, tolerance_plot, trumpet, volume_plot
from cmm_uq.certificate.plots.style import ACCENT, BAND, DIVERGING, INK, MUTED
from tests.certificate.svg import Drawing, outlines

WORDS: dict[str, Any] = {"caption": say("c"), "alternative": say("a")}
COLOUR = re.compile(r"#[0-9a-fA-F]{6}\b")


def luminance(colour: str) -> float:
    """Relative luminance by WCAG 2."""
    parts = np.array([int(colour[i : i + 2], 16) / 255 for i in (1, 3, 5)])
    linear = np.where(parts <= 0.04045, parts / 12.92, ((parts + 0.055) / 1.055) ** 2.4)
    return float(linear @ [0.2126, 0.7152, 0.0722])


def grey(plot: Plot) -> Drawing:
    """The picture in the greys of its colours' luminance, white kept white."""

    def of(colour: re.Match[str]) -> str:
        return "#" + 3 * f"{round(255 * luminance(colour[0])):02x}"

    return Drawing(COLOUR.sub(of, plot.svg))


def errors(outside: list[bool]) -> Plot:
    length = np.linspace(20.0, 800.0, len(outside))
    return trumpet(
        length, np.linspace(-2, 2, len(outside)), limit_um=2.5 + length / 300, acceptance_um=list(2.0 + length / 300),
        expanded_um=np.full(len(outside), 0.3), outside=outside, quantity=say("Error / µm"), **WORDS,
    )  # fmt: skip


@pytest.mark.parametrize("ink", [INK, MUTED, ACCENT, DIVERGING[0], DIVERGING[-1]])
def test_every_ink_has_the_contrast_of_text_on_white_and_on_the_band(ink: str) -> None:
    """4.5 : 1 on white (WCAG AA); 3 : 1 on the band, as graphics need."""
    assert 1.05 / (luminance(ink) + 0.05) >= 4.5
    assert (luminance(BAND) + 0.05) / (luminance(ink) + 0.05) >= 3.0


def test_errors_that_are_not_accepted_are_crosses_and_not_dots() -> None:
    """Two of nine: two marks by reference, and seven strokes of no length."""
    plain, with_two = grey(errors([False] * 9)), grey(errors([False] * 7 + [True] * 2))
    assert len(with_two.marks) - len(plain.marks) == 2

    def round_dots(drawing: Drawing) -> int:
        return sum(len(outlines(d)) for d in drawing.drawn(stroke_linecap="round"))

    assert round_dots(plain) - round_dots(with_two) == 2


def test_the_limits_are_solid_and_those_of_acceptance_dashed() -> None:
    drawing = grey(errors([False] * 9))
    dashed = [style for style, _ in drawing.paths if "stroke-dasharray" in style]
    solid = [
        style for style, d in drawing.paths if "stroke-dasharray" not in style and style.get("fill") == "none" and d
    ]
    assert len(dashed) == 2
    assert solid


def test_lengths_before_the_model_are_rings_and_after_it_full_dots() -> None:
    drawing = grey(
        length_plot(np.arange(1, 21), np.linspace(-9, 9, 20), np.linspace(-1, 1, 20), expanded_before_um=1.0,
                    expanded_after_um=1.0, reference=say("zero"), **WORDS)
    )  # fmt: skip
    hollow = [d for d in drawing.drawn(stroke="#ffffff", stroke_linecap="round") if len(outlines(d)) == 20]
    all_dots = [d for d in drawing.drawn(stroke_linecap="round") if len(outlines(d)) == 20]
    assert len(hollow) == 1
    assert len(all_dots) == 3


def test_the_sign_of_a_residual_is_a_full_or_a_hollow_dot() -> None:
    start = np.array([[0.0, 0, 0], [100.0, 100, 100]])
    both = volume_plot(start, [5.0, -5.0], **WORDS)
    plus = volume_plot(start, [5.0, 5.0], **WORDS)
    assert len(grey(both).drawn(stroke="#ffffff", stroke_linecap="round")) == 3
    assert not grey(plus).drawn(stroke="#ffffff", stroke_linecap="round")


def test_a_parameter_outside_its_tolerance_is_a_cross() -> None:
    names = [say("one"), say("two")]
    inside = grey(tolerance_plot(names, [0.2, 0.5], [0.1, 0.4], [0.3, 0.6], **WORDS))
    outside = grey(tolerance_plot(names, [0.2, 2.0], [0.1, 1.5], [0.3, 2.5], **WORDS))
    assert "cross: outside" in " ".join(outside.texts)
    assert len(outside.marks) == len(inside.marks) + 1
