"""Pictures of a part: what stands where, to which scale, and whether they say so."""

from __future__ import annotations

import re

import numpy as np
import pytest

from cmm_uq.analysis.parts.budget import PointErrors
from cmm_uq.analysis.parts.plan import PartPose, Plan, Stylus
from cmm_uq.base.messages import Verbatim, number, say
from cmm_uq.base.points import Floats
from cmm_uq.certificate.part import pictures as views
from cmm_uq.certificate.part.pictures import (
    ABOVE,
    FRONT,
    MOST,
    OBLIQUE,
    SIDE,
    VIEWS,
    errors_picture,
    form_picture,
    panels,
    part_picture,
)
from cmm_uq.certificate.part.plots import A_PAGE, Margin, correlation_plot, margin_plot, margin_plots, shares_plots
from cmm_uq.certificate.plots.style import WIDTH_MM, house_style
from cmm_uq.certificate.plots.volume import _seen
from tests.certificate.saying import leaves
from tests.parts_drawn import UP, bore, plane

PLATE = Plan(
    (plane("A", UP, [0.0, 0.0, 0.0], [[120.0, 0, 0], [0, 80.0, 0]]), bore("b", [60.0, 40.0, 0.0], 15.0)), (),
    (Stylus("stylus", np.array([0.0, 30.0, -150.0]), 4.0),),
)  # fmt: skip


def paths(svg: str, colour: str) -> list[Floats]:
    """Coordinates (n, 2) of each path of a colour, pt from the top left."""
    found = re.findall(rf'<path d="([^"]*)"[^>]*(?:stroke|fill): {colour}', svg)
    return [np.array(re.findall(r"-?[\d.]+", path), dtype=float).reshape(-1, 2) for path in found]


def test_views_show_what_a_drawing_shows() -> None:
    """A point to the right, behind and above: seen from above, from the front, from the right."""
    point = np.array([3.0, 5.0, 7.0])
    assert ABOVE.of(point).tolist() == [3, 5]
    assert FRONT.of(point).tolist() == [3, 7]
    assert SIDE.of(point).tolist() == [5, 7]
    np.testing.assert_allclose(OBLIQUE.of(point), _seen(point[None])[0])
    assert [view.along.round(9).tolist() for view in (ABOVE, FRONT, SIDE)] == [[0, 0, 1], [0, -1, 0], [1, 0, 0]]


@pytest.mark.parametrize("view", VIEWS, ids=lambda view: str.__str__(view.name))
def test_one_looks_along_what_a_view_does_not_show(view: views.View) -> None:
    np.testing.assert_allclose(view.of(view.along), 0, atol=1e-12)


def test_a_spread_is_seen_as_it_is_projected() -> None:
    """Of draws, against the covariance of their projections."""
    root = np.array([[1.0, 0, 0], [0.5, 2.0, 0], [-0.3, 0.2, 0.7]])
    draws = np.random.default_rng(1).standard_normal((200_000, 3)) @ root.T
    for view in VIEWS:
        np.testing.assert_allclose(view.spread(root @ root.T), np.cov(view.of(draws).T), atol=0.05)


@pytest.mark.parametrize("spans", [(120.0, 80.0, 20.0), (1.0, 900.0, 3.0), (5.0, 5.0, 400.0), (0.0, 0.0, 0.0)])
def test_panels_are_to_one_scale_and_views_stand_below_each_other(spans: tuple[float, float, float]) -> None:
    corners = np.array([[0.0, 0, 0], spans])
    with house_style():
        figure, found = panels(corners, 0.05, 0.0)
        width, height = figure.get_size_inches() * 25.4
        scales, boxes = [], {}
        for view, ax in found:
            box = ax.get_position()
            boxes[str.__str__(view.name)] = box
            scales += [box.width * width / np.ptp(ax.get_xlim()), box.height * height / np.ptp(ax.get_ylim())]
        assert width == pytest.approx(WIDTH_MM)
        np.testing.assert_allclose(scales, scales[0])
        above, front, side = (boxes[name] for name in ("From above", "From the front", "From the right"))
        assert above.x0 == front.x0
        assert front.y0 == side.y0
        assert above.y0 > front.y1
        assert side.x0 > front.x1
        assert all(box.x0 > 0 and box.x1 <= 1 and box.y0 > 0 and box.y1 < 1 for box in boxes.values())
        assert found[0][1].get_xlim() == pytest.approx(found[2][1].get_xlim())


