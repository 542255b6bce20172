"""Machines with a hidden truth, their calibrations and parts measured on them, written a second time from the definitions.

Nothing here comes from the package. A machine is a chain XYZ; r is what its scales read at a point (n, 3), mm:

    true = X·(r_x + δ_x) + Y·(r_y + δ_y) + Z·(r_z + δ_z) + tip + Σ ε_a × carried_a + straightness

with δ along each axis' own motion (scale, periodic error, backlash), X, Y, Z unit vectors that enclose 90° + S, rotations in
proportion to travel that act on all that a carriage carries, the tip included, and straightness as one bow over the travel.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

TRAVEL = np.array([[0.0, 900.0], [0.0, 600.0], [-500.0, 0.0]])
SECOND = np.pi / 648000
SIX = ("scale_x", "scale_y", "scale_z", "squareness_xy", "squareness_yz", "squareness_zx")
PHYSICS = {
    "scale": 300.0,
    "squareness": 500.0,
    "straightness": 50.0,
    "rotation": 60.0,
    "hysteresis": 30.0,
    "periodic": 10.0,
}
"""Standard deviations of true errors: ppm, ″, µm, ″/m, µm, µm of each of two amplitudes. As large as physics allows."""
PERIODS = (0.5, 1000.0)
"""mm; evenly in the logarithm."""
TIP = np.array([0.0, 0.0, -80.0])
RADIUS, SPHERE_AT, SPHERE_RADIUS = 2.0, np.array([100.0, 100.0, -400.0]), 12.5


@dataclass(frozen=True, eq=False)
class Truth:
    """A machine's errors, in the units of :data:`PHYSICS`.

    Parameters
    ----------
    scale, gap : (3,) of x, y, z.
    squareness : (3,) xy, yz, zx.
    bow, turn : (3, 3) of carriage a along, about b.
    wave : (3, 2) amplitudes of sine and cosine; ``period`` (3,) mm.
    """

    scale: np.ndarray
    squareness: np.ndarray
    bow: np.ndarray
    turn: np.ndarray
    gap: np.ndarray
    wave: np.ndarray
    period: np.ndarray

    @classmethod
    def drawn(cls, random: np.random.Generator, *, periods: bool = True) -> Truth:
        """Any machine, with periodic errors or without."""
        sizes = {
            "scale": 3,
            "squareness": 3,
            "straightness": (3, 3),
            "rotation": (3, 3),
            "hysteresis": 3,
            "periodic": (3, 2),
        }
        errors = [PHYSICS[name] * random.standard_normal(shape) for name, shape in sizes.items()]
        errors[2] *= 1 - np.eye(3)
        errors[5] *= periods
        return cls(*errors, np.exp(random.uniform(*np.log(PERIODS), 3)))

    @classmethod
    def of_six(cls, values: Mapping[str, float]) -> Truth:
        """The errors that a certificate estimates and the machine's software corrects."""
        given = np.array([values[name] for name in SIX])
        return cls(given[:3], given[3:], np.zeros((3, 3)), np.zeros((3, 3)), np.zeros(3), np.zeros((3, 2)), np.ones(3))

    def true(self, read: np.ndarray, tip: np.ndarray, approach: np.ndarray) -> np.ndarray:
        """Where the tip truly is (n, 3), of readings (n, 3), its offset (3,) and directions of travel (n, 3)."""
        axes = axes_that_enclose(SECOND * self.squareness)
        phase = 2 * np.pi * read / self.period
        own = read * (1 + 1e-6 * self.scale) + 0.5e-3 * self.gap * approach
        own = own + 1e-3 * (self.wave[:, 0] * np.sin(phase) + self.wave[:, 1] * np.cos(phase))
        found = own @ axes + tip
        moved = read[:, :, None] * axes
        angle = (SECOND * (read - TRAVEL[:, 0]) / 1000)[:, :, None] * self.turn
        for a in range(3):
            found = found + np.cross(angle[:, a], moved[:, a + 1 :].sum(axis=1) + tip)
        place = 2 * (read - TRAVEL[:, 0]) / np.ptp(TRAVEL, axis=1) - 1
        return found + 1e-3 * (1 - place**2) @ self.bow

    def read(self, true: np.ndarray, tip: np.ndarray, approach: np.ndarray) -> np.ndarray:
        """What the scales read at true places of the tip."""
        read = true - tip
        for _ in range(30):
            step = true - self.true(read, tip, approach)
            read = read + step
            if np.abs(step).max() < 1e-10:
                break
        return read


