"""How the errors of three carriages displace the probe: one rule for every chain.

Each carriage has three displacements and three rotations, and each pair of axes a squareness: 21 parametric errors. The
rotation of a carriage acts on the vector that it carries. For a carriage that moves the probe this is the way from the
carriage to the tip; for a carriage that moves the workpiece its own reading belongs to it too, because the workpiece
turns about a point of the carriage that the probe has left behind.

Signs: true = indicated + e; rotations follow the right hand. S is the angle between two axes less 90°, so that for small
angles e_x = −Sxy·y, e_y = −Syz·z, e_x = −Szx·z. Whatever the angles, a carriage moves along a unit vector
(:func:`axis_directions`) by what its scale reads and errs, and the motions add up. Errors of a carriage that moves the
workpiece are those of the probe seen from the workpiece. Harris 2004 eq. 10–13 is the chain ``XYZ``, Manlay 2013 section 1
the chain ``YXZ``.
"""

from __future__ import annotations

import re
from functools import lru_cache
from itertools import combinations, permutations
from typing import Literal

import numpy as np

from cmm_uq.base.errors import CmmUqError, suggestion
from cmm_uq.base.points import AXES, Floats
from cmm_uq.base.values import dataclass

SQUARENESSES = ("xy", "yz", "zx")  # pairs of axes in the order in which every squareness array here keeps them
MOST_LEAN = 0.175  # rad, 10°: farther out of square no axis of a machine is believed to be


@dataclass(frozen=True)
class ParametricError:
    """One of the 21: a displacement along or a rotation about ``direction`` of ``carriage``, or a squareness.

    Of a squareness, ``carriage`` and ``direction`` are the two axes as in :data:`SQUARENESSES`.
    """

    kind: Literal["displacement", "rotation", "squareness"]
    carriage: str
    direction: str

    @property
    def vdi(self) -> str:
        """Name in VDI/VDE 2617: carriage, t, r or w, direction, such as ``xty``, ``xrz`` or ``xwy``."""
        if self.kind == "squareness":
            return "w".join(sorted((self.carriage, self.direction)))
        return f"{self.carriage}{'t' if self.kind == 'displacement' else 'r'}{self.direction}"

    @property
    def symbol(self) -> str:
        """Name in Greek: δ or ε with the direction, and the carriage in brackets; S with two axes."""
        if self.kind == "squareness":
            return f"S{self.carriage}{self.direction}"
        return f"{'δ' if self.kind == 'displacement' else 'ε'}{self.direction}({self.carriage})"


_KINDS: tuple[Literal["displacement", "rotation"], ...] = ("displacement", "rotation")

# all 21 in the order of every Jacobian here: of carriages x, y, z the displacements and rotations, then squareness
PARAMETRIC_ERRORS = (
    *(ParametricError(kind, a, b) for a in AXES for kind in _KINDS for b in AXES),
    *(ParametricError("squareness", pair[0], pair[1]) for pair in SQUARENESSES),
)

_VDI = re.compile(r"([xyz])([trw])([xyz])")
_GREEK = re.compile(r"(?:(δ|delta|d)|(ε|ϵ|epsilon|eps|e))_?([xyz])_?\(?([xyz])\)?")
_SQUARE = re.compile(r"(?:s|squareness)_?([xyz])([xyz])")


def parametric_error(name: str) -> ParametricError:
    """The error that a name of VDI/VDE 2617 (``ytx``) or of the δ/ε notation (``δx(y)``, ``epsilon_z(x)``) means."""
    text = name.strip().lower()
    found = None
    if match := _VDI.fullmatch(text):
        a, kind, b = match.groups()
        moved = ParametricError("displacement" if kind == "t" else "rotation", a, b)
        found = _squareness(a, b) if kind == "w" else moved
    elif match := _GREEK.fullmatch(text):
        displaced, _, b, a = match.groups()
        found = ParametricError("displacement" if displaced else "rotation", a, b)
    elif match := _SQUARE.fullmatch(text):
        found = _squareness(*match.groups())
    if found is None:
        known = [e.vdi for e in PARAMETRIC_ERRORS] + [e.symbol for e in PARAMETRIC_ERRORS]
        raise CmmUqError(f"no parametric error is named {name!r}", fix=suggestion(text, known))
    return found