def test_every_point_its_normal_and_its_stylus_are_drawn() -> None:
    plot = part_picture(PLATE, PartPose(), [Verbatim("A"), Verbatim("b")])
    count = len(PLATE.points)
    accent = paths(plot.svg, "#0b5c7a")
    assert sum(len(path) == 2 * count for path in accent) == 2 * len(VIEWS)  # normals and dots, each a path a view
    assert [len(path) for path in paths(plot.svg, "#a84e08")] == [2 * len(PLATE.features)] * len(VIEWS)
    assert plot.caption.startswith(f"The part as it is probed, {count} points")
    assert {"A", "b"} <= set(leaves(plot))


def test_a_stylus_goes_up_from_its_tip_to_the_ram() -> None:
    """In the view from the front straight up, from the right to the left: the tip is 30 mm behind the ram's point."""
    plot = part_picture(PLATE, PartPose(), [Verbatim("A"), Verbatim("b")])
    _, _, front, side = paths(plot.svg, "#a84e08")
    for stem in (front[:2], front[2:]):
        assert stem[0, 0] == pytest.approx(stem[1, 0], abs=0.02)
        assert stem[1, 1] < stem[0, 1]
    rise, run = side[0, 1] - side[1, 1], side[1, 0] - side[0, 0]
    assert run / rise == pytest.approx(-30 / 150, abs=0.01)


def test_a_part_that_is_turned_in_the_machine_is_reached_from_there() -> None:
    """On its side: what is up in the machine is y of the part, so that the stylus from behind the ram comes along −z."""
    turned = PartPose(np.array([[1.0, 0, 0], [0, 0, -1.0], [0, 1.0, 0]]))
    _, _, _, side = paths(part_picture(PLATE, turned, [Verbatim("A"), Verbatim("b")]).svg, "#a84e08")
    assert side[1, 0] > side[0, 0]
    assert (side[1, 0] - side[0, 0]) / (side[0, 1] - side[1, 1]) == pytest.approx(150 / 30, abs=0.05)


def errors(mean_um: Floats, sd_um: Floats) -> PointErrors:
    covariance = 1e-6 * np.einsum("ni,ij->nij", sd_um**2, np.eye(3))
    return PointErrors(1e-3 * mean_um, covariance)


def test_ellipses_and_arrows_are_magnified_as_the_caption_says() -> None:
    """Half axes of 2 and 1 µm in x and y about an arrow of 3 µm in x; by the caption's factor on the picture's scale."""
    n = len(PLATE.points)
    plot = errors_picture(PLATE, errors(np.tile([3.0, 0, 0], (n, 1)), np.tile([2.0, 1.0, 0.5], (n, 1))))
    times = float(re.search(r"magnified ([\d.e+]+) times", plot.caption)[1])  # type: ignore[index]
    ring = next(path for path in paths(plot.svg, "#0b5c7a") if len(path) > 100)[:21]
    wide, high = np.ptp(ring, axis=0)
    assert wide / high == pytest.approx(2.0, rel=0.03)
    dots = next(path for path in paths(plot.svg, "#5a666e") if len(path) == 2 * n)
    scale = np.ptp(dots[:, 0]) / 120.0  # pt a mm of the part, whose points span 120 mm
    assert wide / scale == pytest.approx(2 * 2e-3 * times, rel=0.03)
    middle = 0.5 * (ring.max(axis=0) + ring.min(axis=0))
    offsets = (middle - dots)[:, 0] / scale
    assert np.abs(offsets - 3e-3 * times).min() < 0.05 * 3e-3 * times


def test_the_largest_errors_are_told_to_who_cannot_see_them() -> None:
    n = len(PLATE.points)
    plot = errors_picture(PLATE, errors(np.tile([3.0, 0, 4.0], (n, 1)), np.tile([2.0, 1.0, 0.5], (n, 1))))
    assert "mean errors of up to 5.0 µm, standard uncertainties of up to 2.0 µm" in plot.alternative


def test_nothing_that_errs_is_a_picture_all_the_same() -> None:
    n = len(PLATE.points)
    assert "up to 0 µm" in errors_picture(PLATE, errors(np.zeros((n, 3)), np.zeros((n, 3)))).alternative


