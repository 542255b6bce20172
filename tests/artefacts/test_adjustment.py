"""What a technician turns sets the axes upright: the unit vectors, by Cholesky, turned by rotation matrices."""

from __future__ import annotations

import re
from itertools import permutations

import numpy as np
import pytest
from hypothesis import given, settings, strategies as st
from scipy import stats
from scipy.spatial.transform import Rotation

from cmm_uq.artefacts.adjustment import AdjustmentSetting, adjustments, turns
from cmm_uq.artefacts.ballbar import results
from cmm_uq.base.messages import NOTHING
from cmm_uq.base.units import unit
from cmm_uq.certificate.document import Paragraph
from cmm_uq.machine.physics.kinematics import KinematicChain, exact
from cmm_uq.maths.uncertainty.quantity import Quantity
from tests.artefacts.reading import number
from tests.artefacts.simulated import SQUARE, analysed, blocks, recovered, table

ARCSEC = np.pi / 180 / 3600
DEGREES = st.floats(-5.0, 5.0)
CHAINS = [f"{a[:frame]}F{a[frame:]}" for a in map("".join, permutations("XYZ")) for frame in range(4)]
SENTENCE = re.compile(r"Guide of ([XYZ]): turn about \+([XYZ]) by")


def carried_by(guide: str, chain: str) -> set[str]:
    """A guide and what stands on it: on the probe's side of the frame what comes after it, on the workpiece's what before."""
    below, _, above = chain.partition("F")
    return set(above[above.index(guide) :] if guide in above else below[: below.index(guide) + 1])


def guides_at(squareness) -> dict[str, np.ndarray]:
    """Unit vectors that enclose 90° + S, by Cholesky."""
    xy, yz, zx = np.cos(np.pi / 2 + np.asarray(squareness))
    return dict(zip("XYZ", np.linalg.cholesky(np.array([[1, xy, zx], [xy, 1, yz], [zx, yz, 1]])), strict=True))


def turned(guides: dict[str, np.ndarray], squareness, chain: str) -> dict[str, np.ndarray]:
    """The machine after what its technician is told, in the order told: each turn takes along whatever stands on the guide.

    The named axes are those of the machine when it is done: the axis that stays, and that in the plane of the second.
    """
    stays, second, third = map(str.upper, KinematicChain.of(chain).from_frame)
    a = guides[stays]
    b = guides[second] - (guides[second] @ a) * a
    b /= np.linalg.norm(b)
    c = np.cross(a, b) if stays + second + third in "XYZXY" else np.cross(b, a)
    named = {stays: a, second: b, third: c}
    told = [SENTENCE.fullmatch(str(what)) for what, _ in list(adjustments(KinematicChain.of(chain)).values())[3:]]
    for sentence, angle in zip(told, turns(np.asarray(squareness), KinematicChain.of(chain)), strict=True):
        guide, about = sentence.groups()
        turn = Rotation.from_rotvec(angle * named[about])
        guides = {axis: turn.apply(v) if axis in carried_by(guide, chain) else v for axis, v in guides.items()}
    return guides


@pytest.mark.parametrize("chain", CHAINS)
@settings(max_examples=20)
@given(st.tuples(DEGREES, DEGREES, DEGREES))
def test_the_turns_make_the_axes_of_every_chain_square(chain: str, degrees) -> None:
    squareness = np.radians(degrees)
    axes = np.array(list(turned(guides_at(squareness), squareness, chain).values()))
    np.testing.assert_allclose(axes @ axes.T, np.eye(3), atol=1e-12)
    assert np.linalg.det(axes) > 0


@pytest.mark.parametrize("chain", CHAINS)
def test_an_adjusted_machine_of_every_chain_measures_without_error(chain: str) -> None:
    """By the exact kinematics: the machine of −174″, 5 arcminutes and 3° reads every place as it is, but for its attitude."""
    before = np.radians([-174 / 3600, 5 / 60, 3.0])
    axes = turned(guides_at(before), before, chain)
    after = np.array([np.arccos(axes[a] @ axes[b]) - np.pi / 2 for a, b in ("XY", "YZ", "ZX")])
    readings = np.random.default_rng(1).uniform(-500, 500, (20, 3))
    perfect = np.zeros((20, 3, 6))
    np.testing.assert_allclose(exact(readings, perfect, after, chain=chain), 0, atol=1e-9)
    assert np.abs(exact(readings, perfect, before, chain=chain)).max() > 10


def test_what_carries_all_stays_where_it_is() -> None:
    """Where X rides on Y, turning Y would turn both: X is turned, the other way round."""
    assert ["".join(KinematicChain.of(chain).from_frame) for chain in ("XYZ", "YXZ", "YFXZ", "XYFZ", "ZXY", "ZYXF")] == [
        "xyz", "yxz", "xyz", "yxz", "zxy", "xyz",
    ]  # fmt: skip
    xy = ARCSEC * np.array([100.0, 0.0, 0.0])
    np.testing.assert_allclose(turns(xy, KinematicChain.of("XYZ")) / ARCSEC, [-100, 0, 0], atol=1e-9)
    np.testing.assert_allclose(turns(xy, KinematicChain.of("YXZ")) / ARCSEC, [100, 0, 0], atol=1e-9)
    told = [str(what) for what, _ in list(adjustments(KinematicChain.of("YXZ")).values())[3:]]
    assert told == ["Guide of X: turn about +Z by", "Guide of Z: turn about +Y by", "Guide of Z: turn about +X by"]