def axes_that_enclose(angles: np.ndarray) -> np.ndarray:
    """Rows X, Y, Z of length one with angles 90° + S between xy, yz, zx; X along x, Y in the plane of x and y."""
    xy, yz, zx = -np.sin(angles)
    y = np.array([xy, np.sqrt(1 - xy * xy), 0.0])
    z = np.array([zx, (yz - zx * xy) / y[1], 0.0])
    z[2] = np.sqrt(1 - z @ z)
    return np.array([[1.0, 0, 0], y, z])


def unit(vectors: np.ndarray) -> np.ndarray:
    return vectors / np.linalg.norm(vectors, axis=-1, keepdims=True)


@dataclass(frozen=True, eq=False)
class Recording:
    """Of a calibration: true points, and what is recorded beside their coordinates."""

    xyz: np.ndarray
    measurement: np.ndarray
    point: np.ndarray
    repeat: np.ndarray
    columns: Mapping[str, np.ndarray]


def bars(
    truth: Truth, length: float, repeats: int, sigma: float, offset: float, random: np.random.Generator
) -> Recording:
    """Twenty bars anyhow in the volume: centres of balls, which backlash does not move."""
    half = 0.5 * length * unit(random.standard_normal((20, 3)))
    room = np.ptp(TRAVEL, axis=1) - 2 * np.abs(half)
    half = np.where((room > 0).all(axis=1)[:, None], half, 0.5 * length * unit(np.array([1.0, 0.8, 0.6])))
    room = np.ptp(TRAVEL, axis=1) - 2 * np.abs(half)
    middle = TRAVEL[:, 0] + np.abs(half) + room * random.random((20, 3))
    ends = np.stack([middle - half, middle + half], axis=1).reshape(-1, 3)
    shown = truth.read(ends, np.zeros(3), np.zeros_like(ends)) + offset * random.standard_normal(ends.shape)
    placed = np.repeat(shown.reshape(20, 1, 2, 3), repeats, axis=1).reshape(-1, 3)
    m, r, p = (each.ravel() for each in np.meshgrid(1 + np.arange(20), 1 + np.arange(repeats), [1, 2], indexing="ij"))
    return Recording(placed + sigma * random.standard_normal(placed.shape), m, p, r, {})


def step_gauge(
    truth: Truth, growth: float, repeats: int, sigma: float, offset: float, random: np.random.Generator, count: int = 6
) -> Recording:
    """Seven lines of so many faces, every second met from the other side: along the axes and the diagonals of the body."""
    diagonals = [unit(np.array([x, y, 1.0]) * np.ptp(TRAVEL, axis=1)) for x in (1, -1) for y in (1, -1)]
    parts: dict[str, list[np.ndarray]] = {name: [] for name in ("xyz", "m", "p", "r", "at", "travel")}
    for number, direction in enumerate([*diagonals, *np.eye(3)], 1):
        reach = 0.75 * np.min(np.ptp(TRAVEL, axis=1)[direction != 0] / np.abs(direction[direction != 0]))
        faces = np.linspace(0, 20 * np.floor(min(reach, 800.0) / 20), count)
        room = np.ptp(TRAVEL, axis=1) - np.abs(direction) * faces[-1]
        low = TRAVEL[:, 0] + room * random.uniform(0.1, 0.9, 3)
        start = np.where(direction < 0, low + np.abs(direction) * faces[-1], low)
        travel = np.where(np.arange(count)[:, None] % 2, -1.0, 1.0) * np.sign(
            np.where(np.abs(direction) > 1e-6, direction, 0.0)
        )
        points = truth.read(start + (1 + growth) * faces[:, None] * direction, np.zeros(3), travel)
        points = points + offset * random.standard_normal(points.shape)
        parts["xyz"].append(np.tile(points, (repeats, 1)))
        parts["travel"].append(np.tile(travel, (repeats, 1)))
        parts["at"].append(np.tile(faces, repeats))
        parts["m"].append(np.full(count * repeats, number))
        parts["p"].append(np.tile(np.arange(1, count + 1), repeats))
        parts["r"].append(np.repeat(np.arange(1, repeats + 1), count))
    whole = {name: np.concatenate(each) for name, each in parts.items()}
    columns = {f"approach_{a}": whole["travel"][:, i] for i, a in enumerate("xyz")} | {"reference_mm": whole["at"]}
    xyz = whole["xyz"] + sigma * random.standard_normal(whole["xyz"].shape)
    return Recording(xyz, whole["m"], whole["p"], whole["r"], columns)


