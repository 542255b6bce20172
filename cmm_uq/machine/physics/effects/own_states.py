"""Faults of an artefact by how it was kept, laid and held: temperature, bending, fixture; and the form of a sphere or ring."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import scipy

from cmm_uq.base.messages import say
from cmm_uq.base.points import Floats, Ints, Points
from cmm_uq.base.units import MICROMETRE, unit
from cmm_uq.machine.physics.effect import CommonSize, Effect, Harmonic, Parameter
from cmm_uq.machine.physics.effects.own_errors import FaultyArtefact, OwnFault, means_of
from cmm_uq.maths.geometry.feature import frame_about, upward

KELVIN = Parameter("k", unit("K"), 1.0)
TURNED = "turned_deg"  # column: by how much a sphere (about Z) or ring was turned against its first set-up
# degrees and orders of the harmonics of a sphere's form: the size and the place of the ball are those of 0 and 1
HARMONICS = tuple((degree, order) for degree in (2, 3, 4, 5) for order in range(-degree, degree + 1))
NORMAL = ("nx", "ny", "nz")


def normals_of(points: Points) -> Floats:
    """Outward unit normals (n, 3), as recorded."""
    return np.column_stack([points.column(name) for name in NORMAL])


def lobes_of(normals: Floats, count: int, turned: Floats | float = 0.0) -> Floats:
    """(n, 3, 2) along normals (n, 3), for A·cos φ and A·sin φ of A·cos(count·θ + φ), θ about Z less ``turned``, rad."""
    angle = count * (np.arctan2(normals[:, 1], normals[:, 0]) - turned)
    lobes = np.column_stack([np.cos(angle), -np.sin(angle)])
    return np.asarray(MICROMETRE * normals[:, :, None] * lobes[:, None, :])


class OfDirections(CommonSize):
    """Spherical harmonics of mean square one, by their root mean square over the sphere."""

    def errors(self, coefficients: Floats) -> Floats:
        return np.asarray(coefficients * np.sqrt(coefficients.shape[-1]), dtype=np.float64)


class ArtefactTemperature(OwnFault):
    """The artefact was warmer than its recorded or assumed temperature says, in the whole recording.

    What is certified of it too short looks the same.
    """

    name, title = "artefact_temperature", say("Temperature of the artefact")
    formula = "e = −cte · k · (place about the middle of the set-up)"
    points_to = say(
        "the artefact was warmer or colder than recorded, or its certified length is not right: let it soak, and check its "
        "thermometer, its coefficient of expansion and its certificate"
    )
    coefficients = (KELVIN,)

    def basis(self, points: Points, shape: Sequence[float] = ()) -> Floats:
        return (-self.whose().cte * _about_set_up(points))[:, :, None]


class OfSetUps(OwnFault, CommonSize):
    """A fault with coefficients of its own in each set-up, of one common size."""

    each: tuple[str, ...]

    def sized(self, owner: FaultyArtefact) -> tuple[Parameter, ...]:
        (c,) = self.coefficients
        return tuple(
            Parameter(f"{name}_{m}_{c.name}", c.unit, owner.size) for m in self.numbered(owner) for name in self.each
        )

    def numbered(self, owner: FaultyArtefact) -> Ints:
        return np.unique(owner.points.measurement)

    def fit(self, owner: FaultyArtefact) -> None:
        self.size = Parameter(self.size.name, self.size.unit, owner.size)

    def shown_in(self, points: Points) -> bool:
        return len(np.unique(points.measurement)) > 1

    def by_set_up(self, points: Points, each: Floats) -> Floats:
        """Columns (n, 3, q·j) of coefficients of every set-up from those (n, 3, j) of a single one."""
        numbers = np.unique(self.whose().points.measurement)
        own = (points.measurement[:, None] == numbers).astype(np.float64)
        return np.asarray(np.einsum("nq,nij->niqj", own, each).reshape(len(points), 3, -1))


class SetUpTemperature(OfSetUps):
    """The artefact had another temperature in each set-up than was recorded."""

    name, title = "artefact_set_up_temperature", say("Temperature of the artefact from set-up to set-up")
    formula = "e = −cte · k of the set-up · (place about the middle of the set-up)"
    points_to = say(
        "the artefact was not at one temperature in all set-ups, or its thermometer did not follow: let it soak after each "
        "change, and handle it with gloves"
    )
    coefficients = (KELVIN,)
    size = Parameter("rms_k", unit("K"), 1.0)
    each = ("t",)

    def basis(self, points: Points, shape: Sequence[float] = ()) -> Floats:
        each = self.by_set_up(points, (-self.whose().cte * _about_set_up(points))[:, :, None])
        return np.asarray(each @ self._contrasts())

    def numbered(self, owner: FaultyArtefact) -> Ints:
        return np.arange(1, len(np.unique(owner.points.measurement)))

    def errors(self, coefficients: Floats) -> Floats:
        return np.asarray(coefficients @ self._contrasts().T)

    def _contrasts(self) -> Floats:
        """(q, q − 1) orthonormal, each without a mean (Helmert)."""
        return np.asarray(scipy.linalg.helmert(len(np.unique(self.whose().points.measurement))).T, dtype=np.float64)


class ArtefactBending(OwnFault):
    """A flat artefact bends between its supports by its own weight: most as it lies, not at all where it stands upright."""

    name, title = "artefact_bending", say("Bending of the artefact by its own weight")
    formula = "e = +um·(n·Z)·(1 − ρ²)·n, n the artefact's normal, ρ the distance from its middle over the largest"
    points_to = say(
        "the artefact sags between its supports: support it at the marked points, as it was when it was calibrated"
    )
    coefficients = (Parameter("um", unit("µm"), 10.0),)

    def basis(self, points: Points, shape: Sequence[float] = ()) -> Floats:
        normal, across = _flat(self.whose(), points)
        rho2 = np.sum(across**2, axis=1)
        return np.asarray((MICROMETRE * (normal[:, 2] * (1 - rho2))[:, None] * normal)[:, :, None])


class ArtefactFixture(OfSetUps):
    """The fixture bends and twists a flat artefact, otherwise in each set-up."""

    name, title = "artefact_fixture", say("Bending of the artefact by its fixture")
    formula = "e = −(a·u² + b·v² + c·u·v)·n in each set-up, n the normal, u and v the place over the largest distance"
    points_to = say(
        "the artefact was bent or twisted when it was clamped: hold it at three points without strain, and set it up again"
    )
    coefficients = (Parameter("um", unit("µm"), 5.0),)
    size = Parameter("rms_um", unit("µm"), 5.0)
    each = ("u", "v", "uv")

    def basis(self, points: Points, shape: Sequence[float] = ()) -> Floats:
        normal, across = _flat(self.whose(), points)
        u, v = across.T
        bends = np.column_stack([u**2, v**2, u * v])
        return self.by_set_up(points, -MICROMETRE * normal[:, :, None] * bends[:, None, :])


class OwnLobes(OwnFault, Harmonic):
    """The sphere itself has three lobes, which turn with it."""

    name, title = "artefact_lobing", say("Three lobes of the sphere itself")
    formula = "e = −A·cos(3θ + φ)·n, θ = atan2(ny, nx) less how far the sphere was turned"
    points_to = say("the sphere is not round: turn it about its stem and probe it again; what turns with it is its own")
    amplitude = Parameter("amplitude_um", unit("µm"), 1.0)
    coefficients = (Parameter("cosine_um", unit("µm"), 1.0), Parameter("sine_um", unit("µm"), 1.0))
    columns = NORMAL

    def belongs_to(self, points: Points) -> bool:
        return self.owner is not None

    def basis(self, points: Points, shape: Sequence[float] = ()) -> Floats:
        self.whose()
        return -lobes_of(normals_of(points), 3, turned_back(points))


class OwnForm(OwnFault, OfDirections):
    """The sphere itself is not round: spherical harmonics of the degrees 2 to 5, which turn with it."""

    name, title = "artefact_form", say("Form of the sphere itself")
    formula = "e = −Σ c_lm·Y_lm(n turned back with the sphere)·n, l = 2 … 5"
    points_to = say("the sphere's form deviates: turn it about its stem, or take another ball, and probe it again")
    coefficients = (Parameter("um", unit("µm"), 1.0),)
    size = Parameter("rms_um", unit("µm"), 1.0)
    columns = NORMAL

    def belongs_to(self, points: Points) -> bool:
        return self.owner is not None

    def sized(self, owner: FaultyArtefact) -> tuple[Parameter, ...]:
        return tuple(Parameter(f"c{degree}_{order}_um", unit("µm"), owner.size) for degree, order in HARMONICS)

    def basis(self, points: Points, shape: Sequence[float] = ()) -> Floats:
        self.whose()
        normals = normals_of(points)
        return -MICROMETRE * normals[:, :, None] * harmonics(normals, turned_back(points))[:, None, :]


# lobes of a ring's form and of probes: the size and the place of a ring are those of 0 and 1
ROUNDNESS = (2, 3, 4, 5, 6)


class OwnRoundness(OwnFault, OfDirections):
    """The ring itself is not round: two to six lobes, which turn with it."""

    name, title = "artefact_roundness", say("Roundness of the ring itself")
    formula = (
        "e = −Σ √2·(a_k·cos kθ + b_k·sin kθ)·n, k = 2 … 6, θ about the ring's axis less how far the ring was turned"
    )
    points_to = say(
        "the ring's form deviates: turn it about its axis and probe it again; what turns with it is its own"
    )
    coefficients = (Parameter("um", unit("µm"), 1.0),)
    size = Parameter("rms_um", unit("µm"), 1.0)
    columns = NORMAL

    def belongs_to(self, points: Points) -> bool:
        return self.owner is not None

    def sized(self, owner: FaultyArtefact) -> tuple[Parameter, ...]:
        return tuple(Parameter(f"{part}{k}_um", unit("µm"), owner.size) for k in ROUNDNESS for part in "ab")

    def basis(self, points: Points, shape: Sequence[float] = ()) -> Floats:
        self.whose()
        normals = normals_of(points)
        lobes = lobes_about(about_axis(normals, points.measurement) - turned_back(points))
        return -MICROMETRE * normals[:, :, None] * lobes[:, None, :]


def about_axis(directions: Floats, measurement: Ints) -> Floats:
    """Angles (n,), rad, of directions (n, 3) about the axis across those of each measurement; from X about Z."""
    found = np.empty(len(directions))
    for number in np.unique(measurement):
        own = measurement == number
        u, v, _ = frame_about(upward(np.linalg.svd(directions[own].T @ directions[own])[2][2]))
        found[own] = np.arctan2(directions[own] @ v, directions[own] @ u)
    return found


def lobes_about(angle: Floats) -> Floats:
    """Cosine and sine (n, 10) of each number of lobes, of mean square one over a turn."""
    each = np.multiply.outer(angle, ROUNDNESS)
    return np.asarray(np.sqrt(2.0) * np.stack([np.cos(each), np.sin(each)], axis=2).reshape(len(angle), -1))


def harmonics(normals: Floats, turned: Floats | float, of: Sequence[tuple[int, int]] = HARMONICS) -> Floats:
    """Of directions (n, 3), turned back about Z by angles, rad: degrees and orders (k,) as (n, k), of mean square one."""
    azimuth, found = np.arctan2(normals[:, 1], normals[:, 0]) - turned, []
    polar = np.arccos(np.clip(normals[:, 2], -1.0, 1.0))
    for degree, order in of:
        k = abs(order)
        legendre = scipy.special.lpmv(k, degree, np.cos(polar))
        log_ratio = scipy.special.gammaln(degree - k + 1) - scipy.special.gammaln(degree + k + 1)
        norm = np.sqrt((2 * degree + 1) * (1 if k == 0 else 2) * np.exp(log_ratio))
        found.append(norm * legendre * (np.cos(k * azimuth) if order >= 0 else np.sin(k * azimuth)))
    return np.column_stack(found)


def _about_set_up(points: Points) -> Floats:
    """(n, 3) places about the middle of each set-up, mm."""
    _, index = np.unique(points.measurement, return_inverse=True)
    return np.asarray(points.xyz - means_of(points.xyz, index.ravel()), dtype=np.float64)


def _flat(owner: FaultyArtefact, points: Points) -> tuple[Floats, Floats]:
    """Normal (n, 3) of a flat artefact as it lay, and place (n, 2) across it, over the largest distance from its middle."""
    places = owner.body.about_middle()
    u, v, normal = frame_about(upward(np.linalg.svd(places, full_matrices=False)[2][2]))
    poses = owner.body.poses(points)
    across = (places @ np.column_stack([u, v]))[poses.node] / owner.body.extent
    return np.asarray(poses.rotation @ normal), np.asarray(across)


def turned_back(points: Points) -> Floats:
    return np.radians(points.columns.get(TURNED, np.zeros(len(points))))


TEMPERATURE, SET_UP_TEMPERATURE = ArtefactTemperature(), SetUpTemperature()
BENDING, FIXTURE = ArtefactBending(), ArtefactFixture()
LOBES, FORM, OUT_OF_ROUND = OwnLobes(), OwnForm(), OwnRoundness()
EFFECTS: tuple[Effect, ...] = (TEMPERATURE, SET_UP_TEMPERATURE, BENDING, FIXTURE, LOBES, FORM, OUT_OF_ROUND)