def test_small_angles_are_turned_back_by_themselves() -> None:
    found = turns(ARCSEC * np.array([3.0, 2.0, 1.0]), KinematicChain.of("XYZ")) / ARCSEC
    np.testing.assert_allclose(found, [-3.0, -2.0, 1.0], atol=1e-4)


def test_a_product_of_angles_matters_where_z_stands_on_its_own() -> None:
    """1500″ twice: 1500″² is 10.9″ about X, which a ram that rides on the bridge does not show, but shows about Y."""
    squareness = ARCSEC * np.array([1500.0, 0.0, 1500.0])
    assert turns(squareness, KinematicChain.of("YFXZ"))[1] / ARCSEC == pytest.approx(-10.9, abs=0.05)
    assert turns(squareness, KinematicChain.of("XYZ"))[1] / ARCSEC == pytest.approx(0, abs=0.1)


@pytest.mark.parametrize(
    ("chain", "rides"),
    [("XYZ", True), ("YXZ", True), ("ZXY", False), ("YFXZ", False), ("ZYFX", True), ("YZFX", False), ("XFYZ", True)],
)
def test_the_ram_rides_on_the_carriage_that_carries_it(chain: str, rides: bool) -> None:
    assert KinematicChain.of(chain).rides("z", on="y") is rides


@pytest.mark.parametrize(
    ("ends", "beyond"),
    [((-1.0, 0.5), False), ((0.5, 2.0), True), ((-2.0, -0.5), True), ((-1.0, 0.0), False), ((0.0, 1.0), False)],
)
def test_a_setting_is_beyond_doubt_where_its_interval_leaves_zero_out(
    ends: tuple[float, float], *, beyond: bool
) -> None:
    figure = Quantity(sum(ends) / 2, 1.0, ends, unit("ppm"))
    assert AdjustmentSetting("scale_x", NOTHING, "ppm", figure, None).beyond_doubt is beyond


WHAT = "What to turn and what to enter"
SECOND_WAY = "The six factors by the distance equations, a second way"


def test_the_real_machine_is_told_what_to_turn() -> None:
    """Squareness XY −174″: the angle X–Y is 174″ short of 90°, so Y turns by +174″ about +Z, 465 µm over 550 mm."""
    rows = {row[0]: row for row in table("iota-1102-20C", WHAT).rows}
    guide = rows["Guide of Y: turn about +Z by"]
    assert guide[1:4] == ("174", "16", "″")
    assert guide[4] == "465"
    assert guide[5] == "yes"
    assert rows["Scale of Z: lengthen what it reads by"][5] == ""


def test_distance_equations_and_model_agree_on_the_real_recording() -> None:
    for name, by_equations, U, _, by_model, *_ in table("iota-1102-20C", SECOND_WAY).rows:
        assert abs(number(by_equations) - number(by_model)) <= 0.1 * number(U), name


def test_distance_equations_are_as_uncertain_as_least_squares_under_white_noise() -> None:
    """The certificate of the bar is part of both: u of the residuals and 5 µm on 404 mm; k is of t."""
    result = analysed("iota-1102-20C")
    found = results(result)["distance_equations"]["factors"]
    squares = result.least_squares
    freedom = squares.degrees_of_freedom
    for unknown, variance in zip(squares.unknowns[:6], np.diag(squares.covariance), strict=False):
        one = found[unknown.key[0]][unknown.key[1]]
        assert one["u"] == pytest.approx(float(np.sqrt(variance)), rel=1e-3), unknown.key
        certificate = 5.0 / 404.2357e-3 / one["u"] if unknown.unit == "ppm" else 0.0
        effective = freedom / (1 - certificate**2) ** 2  # JCGM 100, G.2b
        assert one["k"] == pytest.approx(stats.t.ppf(0.975, np.floor(effective)), rel=1e-6), unknown.key
        assert one["U"] == pytest.approx(one["k"] * one["u"])


def test_an_uncalibrated_bar_gives_no_scale_to_enter() -> None:
    rows = table("bryan-simulated", WHAT).rows
    assert [row[0] for row in rows] == [
        "Guide of Y: turn about +Z by", "Guide of Z: turn about +X by", "Guide of Z: turn about +Y by",
    ]  # fmt: skip
    second = table("bryan-simulated", SECOND_WAY).rows
    assert [row[4] for row in second[:3]] == ["not determined"] * 3
    assert [row[1] == "not determined" for row in second] == [True] * 3 + [False] * 3
    notes = [block.text for block in blocks("iota-1102-20C-compensated") if isinstance(block, Paragraph)]
    assert any("The length of the bar is not certified" in note for note in notes)


def test_the_joint_fit_finds_what_two_steps_lose() -> None:
    """Swept over half a sphere: Z–X was simulated as 4″, the second step has a quarter of it, and U says so."""
    recovered("bryan-simulated", SQUARE)
    rows = {row[0]: row for row in table("bryan-simulated", SECOND_WAY).rows}
    _, two_steps, U, _, joint, *_ = rows["Angle Z–X − 90°"]
    assert abs(number(joint) - 4.0) + 2 < abs(number(two_steps) - 4.0) < number(U)
    _, two_steps, U, _, joint, *_ = rows["Angle Y–Z − 90°"]
    assert abs(number(joint) + 7.5) + 2 < abs(number(two_steps) + 7.5) < number(U)