def ring(
    truth: Truth, middle: np.ndarray, diameter: float, form: float, larger: float, repeats: int, sigma: float,
    random: np.random.Generator,
) -> Recording:  # fmt: skip
    """A ring that lies flat, 25 points around, by a tip whose radius is larger than it is taken for; mm.

    ``form``: range of its radii, all of it in two lobes that lie anyhow.
    """
    turn = 2 * np.pi * (np.arange(25) + 0.5) / 25
    out = np.column_stack([np.cos(turn), np.sin(turn), np.zeros(25)])
    lobes = 0.5 * form * np.cos(2 * turn + random.uniform(0, 2 * np.pi))
    centres = middle + (0.5 * diameter + lobes - RADIUS)[:, None] * out
    shown = truth.read(centres, TIP, np.sign(np.round(out, 6))) + (RADIUS - larger) * out
    vectors = {"n{}": -out, "approach_{}": np.sign(np.round(out, 6)), "tip_{}_mm": np.tile(TIP, (25, 1))}
    columns = {name.format(a): np.tile(v[:, i], repeats) for name, v in vectors.items() for i, a in enumerate("xyz")}
    one, at = np.ones(25 * repeats, dtype=np.int64), np.tile(np.arange(1, 26), repeats)
    xyz = np.tile(shown, (repeats, 1)) + sigma * random.standard_normal((25 * repeats, 3))
    return Recording(xyz, one, at, np.repeat(np.arange(1, repeats + 1), 25), columns)


def tested_lengths(
    truth: Truth, corrected: Truth, sigma: float, u_um: float, random: np.random.Generator
) -> tuple[np.ndarray, np.ndarray]:
    """Five lengths on each of seven lines near the middle, three times over (ISO 10360-2): lengths (35,), errors (35, 3), mm.

    Lines lie up to a twentieth of the travel beside its middle, and along themselves; of ``u_um`` half is common to all.
    """
    size, lengths, errors = np.ptp(TRAVEL, axis=1), list[float](), list[np.ndarray]()
    for whole in [np.array([x, y, 1.0]) * size for x in (1, -1) for y in (1, -1)] + list(np.diag(size)):
        along, longest = unit(whole), 0.66 * float(np.linalg.norm(whole))
        start = TRAVEL.mean(axis=1) - 0.5 * longest * along + 0.05 * size * random.uniform(-1, 1, 3)
        travel = np.where(np.abs(along) > 1e-6, np.sign(along), 0.0)
        for length in np.linspace(30.0, longest, 5):
            ends = np.array([start, start + length * along])
            approach = np.array([travel, -travel])
            shown = corrected.true(truth.read(ends, np.zeros(3), approach), np.zeros(3), np.zeros((2, 3)))
            lengths.append(float(length))
            errors.append(np.linalg.norm(shown[1] - shown[0]) - length + np.sqrt(2) * sigma * random.standard_normal(3))
    off = 1e-3 * u_um * (random.standard_normal() + random.standard_normal((35, 1))) / np.sqrt(2)
    return np.array(lengths), np.array(errors) + off


@dataclass(frozen=True, eq=False)
class Measuring:
    """A part measured on a machine that corrects what its certificate estimates.

    Parameters
    ----------
    truth, corrected : of the machine, and what its software takes for it.
    turn, shift : coordinates of the machine = turn · those of the part + shift.
    noise : standard deviation of each coordinate of each point, mm.
    larger : by how much the tip's diameter is larger than its qualification found otherwise, mm.
    growth : relative expansion of the part that remains after its correction.
    """

    truth: Truth
    corrected: Truth
    turn: np.ndarray
    shift: np.ndarray
    noise: float
    larger: float
    growth: float

    def shown(self, centres: np.ndarray, normals: np.ndarray) -> np.ndarray:
        """Centres of the tip as the machine shows them, (n, 3) mm."""
        travel = -np.sign(np.where(np.abs(normals) > 1e-6, normals, 0.0))
        return self.corrected.true(self.truth.read(centres, TIP, travel), TIP, np.zeros_like(travel))

    def measured(self, points: np.ndarray, normals: np.ndarray, random: np.random.Generator) -> np.ndarray:
        """Points of the surface (n, 3) as measured, in the frame of the part, of true ones there and their normals."""
        out = normals @ self.turn.T
        toward = sphere_directions()
        shift, radius = sphere(self.shown(SPHERE_AT + (SPHERE_RADIUS + RADIUS) * toward, toward))
        place = (1 + self.growth) * points @ self.turn.T + self.shift
        centres = self.shown(place + RADIUS * out, out) + self.noise * random.standard_normal(points.shape)
        surface = centres - (shift - SPHERE_AT) - (radius - SPHERE_RADIUS - 0.5 * self.larger) * out
        return (surface - self.shift) @ self.turn


