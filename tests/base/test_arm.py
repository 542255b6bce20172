"""Where the tool of an arm is: against published and outside forward kinematics, and its derivatives against differences."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.testing import assert_allclose

from cmm_uq.base.arm import Arm
from cmm_uq.base.errors import CmmUqError
from cmm_uq.base.points import Floats

RIGHT = np.pi / 2
Q6 = [
    [
        52.42563825447033,
        52.94130027008807,
        2.635605857601787,
        -36.84118622691194,
        -76.66175298850415,
        -20.05352282957881,
    ],
    [
        -15.75633936609764,
        -78.1514432558443,
        -77.57848546071347,
        85.82907771059732,
        26.184171237478623,
        -45.60744049241353,
    ],
]
Q7 = [[*Q6[0], -15.75633936609764], [-78.1514432558443, -77.57848546071347, 85.82907771059732, 26.184171237478623,
                                     -45.60744049241353, -11.172677005051053, 81.53189424711614]]  # fmt: skip


def arm_of(
    rows: list[list[float]], *, prismatic: int | None = None, modified: bool = False, tool: Floats | None = None
) -> Arm:
    """An arm of rows a, α, d, θ."""
    joints = len(rows)
    return Arm(
        "arm", rows=np.hstack([np.array(rows, dtype=np.float64), np.zeros((joints, 1))]), sense=np.ones(joints),
        revolute=np.arange(joints) != prismatic, modified=modified, tool_mm=np.zeros(3) if tool is None else tool,
    )  # fmt: skip


PUMA = arm_of([[0, RIGHT, 671.83, 0], [431.8, 0, 0, 0], [20.3, -RIGHT, 150.05, 0], [0, RIGHT, 431.8, 0], [0, -RIGHT, 0, 0],
               [0, 0, 0, 0]])  # fmt: skip
UR5 = arm_of([[0, RIGHT, 89.459, 0], [-425, 0, 0, 0], [-392.25, 0, 0, 0], [0, RIGHT, 109.15, 0], [0, -RIGHT, 94.65, 0],
              [0, 0, 82.3, 0]])  # fmt: skip
STANFORD = arm_of([[0, -RIGHT, 412, 0], [0, RIGHT, 154, 0], [20.3, 0, 0, -RIGHT], [0, -RIGHT, 0, 0], [0, RIGHT, 0, 0],
                   [0, 0, 0, 0]], prismatic=2)  # fmt: skip
PANDA = arm_of([[0, 0, 333, 0], [0, -RIGHT, 0, 0], [0, RIGHT, 316, 0], [82.5, RIGHT, 0, 0], [-82.5, -RIGHT, 384, 0],
                [0, RIGHT, 0, 0], [88, RIGHT, 107, 0]], modified=True, tool=np.array([0, 0, 103.0]))  # fmt: skip


@pytest.mark.parametrize(("arm", "readings", "places"), [
    (PUMA, Q6, [[67.40087186048439, -158.46520843997232, 1277.2559185291723],
                [197.58938558063335, -211.65779213954838, -152.7507288098326]]),
    (UR5, Q6, [[-125.05369462590448, -372.6679990560377, -637.1728520198603],
               [112.91074025913389, -222.00682765799695, 668.2114012567715]]),
    (STANFORD, [[*Q6[0][:2], 46.0, *Q6[0][3:]], [*Q6[1][:2], -1354.0, *Q6[1][3:]]],
     [[-83.58090566583449, 110.62306291681217, 439.72111395636705],
      [1311.6648398442442, -231.16453114590325, 133.98921341705372]]),
    (PANDA, Q7, [[283.61866968936675, 360.11105194123553, 537.9451596168295],
                 [-121.92333938685535, 404.9721833056419, 456.5944916804878]]),
], ids=["PUMA 560", "UR5", "Stanford", "Panda"])  # fmt: skip
def test_the_tool_is_where_an_outside_package_has_it(
    arm: Arm, readings: list[list[float]], places: list[list[float]]
) -> None:
    """Places by Robotics Toolbox for Python 1.4.4 (Corke, Haviland 2021), whose rows these are: standard and modified."""
    assert_allclose(arm.at(np.array(readings)).tool, places, rtol=0, atol=1e-9)


def test_an_arm_stretched_out_is_as_long_as_its_links() -> None:
    """UR5 at zero lies along −x: a₂ + a₃ = −817.25, d₄ + d₆ = 191.45 across, d₁ − d₅ = −5.191 up."""
    assert_allclose(UR5.at(np.zeros((1, 6))).tool, [[-817.25, -191.45, -5.191]], atol=1e-9)


@pytest.mark.parametrize("modified", [False, True])
def test_the_jacobian_is_the_derivative_of_every_parameter(modified: bool) -> None:
    random = np.random.default_rng(1)
    arm = Arm(
        "arm", rows=PUMA.rows + random.normal(0, 0.1, (6, 5)), revolute=np.arange(6) != 2, modified=modified,
        sense=np.array([1.0, -1, 1, -1, 1, 1]), tool_mm=np.array([10.0, 20, 30]),
    )  # fmt: skip
    q, step = random.uniform(-90, 90, (5, 6)), 1e-4
    J = arm.at(q).jacobian
    for k in range(33):
        change = np.zeros(33)
        change[k] = step
        difference = (arm.changed(change).at(q).tool - arm.changed(-change).at(q).tool) / (2 * step)
        assert_allclose(J[:, :, k], difference, rtol=0, atol=1e-8 * max(1.0, np.abs(difference).max()))


def test_beta_tells_parallel_axes_apart_that_no_twist_does() -> None:
    """Of two parallel axes a change of α moves the tool along z and so does β, about another direction."""
    planar = arm_of([[300, 0, 0, 0], [200, 0, 0, 0]])
    J = planar.at(np.array([[0.0, 0.0]])).jacobian[0]
    assert_allclose(J[:, 1], 0, atol=1e-12)  # α₁ turns about the arm that is stretched along x
    assert_allclose(J[:, 4], [0, 0, -200], atol=1e-12)  # β₁ lowers the second link by its length


def test_readings_without_a_joint_are_refused() -> None:
    with pytest.raises(CmmUqError, match="no column 'q2_deg'"):
        UR5.readings(np.zeros((1, 3)), {"q1_deg": np.zeros(1)})
    with pytest.raises(CmmUqError, match="an arm has no carriage x"):
        UR5.travel("x")