def _squareness(a: str, b: str) -> ParametricError | None:
    pair = next((p for p in SQUARENESSES if set(p) == {a, b}), None)
    return ParametricError("squareness", pair[0], pair[1]) if pair else None


@dataclass(frozen=True)
class KinematicChain:
    """Carriages from the workpiece to the probe."""

    order: tuple[int, int, int] = (0, 1, 2)  # indices of the axes, workpiece side first
    workpiece: int = 0  # how many of them, from the first, move the workpiece; the others move the probe

    @staticmethod
    def of(text: str | KinematicChain) -> KinematicChain:
        """Chain from its letters: ``XYZ``, all carriages move the probe; ``XFYZ``, X moves the workpiece (F = frame)."""
        return text if isinstance(text, KinematicChain) else _chain(text)

    @property
    def letters(self) -> str:
        """The chain as text, with F only where a carriage moves the workpiece."""
        axes = [AXES[i].upper() for i in self.order]
        return "".join([*axes[: self.workpiece], "F" if self.workpiece else "", *axes[self.workpiece :]])

    def rides(self, carriage: str, on: str) -> bool:
        """Whether a carriage rides on another: what turns the guide of that one turns this one too."""
        place, below = (self.order.index(AXES.index(axis)) for axis in (carriage, on))
        return self.workpiece <= below < place or place < below < self.workpiece

    @property
    def from_frame(self) -> tuple[str, ...]:
        """The axes, each after those that it rides on, and else in the order x, y, z."""
        return min(p for p in permutations(AXES) if not any(self.rides(a, on=b) for a, b in combinations(p, 2)))


@lru_cache(maxsize=64)
def _chain(text: str) -> KinematicChain:
    letters = re.split(r"[-|]", text.strip().upper())[0]  # rotary axes move no carriage
    axes = letters.replace("F", "", 1).lower()
    if sorted(axes) != list(AXES):
        known = ", ".join("".join(p) for p in permutations("XYZ"))
        raise CmmUqError(
            f"{text!r} is no chain of three carriages",
            where="job.toml [machine] chain",
            fix=f"Give the axes from the workpiece to the probe ({known}), F for the frame where a carriage moves the "
            "workpiece, such as XFYZ",
        )
    i, j, k = (AXES.index(a) for a in axes)
    return KinematicChain((i, j, k), max(letters.find("F"), 0))


def carried_offset(
    axis: str, readings: Floats, tip: Floats | None = None, chain: str | KinematicChain = "XYZ",
    directions: Floats | None = None,
) -> Floats:  # fmt: skip
    """Vector (n, 3), mm, on which a rotation of carriage ``axis`` acts: the probe moves by ε × offset.

    In the chain XYZ it is (0, y, z) of carriage x, (0, 0, z) of y and 0 of z, each with the stylus tip offset added.
    ``readings``: (n, 3) of the scales, mm. ``tip``: (n, 3) or (3,) stylus tip or digitizer offset from the end of the ram,
    mm. ``chain``: see :meth:`KinematicChain.of`. ``directions``: of the motions where they lean, see
    :func:`axis_directions`.
    """
    carried = _carried(AXES.index(axis), KinematicChain.of(chain))
    offset = np.zeros(np.shape(readings))
    offset[:, carried] = readings[:, carried]
    if directions is not None:
        offset = offset + leaning(offset, directions)
    return offset if tip is None else offset + tip


def _carried(carriage: int, chain: KinematicChain) -> list[int]:
    """Axes whose readings stand between a carriage and the end of the ram."""
    place = chain.order.index(carriage)
    return list(chain.order[place if place < chain.workpiece else place + 1 :])


