"""How far points are from where an artefact has them, fitted robustly (Rousseeuw 1984), and mistakes undone until they fit."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from functools import lru_cache, partial
from itertools import combinations

import numpy as np

from cmm_uq.analysis.screening.columns import WAYS
from cmm_uq.base.messages import Text, Verbatim, commas, plural, say
from cmm_uq.base.points import AXES, Floats, Ints, Points
from cmm_uq.base.values import dataclass, field
from cmm_uq.machine.model.artefact import Placings

# Misfit that no machine's errors explain: so many mm, and so much of the artefact's size
TOLERANCE_MM, TOLERANCE_RATIO = 0.5, 5e-3
_SAMPLES = 120
_JUDGED = 1000
_PAIRS = 60
_ACROSS = 10.0  # where on a face the probe touched is nobody's business: misfit across a line counts by this less
Misfit = Callable[[Floats, Floats, float], Floats]


@dataclass(frozen=True, eq=False)
class ArtefactShape:
    """What one kind of artefact asks of the points of each of its set-ups."""

    rows: tuple[Ints, ...]  # points of each set-up, as rows of the recording
    # misfit (k,), mm, of a set-up's points (k, 3) and references (k, j) for the size common to all set-ups
    misfit_of: Misfit
    size: float  # that size by the certificate, mm; not finite without one
    extent: float  # of the artefact, mm, for the tolerance
    together: bool = False  # whether a set-up is lost with one of its points
    names: tuple[str, ...] = ()  # columns of the references
    reference: Floats = field(default_factory=lambda: np.zeros((0, 0)))  # (n, j) what the recording says of each point
    axes: Floats = field(default_factory=lambda: np.eye(3))  # (3, 3) unit vectors of the axes' motions, where they lean

    @property
    def is_bar(self) -> bool:
        """Whether its set-ups are lengths or positions of a bar, without references."""
        return self.misfit_of in (bar_misfit, ball_misfit) and not self.reference.shape[1]

    @property
    def tolerance(self) -> float:
        """Misfit, mm, beyond which a point is damaged."""
        return TOLERANCE_MM + TOLERANCE_RATIO * self.extent

    def misfit(self, xyz: Floats, reference: Floats, placings: Iterable[int] | None = None) -> Floats:
        """Distance (n,), mm, of every point from where the artefact would have it; zero outside the set-ups asked for."""
        xyz = xyz @ self.axes
        found, unknown = np.zeros(len(xyz)), self.misfit_of is bar_misfit and not np.isfinite(self.size)
        size = common_length(xyz, self.rows) if unknown else self.size
        for placing in range(len(self.rows)) if placings is None else placings:
            rows = self.rows[placing]
            found[rows] = self.misfit_of(xyz[rows], reference[rows], size)
        return found


@dataclass(frozen=True)
class Screening:
    """What a kind of measurement offers to the screening."""

    # (facts, points): what its artefact asks of the points; None where the recording lacks what that needs
    shape_of: Callable[..., ArtefactShape | None]
    balls: bool = False  # whether its points are centres of balls or cylinders, each of several touches


def bar_misfit(xyz: Floats, _: Floats, length: float) -> Floats:
    return np.full(2, abs(float(np.linalg.norm(xyz[1] - xyz[0])) - length))


def line_misfit(xyz: Floats, reference: Floats, _: float) -> Floats:
    """Direction by the median slope over distant pairs (Theil–Sen), place by the median."""
    r = reference[:, 0]
    if len(r) <= _PAIRS:
        i, j = np.triu_indices(len(r), 1)
    else:
        order = np.argsort(r)
        i, j = order[: len(r) - len(r) // 2], order[len(r) // 2 :]
    steps = r[j] - r[i]
    far = np.abs(steps) >= 0.5 * np.abs(steps).max()
    slope = np.median((xyz[j] - xyz[i])[far] / steps[far, None], axis=0)
    if not np.any(slope):
        return np.full(len(r), np.inf)
    direction = slope / np.linalg.norm(slope)
    off = xyz - r[:, None] * direction
    off = off - np.median(off, axis=0)
    along = off @ direction
    across = np.linalg.norm(off - along[:, None] * direction, axis=1)
    return np.asarray(np.maximum(np.abs(along), across / _ACROSS), dtype=np.float64)


def body_misfit(xyz: Floats, body: Floats, _: float) -> Floats:
    """Placed by the three balls that suit half of all best, then by all that agree with these."""
    if len(xyz) < 3:
        return np.zeros(len(xyz))
    samples = _broad(body, np.array([np.arange(3)]) if len(xyz) == 3 else samples_of(len(xyz), 3))
    some = _some(len(xyz))
    misfits = np.linalg.norm(xyz[some] - _placed(body[some], body[samples], xyz[samples]), axis=2)
    chosen = samples[[np.argmin(np.median(misfits, axis=1))]]
    best = np.linalg.norm(xyz - _placed(body, body[chosen], xyz[chosen])[0], axis=1)
    agree = np.flatnonzero(best <= max(4 * float(np.median(best)), TOLERANCE_MM))
    if len(agree) < 3:
        return np.asarray(best, dtype=np.float64)
    return np.asarray(np.linalg.norm(xyz - _placed(body, body[agree][None], xyz[agree][None])[0], axis=1))


def _broad(points: Floats, samples: Ints) -> Ints:
    spanned = points[samples]
    areas = np.linalg.norm(np.cross(spanned[:, 1] - spanned[:, 0], spanned[:, 2] - spanned[:, 0]), axis=1)
    return np.asarray(samples[areas >= 0.2 * areas.max(initial=0.0)], dtype=np.int64)


def _placed(body: Floats, own: Floats, found: Floats) -> Floats:
    """All points of a body (k, 3), placed by each sample of it (s, j, 3) where that was found, (s, k, 3) (Kabsch 1976)."""
    own_middle, found_middle = own.mean(axis=1, keepdims=True), found.mean(axis=1, keepdims=True)
    U, _, Vt = np.linalg.svd(np.einsum("sji,sjk->sik", found - found_middle, own - own_middle))
    U[:, :, 2] *= np.sign(np.linalg.det(U @ Vt))[:, None]
    turn = U @ Vt
    return np.asarray(np.einsum("sij,skj->ski", turn, body[None] - own_middle) + found_middle, dtype=np.float64)


def ball_misfit(xyz: Floats, _: Floats, radius: float) -> Floats:
    """Through the four points whose sphere suits half of all best."""
    samples = samples_of(len(xyz), 4)
    about = xyz - np.median(xyz, axis=0)
    four = about[samples]
    scale = max(float(np.median(np.linalg.norm(about, axis=1))), 1e-9)
    equations = np.concatenate([2 * four / scale, np.ones((len(four), 4, 1))], axis=2)
    sound = np.abs(np.linalg.det(equations)) > 1e-3
    if not sound.any():
        return np.zeros(len(xyz))
    squares = np.sum(four[sound] ** 2, axis=2)[:, :, None] / scale
    centres = np.linalg.solve(equations[sound], squares)[:, :3, 0]
    distances = np.linalg.norm(about[None, _some(len(xyz))] - centres[:, None], axis=2)
    radii = np.median(distances, axis=1) if np.isnan(radius) else np.full(len(centres), radius)
    best = np.argmin(np.median(np.abs(distances - radii[:, None]), axis=1))
    away, nearest = recentred(about - centres[best], float(radii[best]), free=bool(np.isnan(radius)))
    return np.asarray(np.abs(np.linalg.norm(away, axis=1) - nearest), dtype=np.float64)


def recentred(away: Floats, radius: float, *, free: bool) -> tuple[Floats, float]:
    """Points (k, 3) about the centre of the sphere through those near to one, and its radius: Gauss–Newton, trimmed."""
    for _ in range(5):
        distance = np.maximum(np.linalg.norm(away, axis=1), 1e-9)
        off = distance - radius
        near = np.abs(off) <= max(3 * float(np.median(np.abs(off))), 1e-3)
        design = np.column_stack([away / distance[:, None], np.ones(len(away))])[near, : 4 if free else 3]
        step, *_rest = np.linalg.lstsq(design, off[near], rcond=1e-6)
        away = away - step[:3]
        radius += float(step[3]) if free else 0.0
    return away, radius


def flat_misfit(xyz: Floats, _: Floats, __: float) -> Floats:
    """Through the three points whose plane suits half of all best."""
    samples = xyz[_broad(xyz, samples_of(len(xyz), 3))]
    normals = np.cross(samples[:, 1] - samples[:, 0], samples[:, 2] - samples[:, 0])
    lengths = np.linalg.norm(normals, axis=1, keepdims=True)
    if not np.all(lengths):
        return np.zeros(len(xyz))
    normals = normals / lengths
    misfits = np.abs(np.einsum("ski,si->sk", xyz[None, _some(len(xyz))] - samples[:, :1], normals))
    best = np.argmin(np.median(misfits, axis=1))
    return np.asarray(np.abs((xyz - samples[best, 0]) @ normals[best]), dtype=np.float64)


def rows_by(numbers: Ints) -> tuple[Ints, ...]:
    """Rows of the recording (k,) for each different number of ``numbers`` (n,)."""
    return Placings.of(numbers).rows


@lru_cache(maxsize=16)
def samples_of(count: int, size: int) -> Ints:
    """Rows of different points, the same for every recording of so many."""
    return np.argsort(np.random.default_rng(count).random((_SAMPLES, count)), axis=1)[:, :size].copy()


def _some(count: int) -> Ints:
    return np.unique(np.linspace(0, count - 1, min(count, _JUDGED)).astype(np.int64))


def common_length(xyz: Floats, rows: tuple[Ints, ...]) -> float:
    """Median distance, mm, of the first two points of each set-up."""
    ends = np.array(rows)
    return float(np.median(np.linalg.norm(xyz[ends[:, 1]] - xyz[ends[:, 0]], axis=1)))


def spread(xyz: Floats) -> float:
    return float(np.linalg.norm(np.ptp(xyz, axis=0)))


def no_references(points: Points) -> Floats:
    """References (n, 0) of a recording that has none."""
    return np.zeros((len(points), 0))


# millimetres in what the recording may hold instead
UNITS = ((25.4, say("inches")), (1e3, say("metres")), (1e-3, say("micrometres")), (10.0, say("centimetres")))
TWICE = ((1 / 25.4, say("inches converted twice")),)
COORDINATES = tuple(f"{a}_mm" for a in AXES)


@dataclass(frozen=True, eq=False)
class Mistake:
    kind: str
    what: Text  # the mistake, as a sentence without its full stop
    fix: Text
    columns: tuple[str, ...]
    undo: Callable[[Floats], Floats]  # makes coordinates (k, 3), or references (k, j), as they would be without it
    of_references: bool = False
    edges: int = 0  # rows that it cannot mend

    def apply(self, xyz: Floats, reference: Floats) -> tuple[Floats, Floats]:
        return (xyz, self.undo(reference)) if self.of_references else (self.undo(xyz), reference)


def row_mistakes(shape: ArtefactShape) -> tuple[Mistake, ...]:
    """Every mistake that may concern a single row as well as many, the commoner first."""
    mistakes = [*_units(COORDINATES), *_signs(COORDINATES), *_exchanges(COORDINATES)]
    if shape.names and shape.names[0].endswith("_mm"):
        mistakes += _units(shape.names, of_references=True)
    elif shape.names:
        mistakes += [*_signs(shape.names, of_references=True), *_exchanges(shape.names, of_references=True)]
    return (*mistakes, *_units(COORDINATES, units=TWICE))


def block_mistakes(shape: ArtefactShape) -> tuple[Mistake, ...]:
    """Mistakes that concern many rows together, or none: columns that slipped by a row, faces counted from the other end."""
    mistakes, count = [], len(shape.names)
    of_references = [tuple(range(count))] * (count > 0) + [(i,) for i in range(count) if count > 1]
    for by, way in WAYS:
        mistakes += [_shift((i,), COORDINATES, by, way) for i in range(3)]
        mistakes += [_shift(chosen, shape.names, by, way, of_references=True) for chosen in of_references]
    if shape.names == ("reference_mm",):
        what, fix = say("its faces seem counted from the other end"), say("Turn the order of reference_mm round")
        mistakes.append(Mistake("swapped", what, fix, shape.names, _from_the_other_end, of_references=True))
    return tuple(mistakes)


def _units(
    names: tuple[str, ...], *, of_references: bool = False, units: tuple[tuple[float, Text], ...] = UNITS
) -> Iterator[Mistake]:
    for factor, unit in units:
        for chosen in (tuple(range(len(names))), *((i,) for i in range(len(names)) if len(names) > 1)):
            columns, concerned = _named(names, chosen)
            one = say("{columns} looks like {unit}, not mm", columns=columns, unit=unit)
            many = say("{columns} look like {unit}, not mm", columns=columns, unit=unit)
            what, fix = plural(len(chosen), one=one, many=many), say("Convert to mm (times {factor:g})", factor=factor)
            undo = partial(np.multiply, np.where(np.isin(np.arange(len(names)), chosen), factor, 1.0))
            yield Mistake("unit", what, fix, concerned, undo, of_references)


def _signs(names: tuple[str, ...], *, of_references: bool = False) -> Iterator[Mistake]:
    for chosen in (*((i,) for i in range(3)), *([(0, 1, 2)] if of_references else [])):
        columns, concerned = _named(names, chosen)
        one = say("{columns} seems to have the wrong sign", columns=columns)
        many = say("{columns} seem to have the wrong sign", columns=columns)
        what = plural(len(chosen), one=one, many=many)
        undo = partial(np.multiply, np.where(np.isin(np.arange(3), chosen), -1.0, 1.0))
        yield Mistake("sign", what, say("Turn the sign round"), concerned, undo, of_references)


def _exchanges(names: tuple[str, ...], *, of_references: bool = False) -> Iterator[Mistake]:
    for i, j in combinations(range(3), 2):
        order = np.arange(3)
        order[[i, j]] = j, i
        what = say("{one} and {other} seem exchanged", one=Verbatim(names[i]), other=Verbatim(names[j]))
        undo = partial(np.take, indices=order, axis=1)
        yield Mistake("exchanged coordinates", what, say("Exchange them"), (names[i], names[j]), undo, of_references)


def _shift(
    chosen: tuple[int, ...], names: tuple[str, ...], by: int, way: Text, *, of_references: bool = False
) -> Mistake:
    def undo(values: Floats) -> Floats:
        values = values.copy()
        values[:, chosen] = np.roll(values[:, chosen], by, axis=0)
        return values

    (columns, concerned), fix = _named(names, chosen), say("Move the column back beside the others")
    one = say("{columns} seems shifted {way} by one row against the other columns", columns=columns, way=way)
    many = say("{columns} seem shifted {way} by one row against the other columns", columns=columns, way=way)
    what = plural(len(chosen), one=one, many=many)
    return Mistake("shifted column", what, fix, concerned, undo, of_references, 1)


def _from_the_other_end(reference: Floats) -> Floats:
    faces, rank = np.unique(reference, return_inverse=True)
    return np.asarray(faces[::-1][rank].reshape(reference.shape), dtype=np.float64)


def _named(names: tuple[str, ...], chosen: tuple[int, ...]) -> tuple[Text, tuple[str, ...]]:
    """Some of the columns in words, and their names."""
    concerned = tuple(names[i] for i in chosen)
    return commas(map(Verbatim, concerned)), concerned
