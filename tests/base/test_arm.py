"""Where the tool of an arm is: against published and outside forward kinematics, and its derivatives against differences."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.testing import assert_allclose
from scipy.linalg import expm
from scipy.spatial.transform import Rotation

from cmm_uq.base.arm import Arm, rows_of_screws
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


UR5_AT_HOME = (  # Lynch, Park, Modern Robotics (2017), example 4.5, in mm: directions, points, the last frame
    [[0, 0, 1], [0, 1, 0], [0, 1, 0], [0, 1, 0], [0, 0, -1], [0, 1, 0]],
    [[0, 0, 0], [0, 0, 89], [425, 0, 89], [817, 0, 89], [817, 109, 0], [817, 0, -6]],
    [[-1, 0, 0, 817], [0, 0, 1, 191], [0, 1, 0, -6], [0, 0, 0, 1]],
)
SKEW = (  # with a third joint that is prismatic, and a fourth nearly parallel to the first
    [[1, 2, 9], [3, -4, 1], [0, 1, 2], [1, 2, 8.99], [5, 1, -1]],
    [[10, -20, 30], [100, 50, 200], [0, 0, 0], [400, -30, 120], [350, 80, 260]],
    [[0.6548940284889879, -0.6770606568888027, -0.3357121957015681, 600],
     [0.5371528306005544, 0.7295115358427202, -0.4234144017982946, -100],
     [0.5315831525051156, 0.09696280712571556, 0.8414377968733187, 300], [0, 0, 0, 1]],
)  # fmt: skip


def by_screws(directions: Floats, points: Floats, home: Floats, prismatic: int | None = None) -> Arm:
    unit = np.array(directions) / np.linalg.norm(directions, axis=1, keepdims=True)
    revolute = np.arange(len(unit)) != prismatic
    return Arm("arm", revolute=revolute, sense=np.ones(len(unit)),
               **rows_of_screws(unit, np.array(points, dtype=np.float64), revolute, np.array(home)))  # fmt: skip


@pytest.mark.parametrize(("arm", "readings", "places"), [
    (by_screws(*UR5_AT_HOME), [[0, -90, 0, 0, 90, 0], *Q6],
     [[95.0, 109.0, 988.0], [125.24127028112599, 372.55231286518546, -637.850845870361],
      [-112.53268260625788, 221.46457825388538, 667.4050501702116]]),
    (by_screws(*SKEW, prismatic=2), [[52.4, 52.9, 46.0, -36.8, -76.6], [-15.7, -78.1, -154.0, 85.8, 26.1]],
     [[407.5225055529458, 137.22019691938564, 680.2037613673845],
      [73.79925861091553, -283.0769422911144, -136.427109319971]]),
], ids=["UR5", "skew"])  # fmt: skip
def test_the_tool_is_where_a_product_of_exponentials_has_it(
    arm: Arm, readings: list[list[float]], places: list[list[float]]
) -> None:
    """The first as the book prints it (example 4.5), others by its package, modern_robotics 1.1.1 (FKinSpace)."""
    assert_allclose(arm.at(np.array(readings, dtype=np.float64)).tool, places, rtol=0, atol=1e-9)


def exponential(direction: Floats, point: Floats, reading: float, turns: bool) -> Floats:
    """e^ξq by the series of the matrix, (4, 4); ``reading`` rad or mm."""
    twist = np.zeros((4, 4))
    if turns:
        twist[:3, :3] = np.cross(np.eye(3), direction)
        twist[:3, 3] = -np.cross(direction, point)
    else:
        twist[:3, 3] = direction
    return np.asarray(expm(twist * reading))


@pytest.mark.parametrize("seed", range(40))
def test_rows_of_screw_axes_are_a_product_of_exponentials(seed: int) -> None:
    """Of axes that cross, are skew, parallel either way, nearly so, and the same; place and attitude of the last frame."""
    random = np.random.default_rng(seed)
    j = int(random.integers(1, 8))
    directions, points = random.standard_normal((j, 3)), random.normal(0, 400, (j, 3))
    for i in range(1, j):
        like = random.integers(6)
        if like < 3:
            directions[i] = (1, -1, 1)[like] * directions[i - 1] + (0, 0, 0.02)[like] * random.standard_normal(3)
        points[i] = points[i - 1] if like == 4 else points[i]
    directions = np.eye(3)[[seed] * j] if seed < 3 else directions / np.linalg.norm(directions, axis=1, keepdims=True)
    revolute, home, q = random.random(j) > 0.2, np.eye(4), random.uniform(-180, 180, j)
    home[:3, :3], home[:3, 3] = Rotation.random(random_state=seed).as_matrix(), random.normal(0, 400, 3)
    pose = Arm(revolute=revolute, sense=np.ones(j), **rows_of_screws(directions, points, revolute, home)).at(q[None])
    frame = np.eye(4)
    for direction, point, reading, turns in zip(directions, points, q, revolute, strict=True):
        frame = frame @ exponential(direction, point, np.radians(reading) if turns else reading, bool(turns))
    frame = frame @ home
    assert_allclose(pose.tool[0], frame[:3, 3], rtol=0, atol=1e-9)
    assert_allclose(pose.flange[0], frame[:3, :3], rtol=0, atol=1e-12)


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
