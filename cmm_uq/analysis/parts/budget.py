"""Where the uncertainty of a part's characteristics comes from, and its causes in words.

Shares of the variance by cause are Sobol's, by drawing one cause anew and keeping the others: *first* is what knowing the
cause alone would take away (Saltelli et al. 2010, Comput. Phys. Commun. 181, table 2 b), *total* what would remain if all else
were known (Jansen 1999, table 2 f). They are equal where causes only add up; of a position or a form they differ.

Errors of a machine hang together, so that no variance of one of them alone is a part of the whole. The share of each is what
knowing it alone would take away, with what it tells of the others: the first-order index of dependent inputs (Kucherenko,
Tarantola, Annoni 2012, Comput. Phys. Commun. 183) of the linear part, the square of a multiple correlation. It lies between 0
and 1; errors that are tied to each other have shares that add up to more, errors that make up for each other to less.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence

import numpy as np

from cmm_uq.analysis.parts.causes.cause import LARGE, Drawn, PartCause, Rows
from cmm_uq.analysis.parts.causes.machine import MACHINE, NOISE, STYLUS
from cmm_uq.analysis.parts.causes.surroundings import FIXTURE, FORM, OPERATOR, ROUNDING, TEMPERATURE
from cmm_uq.analysis.parts.virtual import AtPose, Virtual, in_parts
from cmm_uq.base.messages import Text, Verbatim, say
from cmm_uq.base.points import Floats
from cmm_uq.base.values import dataclass
from cmm_uq.jobs.part.feature import Kind

DRAWS = 2**13  # of each of the two samples; shares are then known to about one in a hundred
PLACE = "place on the table"
POINT_DRAWS = 2_000  # A standard deviation is then known to two percent; of thousands of points to three
_BLOCK = 300_000  # coordinates drawn at once
_NEGLIGIBLE = 1e-9  # of the largest, a singular value of rigid motions that points do not tell from others
KINDS: Mapping[Kind, Text] = {
    "point": say("point"),
    "line": say("line"),
    "plane": say("plane"),
    "circle": say("circle"),
    "sphere": say("sphere"),
    "cylinder": say("cylinder"),
    "cone": say("cone"),
}
CHARACTERISTICS: Mapping[str, Text] = {
    "size": say("diameter"), "straightness": say("straightness"), "flatness": say("flatness"),
    "roundness": say("roundness"), "cylindricity": say("cylindricity"), "sphericity": say("sphericity"),
    "distance": say("distance"), "angle": say("angle"), "parallelism": say("parallelism"),
    "perpendicularity": say("perpendicularity"), "angularity": say("angularity"), "position": say("position"),
    "coaxiality": say("coaxiality"), "x": say("x coordinate"), "y": say("y coordinate"), "z": say("z coordinate"),
    "circular_runout": say("circular runout"), "total_runout": say("total runout"),
}  # fmt: skip
ASSOCIATIONS: Mapping[str, Text] = {
    "least_squares": say("least squares"), "minimum_zone": say("minimum zone"),
    "maximum_inscribed": say("maximum inscribed"), "minimum_circumscribed": say("minimum circumscribed"),
    "tangent": say("tangent"),
}  # fmt: skip
# causes by what their lines in the budget begin with, in the order in which they are drawn
FAMILIES: Mapping[str, Text] = {
    MACHINE: say("Errors of the machine"), NOISE: say("Noise of readings"), STYLUS: say("Stylus"),
    TEMPERATURE: say("Temperature"), FORM: say("Form of the part"), FIXTURE: say("Clamping"),
    OPERATOR: say("Operator and set-up"), PLACE: say("Place on the table"),
    ROUNDING: say("Last digits of the report"),
}  # fmt: skip
_FACTORS: Mapping[str, Text] = {
    "noise: reading": say("Noise of a reading"), "noise: set-up": say("Noise that a set-up adds"),
    "noise: slow": say("Slow noise"), "noise: growing": say("Noise that grows with length"),
    "temperature: part": say("Temperature and expansion of the part"),
    "temperature: gradient in the part": say("Gradient of temperature in the part"),
    "temperature: scale x": say("Temperature of the scale of X"),
    "temperature: scale y": say("Temperature of the scale of Y"),
    "temperature: scale z": say("Temperature of the scale of Z"),
    "temperature: warming of the part": say("Warming of the part while it is probed"),
    "temperature: warming of scale x": say("Warming of the scale of X while the part is probed"),
    "temperature: warming of scale y": say("Warming of the scale of Y while the part is probed"),
    "temperature: warming of scale z": say("Warming of the scale of Z while the part is probed"),
    "fixture: fixture": say("Clamping"), "operator: reproducibility of points": say("Reproducibility of a point"),
}  # fmt: skip
# beginnings of lines that go on with a name of the user's
_NAMED: Mapping[str, Callable[[Text], Text]] = {
    "stylus: tip size ": lambda name: say("Size of the tip of {name}", name=name),
    "stylus: tip offset ": lambda name: say("Offset of the tip of {name}", name=name),
    "stylus: lobing ": lambda name: say("Pre-travel over directions, {name}", name=name),
    "form: form of ": lambda name: say("Form of {name}", name=name),
    "form: roughness of ": lambda name: say("Roughness of {name}", name=name),
    "operator: reproducibility of ": lambda name: say("Reproducibility of {name}", name=name),
    "rounding: last digit of ": lambda name: say("Last digit of {name} in the report", name=name),
}


def family_of(line: str) -> str:
    """The cause to which a line of the budget belongs."""
    return line if line == PLACE else line.partition(": ")[0]


def line_in_words(line: str, effects: Mapping[str, Text]) -> Text:
    """A line of the budget: a cause, or one factor of it."""
    if line in _FACTORS:
        return _FACTORS[line]
    for begin, words in _NAMED.items():
        if line.startswith(begin):
            return words(Verbatim(line.removeprefix(begin)))
    family, _, factor = line.partition(": ")
    if line in FAMILIES:
        return FAMILIES[line]
    if family == MACHINE:
        return effects.get(factor, Verbatim(factor))
    return Verbatim(line)


@dataclass(frozen=True, eq=False)
class VarianceShares:
    """Shares of the variance of c characteristics."""

    characteristics: tuple[str, ...]  # c names
    causes: tuple[str, ...]  # g names; independent of each other
    # first, total: (g, c) shares of the variance
    first: Floats
    total: Floats
    factors: tuple[str, ...]  # f names of the machine's errors that its certificate states together
    within: Floats  # (f, c) shares of each, by itself
    u: Floats  # (c,) standard uncertainties in this sample, mm and rad

    def told(
        self, characteristic: str, named: Mapping[str, Text], least: float = 0.05
    ) -> tuple[tuple[str, float, Text], ...]:
        """What should be told beside a result, largest first: line or factor, its share, and why.

        ``named``: by factor, why (:attr:`Virtual.named`).
        """
        column = self.characteristics.index(characteristic)
        shares = {line: self.share(line, column) for line in (*self.causes, *self.factors)}
        found = [(line, share, named[line.partition(": ")[2]]) for line, share in shares.items()
                 if share >= least and line.partition(": ")[2] in named]  # fmt: skip
        return tuple(sorted(found, key=lambda each: -each[1]))

    def share(self, line: str, column: int) -> float:
        """Of a cause, in total, or of a factor, in the variance of a characteristic: 0 to 1, as far as draws know it."""
        of, shares = (self.causes, self.total) if line in self.causes else (self.factors, self.within)
        return float(np.clip(shares[of.index(line), column], 0.0, 1.0))

    def worst(self, characteristic: str) -> str:
        """The cause, or the factor where it is the machine's, of the largest part of a variance."""
        column = self.characteristics.index(characteristic)
        shares = dict(zip(self.causes, self.total[:, column], strict=True))
        cause = max(shares, key=lambda name: shares[name])
        own = [i for i, name in enumerate(self.factors) if name.startswith(f"{cause}: ")]
        return self.factors[max(own, key=lambda i: self.within[i, column])] if own else cause