def first_order(
    readings: Floats, errors: Floats, squareness: Floats | None = None, *, tip: Floats | None = None,
    chain: str | KinematicChain = "XYZ",
) -> Floats:  # fmt: skip
    """Error e (n, 3), mm, of every point to first order in the parametric errors (Harris 2004 eq. 11–13 for XYZ).

    ``readings``: (n, 3) of the scales, mm. ``errors``: (n, 3, 6) of carriages x, y, z: displacements along x, y, z in mm,
    rotations about x, y, z in rad. ``squareness``: (3,) or (n, 3) Sxy, Syz, Szx, rad. ``tip, chain``: see
    :func:`carried_offset`.
    """
    chain = KinematicChain.of(chain)
    tips = None if tip is None else np.broadcast_to(tip, readings.shape).T
    # written by components: clouds of points spend their time here
    e = errors[:, :, :3].sum(axis=1).T
    for i in range(3):
        rotation = errors[:, i, 3:].T
        carried = _carried(i, chain)
        for j in range(3):
            parts = [*([readings[:, j]] if j in carried else []), *([] if tips is None else [tips[j]])]
            if parts:
                offset = parts[0] if len(parts) == 1 else parts[0] + parts[1]
                e[(j + 1) % 3] += rotation[(j + 2) % 3] * offset
                e[(j + 2) % 3] -= rotation[(j + 1) % 3] * offset
    if squareness is not None:
        s_xy, s_yz, s_zx = np.moveaxis(squareness, -1, 0)
        e[0] -= s_xy * readings[:, 1] + s_zx * readings[:, 2]
        e[1] -= s_yz * readings[:, 2]
    return np.asarray(e.T)


def jacobian(readings: Floats, *, tip: Floats | None = None, chain: str | KinematicChain = "XYZ") -> Floats:
    """Derivative (n, 3, 21) of e with respect to each parametric error, all errors being small.

    Columns as in :data:`PARAMETRIC_ERRORS`: 1 for displacements, mm/rad for rotations and squareness.
    """
    J = np.zeros((len(readings), 3, 21))
    for i, axis in enumerate(AXES):
        J[:, :, 6 * i : 6 * i + 3] = np.eye(3)
        offset = carried_offset(axis, readings, tip, chain)
        for b in range(3):
            J[:, :, 6 * i + 3 + b] = np.cross(np.eye(3)[b], offset)
    J[:, 0, 18] = -readings[:, 1]
    J[:, 1, 19] = -readings[:, 2]
    J[:, 0, 20] = -readings[:, 2]
    return J


def exact(
    readings: Floats, errors: Floats, squareness: Floats | None = None, *, tip: Floats | None = None,
    chain: str | KinematicChain = "XYZ",
) -> Floats:  # fmt: skip
    """Error e of every point by rigid transformations, without neglecting products of errors.

    Parameters and result as :func:`first_order`. Rotations are taken as rotation vectors; axes x and y span the plane
    z = 0, with x along the motion of carriage x. The position error of a carriage (δx of x) goes along its motion.
    """
    chain = KinematicChain.of(chain)
    axes = axis_directions(squareness)
    own = readings + errors[:, np.arange(3), np.arange(3)]
    point = np.zeros(np.shape(readings)) if tip is None else np.broadcast_to(tip, np.shape(readings)).copy()
    for place in reversed(range(3)):
        i = chain.order[place]
        across = errors[:, i, :3] * (np.arange(3) != i)
        motion = own[:, i, None] * axes[..., i, :] + across
        if place < chain.workpiece:
            point = rotate(errors[:, i, 3:], motion + point)
        else:
            point = motion + rotate(errors[:, i, 3:], point)
    indicated = readings if tip is None else readings + tip
    return np.asarray(point - indicated)


def on_leaning_axes(
    readings: Floats, errors: Floats, squareness: Floats | None = None, *, tip: Floats | None = None,
    chain: str | KinematicChain = "XYZ",
) -> Floats:  # fmt: skip
    """Error e of every point: exact in the squarenesses, to first order in displacements and rotations.

    What :func:`exact` gives but for products of rotations with one another and with displacements, in half its time.
    Parameters and result as :func:`first_order`.
    """
    e = first_order(readings, errors, tip=tip, chain=chain)
    if squareness is None:
        return e
    chain = KinematicChain.of(chain)
    lean = axis_directions(squareness) - np.eye(3)
    # written by components: clouds of points spend their time here
    for j in (1, 2):  # x does not lean
        own = readings[:, j] + errors[:, j, j]
        moved = [own * lean[..., j, k] for k in range(3)]
        for k in range(3):
            e[:, k] += moved[k]
        for i in (i for i in range(3) if j in _carried(i, chain)):
            for k in range(3):
                e[:, k] += errors[:, i, 3 + (k + 1) % 3] * moved[(k + 2) % 3]
                e[:, k] -= errors[:, i, 3 + (k + 2) % 3] * moved[(k + 1) % 3]
    return e