def sphere_directions() -> np.ndarray:
    """25 directions over the upper half, as ISO 10360-5 has them."""
    rings = ((90.0, 1, 0.0), (67.5, 4, 0.0), (45.0, 8, 22.5), (22.5, 4, 45.0), (0.0, 8, 0.0))
    found = [(h, start + 360 * i / n) for h, n, start in rings for i in range(n)]
    h, turn = np.radians(np.array(found)).T
    return np.column_stack([np.cos(h) * np.cos(turn), np.cos(h) * np.sin(turn), np.sin(h)])


# -- features by least squares, and what a drawing asks of them ------------------------------------------------------------


def sphere(points: np.ndarray) -> tuple[np.ndarray, float]:
    """Centre and radius, by Gauss and Newton from the algebraic one."""
    x = np.linalg.lstsq(np.column_stack([2 * points, np.ones(len(points))]), (points**2).sum(axis=1), rcond=None)[0]
    state = np.append(x[:3], np.sqrt(x[3] + x[:3] @ x[:3]))
    for _ in range(10):
        apart = points - state[:3]
        reach = np.linalg.norm(apart, axis=1)
        J = np.column_stack([-apart / reach[:, None], -np.ones(len(points))])
        state = state - np.linalg.lstsq(J, reach - state[3], rcond=None)[0]
    return state[:3], float(state[3])