def line_of(cause: PartCause) -> str:
    """The line of the budget by cause that a cause belongs to."""
    names = set(cause.factors)
    return f"{cause.name}: {names.pop()}" if len(names) == 1 else cause.name


def variance_shares(virtual: Virtual, draws: int = DRAWS, seed: int = 0) -> VarianceShares:
    """Shares of the variance of each characteristic."""
    random, places = np.random.default_rng(seed), virtual.places
    each = max(2, draws // len(places))
    causes = places[0].causes
    lines = list(dict.fromkeys(line_of(cause) for cause in causes if cause.factors))
    # the second sample stands in other places, so that nothing of it is that of the first
    elsewhere = [places[i] for i in random.permutation(len(places))]
    several = [cause for cause in causes if len(set(cause.factors)) > 1]
    drawn = [list[Drawn]() for _ in several]

    def sampled(part: int) -> list[Floats]:
        A = [place.drawn(random, part) for place in places]
        B = [place.drawn(random, part) for place in places]
        exchanged = (
            [[b if line_of(cause) == line else a for a, b, cause in zip(*own, causes, strict=True)]
             for own in zip(A, B, strict=True)] for line in lines
        )  # fmt: skip
        by_cause = zip(causes, zip(*A, strict=True), strict=True)
        for whole, own in zip(drawn, (own for cause, own in by_cause if cause in several), strict=True):
            whole += own
        samples = ((places, A), (elsewhere, B), *((places, mixed) for mixed in exchanged), (elsewhere, A))
        return [_errors(*each, virtual.exact) for each in samples[: None if len(places) > 1 else -1]]

    yA, yB, *mixed = map(np.concatenate, zip(*map(sampled, in_parts(virtual.plan, each)), strict=True))
    both = np.vstack([yA, yB])
    variance = np.maximum(both.var(axis=0), np.finfo(np.float64).tiny)
    centred = yB - both.mean(axis=0)
    first = [np.mean(centred * (y - yA), axis=0) / variance for y in mixed]
    total = [0.5 * np.mean((y - yA) ** 2, axis=0) / variance for y in mixed]
    factors, within = _within(several, drawn, yA)
    names, u = (*lines, *([PLACE] if len(places) > 1 else [])), np.sqrt(variance)
    return VarianceShares(tuple(virtual.names), names, np.array(first), np.array(total), factors, within, u)


def _errors(places: Sequence[AtPose], coefficients: Sequence[Sequence[Drawn]], exact: bool) -> Floats:
    return np.concatenate([place.errors(given, exact=exact) for place, given in zip(places, coefficients, strict=True)])


def _within(causes: Sequence[PartCause], drawn: Sequence[Sequence[Drawn]], y: Floats) -> tuple[tuple[str, ...], Floats]:
    """Names of factors of causes, and their shares (f, c)."""
    names, shares = list[str](), list[Floats]()
    centred = y - y.mean(axis=0)
    variance = np.maximum(y.var(axis=0), np.finfo(np.float64).tiny)
    for cause, blocks in zip(causes, drawn, strict=True):
        for factor in dict.fromkeys(cause.factors):
            columns = np.flatnonzero([name == factor for name in cause.factors])
            own, end = np.empty((len(y), len(columns)), order="F"), 0
            for one in blocks:
                rows, end = slice(end, end + len(one)), end + len(one)
                own[rows] = one.of(columns) if isinstance(one, Rows) else one[:, columns]
            own -= own.mean(axis=0)
            explained = own @ np.linalg.lstsq(own, centred, rcond=None)[0]
            chance = own.shape[1] / len(own)  # what as many columns explain of anything
            share = np.mean(explained**2, axis=0) / variance
            names.append(f"{cause.name}: {factor}")
            shares.append(np.clip((share - chance) / (1 - chance), 0.0, 1.0))
    return tuple(names), np.array(shares).reshape(len(names), y.shape[1])


@dataclass(frozen=True, eq=False)
class PointErrors:
    """Errors of points: indicated less true, in the frame of the part."""

    mean: Floats  # (n, 3) mm
    covariance: Floats  # (n, 3, 3) of each point, mm²


def point_errors(virtual: Virtual, draws: int = POINT_DRAWS, seed: int = 0) -> PointErrors:
    """Mean and covariance of the error of each point, each place as often as the others."""
    points, random = virtual.plan.points, np.random.default_rng(seed)
    n, rigid = len(points), _rigid(points)
    draws = max(draws // 4, min(draws, draws * LARGE // max(n, 1)))
    block, each = max(1, min(draws, _BLOCK // (3 * n))), max(1, -(-draws // len(virtual.whole)))
    total, first, second = 0, np.zeros((n, 3)), np.zeros((n, 3, 3))
    for place in virtual.whole:
        for start in range(0, each, block):
            count = min(block, each - start)
            whole = (place.base + place.moved(place.drawn(random, count))).reshape(count, 3 * n)
            off = (whole - (whole @ rigid) @ rigid.T).reshape(count, n, 3)
            first += off.sum(axis=0)
            second += np.einsum("kni,knj->nij", off, off)
            total += count
    mean = first / total
    return PointErrors(mean, second / total - mean[:, :, None] * mean[:, None, :])


def _rigid(points: Floats) -> Floats:
    """(3n, r) orthonormal displacements of small shifts and turns of points (n, 3)."""
    about = points - points.mean(axis=0)
    span = max(float(np.abs(about).max()), 1.0)
    shifts = [np.tile(axis, (len(points), 1)) for axis in np.eye(3)]
    turns = [np.cross(axis, about) / span for axis in np.eye(3)]
    motions = np.array([*shifts, *turns]).reshape(6, -1)
    _, size, rows = np.linalg.svd(motions, full_matrices=False)
    return np.asarray(rows[size > _NEGLIGIBLE * size[0]].T)
