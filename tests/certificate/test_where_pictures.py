"""The pictures of where a mismatch lives: vectors to one scale, heads on what is longer than its U, the region shaded."""

from __future__ import annotations

from typing import Any

import numpy as np

from cmm_uq.analysis.diagnosis.location import ResidualField
from cmm_uq.base.messages import say
from cmm_uq.certificate.document import Plot
from cmm_uq.certificate.plots.style import ACCENT, BAND, DIVERGING, MUTED
from cmm_uq.certificate.plots.vectors import profile_plot, residual_field_plot
from tests.certificate.svg import Drawing, outlines, strokes

WORDS: dict[str, Any] = {"caption": say("c"), "alternative": say("a")}
BEFORE, AFTER = (say("Before"),), (say("Before"), say("After"))
PLACE = np.array([[0.0, 0, 0], [100, 0, 0], [0, 100, 0], [100, 100, 0], [50, 50, 0]])
VECTORS = np.array([[10.0, 0, 0], [0, 8, 0], [-6, 0, 0], [0, -1, 0], [1, 0, 0]])


def field(place: Any = PLACE, before: Any = VECTORS, *, lengths: bool = False) -> ResidualField:
    place, before = np.asarray(place, dtype=float), np.asarray(before, dtype=float)
    n = len(place)
    return ResidualField(place, before, 0.1 * before, np.ones(n), np.full(n, 2), lengths)


def picture(given: ResidualField, **how: Any) -> Plot:
    return residual_field_plot(given, np.full(len(given.place), 3.0), **({"titles": BEFORE} | WORDS | how))


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
    before = residual_field_plot(field(), np.full(5, 99.0), titles=AFTER, **WORDS)
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
        (x, y, np.full(9, 2.0)), data, (250.0, 400.0), x_label=say("X / mm"), y_label=say("e / µm"), **WORDS
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