def test_form_goes_out_of_the_material_where_it_is_positive() -> None:
    """A bump of 4 µm on the plane stands up in the view from the front, a dent of 2 µm half as far down."""
    deviations = np.full(len(PLATE.points), np.nan)
    deviations[:16] = 0.0
    deviations[0], deviations[1] = 4e-3, -2e-3
    plot = form_picture(PLATE, deviations)
    assert plot.alternative.endswith("−2.0 to 4.0 µm.")
    bumps = paths(plot.svg, "#0b5c7a")[::2][2].reshape(-1, 2, 2)  # of each view lines, then dots
    (dent,) = paths(plot.svg, "#a84e08")[::2][2].reshape(-1, 2, 2)
    rise, fall = (bumps[:, 0] - bumps[:, 1])[:, 1], (dent[1] - dent[0])[1]
    assert fall > 0
    assert rise.max() == pytest.approx(2 * fall, abs=0.05)
    assert sorted(rise.round(2))[:-1] == [0.0] * 14


@pytest.mark.parametrize(("margin", "places"), [
    (Margin(say("a"), 10.02, (10.01, 10.03), 9.9, 10.1, "pass"), (0.6, 0.55, 0.65)),
    (Margin(say("b"), 0.02, (0.0, 0.04), 0.0, 0.1, "pass"), (0.2, 0.0, 0.4)),
    (Margin(say("c"), 9.98, (9.93, 10.03), None, 10.0, "undecided"), (0.9, 0.65, 1.15)),
    (Margin(say("d"), 5.1, (5.0, 5.2), 5.0, None, "undecided"), (0.25, 0.0, 0.5)),
])  # fmt: skip
def test_values_stand_between_their_limits(margin: Margin, places: tuple[float, float, float]) -> None:
    """Of one limit the row is two intervals long, or as long as the value needs."""
    found = [margin.of(value) for value in (margin.value, *margin.interval)]
    np.testing.assert_allclose(found, places, atol=1e-9)


def test_a_picture_counts_what_conforms() -> None:
    rows = [Margin(say("a"), 1.0, (0.9, 1.1), 0.0, 2.0, outcome) for outcome in
            ("pass", "pass", "conditional pass", "fail", "undecided")]  # fmt: skip
    told = margin_plot(rows).alternative
    assert told == "5 characteristics against their limits: 3 conform, 1 do not, 1 are undecided."


def test_without_measured_points_it_says_how_much_of_the_tolerance_is_taken() -> None:
    plot = margin_plot(
        [Margin(say("a"), 1.0, (0.9, 1.1), 0.0, 2.0, None), Margin(say("b"), 1.0, (0.7, 1.3), 0.0, 2.0, None)]
    )
    assert plot.alternative == "2 characteristics; the 95 % interval takes up to 30 % of what is allowed."


def test_forty_rows_are_a_picture() -> None:
    rows = [Margin(number(i), 1.0, (0.9, 1.1), 0.0, 2.0, "pass") for i in range(A_PAGE + 1)]
    assert [plot.caption[-len("Part 1 of 2.") :] for plot in margin_plots(rows)] == ["Part 1 of 2.", "Part 2 of 2."]
    assert margin_plots([]) == []


def test_shares_are_lettered_and_told_by_their_size() -> None:
    names, causes = [say("one"), say("other")], [say("Noise"), say("Stylus"), say("Form")]
    (plot,) = shares_plots(names, causes, np.array([[0.7, 0.02], [0.3, 0.18], [0.0, 0.8]]))
    assert plot.alternative == "one: noise 70 %, stylus 30 %; other: form 80 %, stylus 18 %, noise 2 %"
    assert re.findall(r">(\d+)</text>", plot.svg) == ["70", "30", "18", "80"]


def test_correlations_are_counted_and_the_largest_is_named() -> None:
    r = np.eye(4)
    r[2, 0] = r[0, 2] = -0.83
    r[3, 1] = r[1, 3] = 0.4
    r[3, 2] = r[2, 3] = 0.05
    plot = correlation_plot([number(i + 1) for i in range(4)], r)
    assert plot.alternative == "2 of 6 correlations are 0.1 or larger in size; the largest, −0.83, is between 1 and 3."
    assert len(paths(plot.svg, "#0b5c7a")) == len(paths(plot.svg, "#a84e08")) == 1


def test_of_very_many_points_the_largest_errors_are_drawn_and_the_caption_says_how_many() -> None:
    many = Plan((plane("A", UP, [0.0, 0.0, 0.0], [[120.0, 0, 0], [0, 80.0, 0]], (20, 20)),), ())
    mean = np.zeros((400, 3))
    mean[137] = [0.0, 0.0, 9.0]
    plot = errors_picture(many, errors(mean, np.ones((400, 3))))
    assert f"Drawn are {MOST} of 400" in plot.caption
    arrows = [path for path in re.findall(r'<path d="([^"]*)"[^>]*fill: #a84e08', plot.svg) if len(path) > 20]
    assert len(arrows) == len(VIEWS)