def plane(points: np.ndarray, sense: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Centroid, and normal in a sense."""
    middle = points.mean(axis=0)
    normal = np.linalg.svd(points - middle, full_matrices=False)[2][2]
    return middle, normal * np.sign(normal @ sense)


def cylinder(
    points: np.ndarray, nominal: np.ndarray, radius: float
) -> tuple[np.ndarray, np.ndarray, float, np.ndarray]:
    """Point of the axis at the height of the nominal one, direction, radius and distances; the axis is near z."""
    state = np.array([nominal[0], nominal[1], 0.0, 0.0, radius])
    for _ in range(12):
        w = unit(np.array([state[2], state[3], 1.0]))
        apart = points - [state[0], state[1], nominal[2]]
        along = apart @ w
        radial = apart - along[:, None] * w
        reach = np.linalg.norm(radial, axis=1)
        out = radial / reach[:, None]
        high = along[:, None] / np.sqrt(1 + state[2] ** 2 + state[3] ** 2)
        J = np.column_stack([-out[:, :2], -out[:, :2] * high, -np.ones(len(points))])
        state = state - np.linalg.lstsq(J, reach - state[4], rcond=None)[0]
    w = unit(np.array([state[2], state[3], 1.0]))
    apart = points - [state[0], state[1], nominal[2]]
    off = np.linalg.norm(apart - np.outer(apart @ w, w), axis=1) - state[4]
    return np.array([state[0], state[1], nominal[2]]), w, float(state[4]), off


def characteristics(points: Mapping[str, np.ndarray]) -> dict[str, float]:
    """Of the study's part, mm and rad, by the definitions of docs/machine/parts.md."""
    (a, up), (b, front), (c, left), (d, _) = (
        plane(points[name], np.array(sense)) for name, sense in
        (("A", (0.0, 0, 1)), ("B", (0.0, -1, 0)), ("C", (-1.0, 0, 0)), ("D", (1.0, 0, 0)))
    )  # fmt: skip
    depth = float(np.mean(DEPTHS))
    (p1, w1, r1, off1), (p2, w2, r2, _) = (
        cylinder(points[name], np.array([*CENTRES[name], points[name][:, 2].mean()]), RADII[name])
        for name in ("h1", "h2")
    )
    middle, ball = sphere(points["S"])
    # the frame of A, B, C: up, then across the front as it is seen along up, through the corner of all three
    y = -unit(front - (front @ up) * up)
    frame = np.array([np.cross(y, up), y, up])
    corner = np.linalg.solve(np.array([up, front, left]), [up @ a, front @ b, left @ c])
    found = {
        "d1": 2 * r1, "d2": 2 * r2, "ball": 2 * ball,
        "apart": float(np.linalg.norm(np.cross(p2 - p1, w1))),
        "x1": float(frame[0] @ (p1 - corner)), "y2": float(frame[1] @ (p2 - corner)),
        "z ball": float(frame[2] @ (middle - corner)),
        "length": abs(float((d - c) @ left)),
        "upright": float(np.ptp(DEPTHS) * np.linalg.norm(np.cross(w1, up))),
        "corner": float(np.arccos(np.clip(front @ left, -1, 1))),
        "parallel": float(np.ptp(points["D"] @ left)),
        "flat": float(np.ptp(points["A"] @ up)),
        "round": float(np.ptp(off1)),
    }  # fmt: skip
    for name, place, direction in (("h1", p1, w1), ("h2", p2, w2)):
        nominal, turned = np.array([*CENTRES[name], depth]), frame @ direction
        ends = [frame @ (place - corner) + (z - depth) * turned - nominal for z in (min(DEPTHS), max(DEPTHS))]
        found[f"position {name[1]}"] = 2 * max(float(np.hypot(e[0], e[1])) for e in ends)
    return found


# -- the part ---------------------------------------------------------------------------------------------------------------

DEPTHS = (-3.0, -12.0, -20.0)
CENTRES = {"h1": (30.0, 40.0), "h2": (170.0, 60.0)}
RADII = {"h1": 10.0, "h2": 15.0}
BALL = np.array([100.0, 50.0, 40.0])


def nominal_part() -> dict[str, tuple[np.ndarray, np.ndarray]]:
    """Points and normals out of the material by feature: a plate of 200 × 100 mm, two bores, a ball above it."""

    def face(origin: tuple[float, ...], one: tuple[float, ...], other: tuple[float, ...], n: int, m: int) -> np.ndarray:
        s, t = (
            each.ravel()[:, None] for each in np.meshgrid(np.linspace(0, 1, n), np.linspace(0, 1, m), indexing="ij")
        )
        return np.array(origin) + s * np.array(one) + t * np.array(other)

    faces = {
        "A": (face((0, 0, 0), (200, 0, 0), (0, 100, 0), 4, 4), (0.0, 0, 1)),
        "B": (face((0, 0, -5), (200, 0, 0), (0, 0, -20), 4, 3), (0.0, -1, 0)),
        "C": (face((0, 0, -5), (0, 100, 0), (0, 0, -20), 4, 3), (-1.0, 0, 0)),
        "D": (face((200, 0, -5), (0, 100, 0), (0, 0, -20), 4, 3), (1.0, 0, 0)),
    }
    found = {name: (points, np.tile(normal, (len(points), 1))) for name, (points, normal) in faces.items()}
    for name, (x, y) in CENTRES.items():
        turn = np.concatenate([0.3 * k + 2 * np.pi * np.arange(8) / 8 for k in range(3)])
        out = np.column_stack([np.cos(turn), np.sin(turn), np.zeros(24)])
        found[name] = np.array([x, y, 0.0]) + RADII[name] * out + np.repeat(DEPTHS, 8)[:, None] * [0, 0, 1], -out
    toward = sphere_directions()
    found["S"] = BALL + 12.5 * toward, toward
    return found


def made_part(random: np.random.Generator, place_um: float = 20.0, form_um: float = 2.0) -> dict[str, np.ndarray]:
    """True points as a workshop makes them: places off by so much, 5 µrad a micrometre of it, sizes 5 µm."""
    found = {}
    for name, (points, normals) in nominal_part().items():
        middle = points.mean(axis=0)
        off, turn = 1e-3 * place_um * random.standard_normal(3), 5e-6 * place_um * random.standard_normal(3)
        moved = points + off + np.cross(turn, points - middle)
        grown = 0.0 if name in "ABCD" else 2.5e-3 * random.standard_normal()
        found[name] = moved + (grown + 1e-3 * form_um * random.standard_normal((len(points), 1))) * normals
    return found