def axis_directions(squareness: Floats | None) -> Floats:
    """Unit vectors (..., 3, 3) of the motions of carriages x, y, z, a row each, that enclose 90° + S with each other.

    ``squareness``: (..., 3) Sxy, Syz, Szx, rad.
    """
    s_xy, s_yz, s_zx = np.moveaxis(np.sin(np.zeros(3) if squareness is None else squareness), -1, 0)
    y_y = np.sqrt(1 - s_xy**2)
    z_y = -(s_yz + s_xy * s_zx) / y_y
    one, zero = np.ones_like(s_xy), np.zeros_like(s_xy)
    rows = [[one, zero, zero], [-s_xy, y_y, zero], [-s_zx, z_y, np.sqrt(1 - s_zx**2 - z_y**2)]]
    return np.moveaxis(np.array(rows), (0, 1), (-2, -1))


def direction_derivatives(squareness: Floats) -> Floats:
    """Derivative (3, ..., 3, 3) of :func:`axis_directions` with respect to Sxy, Syz, Szx (..., 3), per rad."""
    axes = axis_directions(squareness)
    (s_xy, c_xy), (_, c_yz), (s_zx, c_zx) = ((np.sin(s), np.cos(s)) for s in np.moveaxis(squareness, -1, 0))
    z_y, z_z = axes[..., 2, 1], axes[..., 2, 2]
    found = np.zeros((3, *axes.shape))
    found[0, ..., 1, 0], found[0, ..., 1, 1] = -c_xy, -s_xy
    found[0, ..., 2, 1] = (z_y * s_xy - c_xy * s_zx) / c_xy
    found[1, ..., 2, 1] = -c_yz / c_xy
    found[2, ..., 2, 0], found[2, ..., 2, 1] = -c_zx, -s_xy * c_zx / c_xy
    found[..., 2, 2] = -(axes[..., 2, 0] * found[..., 2, 0] + z_y * found[..., 2, 1]) / z_z
    return found


def leaning(readings: Floats, directions: Floats) -> Floats:
    """What unit vectors of the motions, (3, 3) or (n, 3, 3), add to readings (n, 3): their part of e, (n, 3)."""
    return along_directions(readings, directions - np.eye(3))


def along_directions(readings: Floats, vectors: Floats) -> Floats:
    """Sum (n, 3) of vectors (3, 3) or (n, 3, 3), a row for each carriage, times its reading (n, 3)."""
    return np.asarray(np.einsum("ni,ij->nj" if vectors.ndim == 2 else "ni,nij->nj", readings, vectors))


def rotate(rotation: Floats, vectors: Floats) -> Floats:
    """Vectors (n, 3) turned by rotation vectors (n, 3) in rad, without loss for tiny angles (Rodrigues)."""
    angle = np.linalg.norm(rotation, axis=-1, keepdims=True)
    # sin(a)/a and (1 − cos a)/a² as sinc, which is exact at a = 0
    first, second = np.sinc(angle / np.pi), 0.5 * np.sinc(angle / (2 * np.pi)) ** 2
    turned = np.cross(rotation, vectors)
    return np.asarray(vectors + first * turned + second * np.cross(rotation, turned))


def euler_313(alpha: float | Floats, beta: float | Floats, gamma: float | Floats) -> Floats:
    """Attitude (3, 3) from angles about Z, X′ and Z″, rad (Harris 2004 eq. 7): columns are u, v, w in machine axes.

    Angles (n,) give attitudes (3, 3, n).
    """
    ca, sa, cb, sb, cg, sg = (f(a) for a in (alpha, beta, gamma) for f in (np.cos, np.sin))
    first = [ca * cg - sa * cb * sg, -ca * sg - sa * cb * cg, sa * sb]
    second = [ca * cb * sg + sa * cg, ca * cb * cg - sa * sg, -ca * sb]
    return np.array([first, second, [sb * sg, sb * cg, cb]])
