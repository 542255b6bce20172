"""Which places are one measurement of an artefact, which point of it each is, and what was measured again.

Figures say it first: an artefact has the same distances between its points in every measurement, and what comes to the same
place again is a repeat. Of the labels beside places, and the parts of their names, the one is taken by which this holds; words
break ties. Where nothing stands beside them, the order in which distances come again says it. Of two that fit alike, neither.
"""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Iterator, Sequence
from itertools import combinations

import numpy as np
import scipy

from cmm_uq.base.points import Floats, Ints
from cmm_uq.base.values import dataclass
from cmm_uq.jobs.importing import factors
from cmm_uq.jobs.importing.factors import LINE, POINT, RUN, Counted, Label, codes, counted, fixes, in_turn, together
from cmm_uq.jobs.importing.format import NotReadError
from cmm_uq.jobs.importing.header import plain_words, words_of
from cmm_uq.jobs.importing.roles import said

_SAME_PLACE_MM = 0.5
_RIGID_MM = 0.1
_EVEN_MM = 0.2  # to which the points of a plate are evenly spaced
_COMPARED = 5000  # points of which all places are compared; of more those that come again equally often
_CROWDED, _NEARLY = 20, 0.98  # points at one place, from which on they are a scan; part of the places
_MANY_ON_A_BALL = 50  # points of which some come to places of others, where scans cross
_PROBED, _ROUND, _LARGEST_BALL_MM, _FORM_MM = 9, 0.1, 75.0, 0.02  # of a ball that was probed
_ANGLE = re.compile(r"°(?!\s?[CF])|度|\bdeg\b")
# what speaks for a way, the strongest first
_TURNED, _WORDS, _MOVED, _RESTARTED, _NAMED, _AT_LEAST = 6.0, 5.0, 4.0, 3.0, 2.0, 1.0
_APART = 3  # times what repeats scatter, which is more than drift
_MOSTLY = 0.8  # names of one form, where the others are of something else
_SINGLE = 1.1  # names for each place, at most, of points that are measured in turn
_FEW, _SEVERAL = 3, 6  # points, which may be anything, and whose order alone says nothing


@dataclass(frozen=True)
class Grouping:
    """A way to tell places apart, and how much speaks for it."""

    rank: float
    of: Counted | None  # label that tells measurements apart; ``None`` where there is one
    measurement: Ints
    at: Ints  # a number for each place of each measurement
    point: Counted | None  # label of points; ``None`` where they count in turn


def places(xyz: Floats) -> Ints:
    """Number of the place of each point (n, 3): those within half a millimetre of the first there are one."""
    if len(xyz) > _COMPARED:
        return _places_of_many(xyz)
    found = np.full(len(xyz), -1, dtype=np.int64)
    firsts, count = np.empty_like(xyz), 0
    for i, one in enumerate(xyz):
        near = np.flatnonzero(np.abs(firsts[:count] - one).max(axis=1, initial=0) < _SAME_PLACE_MM)
        found[i] = near[0] if len(near) else count
        if not len(near):
            firsts[count] = one
            count += 1
    return found


def _places_of_many(xyz: Floats) -> Ints:
    """The same of thousands; each is a place of its own unless nearly all come again, as often as another."""
    tree, alone = scipy.spatial.KDTree(xyz), np.arange(len(xyz))
    some = tree.query_ball_point(xyz[:: len(xyz) // 200], _SAME_PLACE_MM, p=np.inf, return_length=True)
    if np.mean(some) > _CROWDED:
        return alone
    pairs = np.asarray(tree.query_pairs(_SAME_PLACE_MM, p=np.inf, output_type="ndarray"))
    graph = scipy.sparse.coo_array((np.ones(len(pairs)), tuple(pairs.T)), shape=(len(xyz), len(xyz)))
    joined = np.asarray(scipy.sparse.csgraph.connected_components(graph, directed=False)[1], dtype=np.int64)
    often = np.bincount(np.bincount(joined))
    return joined if often[2:].max(initial=0) > _NEARLY * often.sum() else alone


def _odd_among(names: Sequence[str]) -> bool:
    """Whether each has a name of its own, nearly all of one form but for numbers, two or more, and letters."""
    letters = (re.sub(r"(?<![^\W_])[A-Za-z](?![^\W\d_])", "a", factors.numberless(name)) for name in names)
    form, most = Counter(letters).most_common(1)[0]
    alike = form.count("0") > 1 and len({*names}) == len(names)
    return alike and _MOSTLY * len(names) < most < len(names)


def points_told_apart(labels: Sequence[Label], xyz: Floats) -> dict[str, list[str]] | None:
    """Measurement, point and repeat of each of the places (n, 3), mm; ``None`` where nothing says which belong together."""
    if any(label.sort == "column" and _odd_among(label.values) for label in labels):
        return None  # a few names are of something else, as of a drift check
    place = places(xyz)
    found = _named_by_level(every := factors.varying(labels, lengths=False))
    ways = [*filter(None, (_grouped(of, found, place, xyz) for of in _labels(found)))]
    each = int(place.max()) + 1  # of which a few have two names
    whole = (f for f in found if each <= f[1].max() < _SINGLE * each and fixes(f[1], place))
    ways += (Grouping(_NAMED, None, 0 * place, f[1], f) for f in whole)
    first = xyz[np.unique(place, return_index=True)[1]] if len(xyz) <= _COMPARED else xyz[:0]
    numbered = bool(found) and all(f[1].max() + 1 == len(xyz) for f in found)  # from first to last, as of one artefact
    plate = on_a_plate(first) or (numbered and on_a_plate(first, oblong=True)) or len(found) < len(every)
    named = any(way.of is None and way.rank and way.at.max() + 1 < len(xyz) for way in ways)  # names that come again
    if max((way.rank for way in ways), default=0) < _RESTARTED and len(xyz) <= _COMPARED and not (plate or named):
        ways += filter(None, (_grouped(of, found, place, xyz) for of in _in_turn(xyz)))
    names = (f for f in found if place.max() == 0 and f[1].max() + 1 == len(xyz) and f[0].sort == "column")
    names = (f for f in names if f[2] != RUN and not factors.counting(f[0].values))
    if any(f[2] == LINE or not all(map(str.isdecimal, f[0].values)) for f in names):
        return None  # as of styli, of which each came to one place
    every_row = factors.together(0 * place, *(f[1] for f in found)).max() + 1 == len(xyz)
    scanned = every_row and len(xyz) > _MANY_ON_A_BALL and 4 * (len(xyz) - place.max() - 1) < len(xyz)
    if scanned and _on_a_ball(xyz):
        return _told(Grouping(0.0, None, 0 * place, np.arange(len(xyz)), None), found, xyz, labels)
    if not found and place.max() + 1 == len(xyz) > _FEW and not any(way.rank for way in ways):
        return _told(Grouping(0.0, None, 0 * place, place, None), found, xyz, labels)  # a list, and nothing else
    if not plate and _copied(ways, xyz) and all(way.of is None or way.rank < _NAMED for way in ways):
        return None  # names of points, which may be one artefact in several places
    parts = [way for way in ways if plate and way.of and way.of[0].sort == "part" and way.rank < _WORDS]
    ways = [way for way in ways if way.rank >= _NAMED and not any(way is part for part in parts)]
    best = max(ways, key=lambda way: (way.rank, -way.measurement.max()), default=None)
    if best is None:
        return None
    roles = {value: said(value) for value in best.of[0].values} if best.of is not None else {}
    if len(roles) == 2 and len({*roles.values()}) == 2 and {"measured", "nominal"} & {*roles.values()}:
        sets = ", ".join(map(repr, roles))
        raise NotReadError(
            f"{sets} may be measured places and others of the same points", fix="Export the measured ones"
        )
    own = best.measurement
    alike = (way.measurement for way in ways if way.rank == best.rank)
    if best.rank <= _NAMED and not all(fixes(own, one) and fixes(one, own) for one in alike):
        return None
    return _told(best, found, xyz, labels)


def _named_by_level(found: Sequence[Counted]) -> list[Counted]:
    """Labels where points are counted anew at each level of one artefact, as of a ring: named by both."""
    level = next((f for f in found if not words_of("rows")["level"].isdisjoint(plain_words(f[0].words))), None)
    if level is None:
        return [*found]
    both = [(f, tuple(map(" ".join, zip(level[0].values, f[0].values, strict=True)))) for f in found if f[2] == POINT]
    named = [(Label(f[0].words, values, f[0].sort), codes(values), POINT) for f, values in both]
    return [*named, *(f for f in found if f is not level and f[2] != POINT)]


def _labels(found: Sequence[Counted]) -> Iterator[Counted | None]:
    """What may tell measurements apart: nothing, a label, two of them."""
    several = [one for one in found if one[1].max() + 1 < len(one[1])]
    yield None
    yield from several
    for one, other in combinations(several if len(found[0][1]) <= _COMPARED else [], 2) if found else ():
        both = together(one[1], other[1])
        if max(one[1].max(), other[1].max()) < both.max() < len(both) - 1:
            values = tuple(" ".join(pair) for pair in zip(one[0].values, other[0].values, strict=True))
            word = next((word for word in (POINT, LINE) if word in (one[2], other[2])), None)
            yield Label("", values, "part"), both, word


def _copied(ways: Sequence[Grouping], xyz: Floats) -> bool:
    """Whether rows in turn come again elsewhere, and are no rows of a lattice."""
    way = next((way for way in ways if way.rank and way.of and way.of[0].sort == "turn"), None)
    first = xyz[way.measurement == 0] if way and way.measurement.max() > 1 else xyz[:1]
    return len(first) > 2 and bool(np.linalg.svd(first - first.mean(axis=0), compute_uv=False)[1] > 1)


def _in_turn(xyz: Floats) -> Iterator[Counted]:
    """Rows in turn, as many as may be a measurement."""
    for size in (size for size in range(2, len(xyz) // 2 + 1) if len(xyz) % size == 0):
        own = np.arange(len(xyz)) // size
        yield Label("", tuple(f"{one + 1}" for one in own), "turn"), own, None


def _grouped(of: Counted | None, found: Sequence[Counted], place: Ints, xyz: Floats) -> Grouping | None:
    """Places told apart by a label of measurements; ``None`` where two of them would be one."""
    if of is None or place.max() + 1 == len(place):
        measurements = [np.zeros_like(place) if of is None else of[1]]
    else:  # words for placements hold, even where a plate has the same places in each, as in its own coordinates
        placed = counted(of[0], lengths=True) == LINE == of[2] and of[0].sort != "part"
        measurements = [*([] if placed else [_of_places(of[1], place)]), *([] if of[0].sort == "turn" else [of[1]])]
    told: list[Grouping] = []
    for measurement in measurements:
        at = together(measurement, place)
        each, several = int(at.max()) + 1, int(measurement.max()) > 0
        first = np.sort(np.unique(at, return_index=True)[1])
        names = [f for f in found if fixes(at, f[1]) and together(measurement, f[1]).max() + 1 == each]
        names.sort(key=lambda f: (f[2] != POINT, f[1].max(), f[0].sort == "part"))
        again = [f for f in names if f[1].max() + 1 < each]  # names that begin again in each measurement
        if each <= measurement.max() + 1:
            continue
        own = measurement[first]
        points = again[0][1][first] if again else in_turn(own) - 1
        whole = bool(again) or len(own) == (own.max() + 1) * (points.max() + 1)
        shape = _shape(xyz[first], own, points) if several and whole else ""
        point = again[0] if again else None if shape or not names else names[0]
        if several and not shape and at.max() > place.max() and of is not None and of[2] != LINE:
            rank = 0.0  # names begin again at places that were there
        elif several:
            rank = _rank(of, shape, named=bool(names), again=again[0] if again else None) if of else 0.0
            if of and of[0].sort in ("title", "sheet") and not rank and at.max() == place.max():
                rank = _MOVED * all(_on_a_ball(xyz[first][own == one]) for one in range(int(own.max()) + 1))
            if of and of[0].sort == "turn":
                # as far from the next as any other, as on a ring or a row: any number of them is alike
                chain = np.ptp(np.linalg.norm(np.diff(xyz[first], axis=0), axis=1)) < _RIGID_MM
                rank = 0.0 if chain else min(rank, _AT_LEAST) if each < _SEVERAL else rank
        else:
            rank = _NAMED if names or _on_a_ball(xyz[first]) or _each_again(found, place) else 0.0
        told.append(Grouping(rank, of, measurement, at, point))
        if names:
            return told[-1]
    return next(iter(told), None)


def _each_again(found: Sequence[Counted], place: Ints) -> bool:
    """Whether a word counts measurements, in each of which every place comes once, so that its order names it."""
    every, called = int(place.max()) + 1, words_of("columns")["measurement"]
    words = (f for f in found if not called.isdisjoint(plain_words(f[0].words)) or counted(f[0], lengths=True) == RUN)
    runs = (f[1] for f in words if every > _SEVERAL and factors.counting(f[0].values))
    return any(together(place, own).max() + 1 == every * (own.max() + 1) == len(place) for own in runs)


def _rank(of: Counted, shape: str, *, named: bool, again: Counted | None) -> float:
    """How much speaks for a label of measurements: the shape of their points, words, names that begin again."""
    letter = of[0].sort == "part" and all(len(one.rstrip("0123456789")) == 1 for one in of[0].values)
    if letter and of[2] == POINT and shape == "moved":
        return _NAMED  # P may be a position as well
    word = {LINE: 0.5, POINT: -0.5}.get(of[2] or "", 0.0)
    if shape == "same":
        return _RESTARTED if again and word > 0 and counted(of[0], lengths=True) == LINE else 0.0
    if shape == "turned":
        return _TURNED + word
    if word > 0 and (shape or named):
        return _WORDS
    if of[0].sort == "turn":
        return _AT_LEAST if shape else 0.0
    if of[2] == POINT:
        return 0.0
    if shape == "moved":
        return (_NAMED if of[0].sort == "part" else _RESTARTED if of[0].sort == "column" else _MOVED) + word
    called = again is not None and again[2] == POINT and not all(map(str.isalpha, again[0].values))
    return _RESTARTED if again and of[2] is None and (of[0].sort != "part" or called) else 0.0


def _of_places(key: Ints, place: Ints) -> Ints:
    """Labels as one where most of their places are the same, as those of a measurement that was repeated."""
    groups: list[set[int]] = []
    holding: dict[int, set[int]] = {}  # groups by place
    numbers = np.zeros(int(key.max()) + 1, dtype=np.int64)
    order = np.argsort(key, kind="stable")
    for one, rows in enumerate(np.split(order, np.flatnonzero(np.diff(key[order])) + 1)):
        own = {*place[rows].tolist()}
        near = {g for at in own for g in holding.get(at, ())}
        fits = [g for g in sorted(near) if len(groups[g] & own) > 0.6 * min(len(groups[g]), len(own))]
        numbers[one] = g = fits[0] if fits else len(groups)
        groups += [] if fits else [set()]
        groups[g] |= own
        for at in own:
            holding.setdefault(at, set()).add(g)
    return numbers[key]


def _shape(xyz: Floats, measurement: Ints, point: Ints) -> str:
    """How places that have the same distances in each measurement lie: ``turned``, ``moved``, or all the ``same``."""
    size, count = int(measurement.max()) + 1, int(point.max()) + 1
    if count < 2 or 2 * len(xyz) < size * count or size * count**2 > 4_000_000:
        return ""
    own = np.full((size, count, 3), np.nan)
    own[measurement, point] = xyz
    own = own[:, np.isfinite(own).all(axis=(0, 2))]  # one that is missing in a measurement is not compared
    if own.shape[1] < max(2, count / 2):
        return ""
    if np.ptp(np.linalg.norm(own[:, :, None] - own[:, None, :], axis=3), axis=0).max() > _RIGID_MM:
        return ""
    away = own - own[:1]
    if np.abs(away).max() < _SAME_PLACE_MM:
        return "same"
    return "turned" if np.ptp(away, axis=1).max() > 1 else "moved"


def on_a_plate(xyz: Floats, *, oblong: bool = False) -> bool:
    """Whether places (n, 3) lie in one plane, on one square grid; or on an oblong one of three rows and columns at least."""
    if len(xyz) < 6 or np.linalg.svd(about := xyz - xyz.mean(axis=0))[1][2] > _EVEN_MM * np.sqrt(len(xyz)):
        return False
    one = xyz[1 + int(np.linalg.norm(xyz[1:] - xyz[0], axis=1).argmin())] - xyz[0]
    pitch = np.linalg.norm(one)
    at = (xyz - xyz[0]) @ np.column_stack([one, np.cross(np.linalg.svd(about)[2][2], one)]) / pitch
    rows = np.diff(np.sort(at[:, 1])).max() if oblong else pitch
    steps = at / (pitch, max(rows, _EVEN_MM))
    even = np.abs(steps - np.round(steps)).max() * pitch < _EVEN_MM * 2
    return bool(even and np.ptp(steps, axis=0).min() > (1.5 if oblong else 0.5))


def _on_a_ball(xyz: Floats) -> bool:
    """Whether places (n, 3) are points probed on one ball: more than enough of them, all round, within a few micrometres."""
    about = xyz - xyz.mean(axis=0)
    if len(xyz) < _PROBED or np.linalg.svd(about, compute_uv=False)[2] < _ROUND * np.linalg.norm(about):
        return False
    sides = np.column_stack([2 * about, np.ones(len(xyz))])
    centre = np.linalg.lstsq(sides, np.sum(about**2, axis=1), rcond=None)[0][:3]
    distance = np.linalg.norm(about - centre, axis=1)
    return bool(distance.max() < _LARGEST_BALL_MM and np.ptp(distance) < _FORM_MM)


def scattered(xyz: Floats) -> bool:
    """Whether places (n, 3) are many, in no plane and on no ball, as targets about a part or a jig are."""
    thickness = np.linalg.svd(xyz - xyz.mean(axis=0), compute_uv=False)[2] / np.sqrt(len(xyz))
    return len(xyz) > _PROBED and bool(thickness > 1) and not _on_a_ball(xyz)


def _elsewhere(xyz: Floats, at: Ints, label: Ints) -> bool:
    """Whether what comes again at places (n, 3) lies closer together below each value of a label than in all."""
    away = xyz - _means(xyz, at)
    own = away - _means(away, both := together(at, label))
    return 2 * (int(both.max()) + 1) <= len(at) and bool(np.abs(away).max() > _APART * np.abs(own).max())


def _means(xyz: Floats, of: Ints) -> Floats:
    """Of the rows (n, 3) of the same number, for each."""
    sums = np.column_stack([np.bincount(of, own) for own in xyz.T])
    return (sums / np.bincount(of)[:, None])[of]


def _told(way: Grouping, found: Sequence[Counted], xyz: Floats, labels: Sequence[Label]) -> dict[str, list[str]] | None:
    """Names of measurement and point, and number of the repeat, of each place; ``None`` where repeats may be placements."""
    count, at, measurement = len(way.at), way.at, way.measurement
    named = [way.of[0].values] if way.of else []
    visits, run = in_turn(at), None
    if (most := int(visits.max())) > 1:
        runs = [f for f in found if f[2] == RUN or f[1].max() + 1 <= most]
        apart = [f for f in runs if together(at, f[1]).max() + 1 == count and (f[2] == RUN or f[1].max() + 1 == most)]
        run = min(apart, key=lambda f: (f[1].max() + 1 != most, f[2] != RUN), default=None)
        same = (
            one.values for one in labels if run and one.sort == "column" and np.array_equal(codes(one.values), run[1])
        )
        forms = {factors.numberless(value) for values in same for value in values}
        if run is not None and run[2] != RUN and forms and (len(forms) > 1 or forms.pop().count("0") != 1):
            return None  # which may be placements of what was measured in its own coordinates
        beside = [f for f in found if f[0].sort == "column" and f[2] is None and not fixes(at, f[1])]
        above = [f for f in found if f[0].sort in ("title", "sheet", "head") and f is not way.of]
        # as two stations from each of which all was measured twice, or two artefacts
        whole = ((one, f) for one in above for f in runs if f is not one and run is None)
        pairs: list[tuple[Counted, Counted | None]]
        pairs = [*whole]
        pairs += [(one, f) for one in beside for f in runs if run is None and f[2] == RUN != one[2]]
        pairs = [(one, f) for one, f in pairs if f and together(at, one[1], f[1]).max() + 1 == count]
        own = run if run and run[2] == RUN else None
        pairs += [(one, own) for one in above if one[2] != RUN and _elsewhere(xyz, at, one[1])]
        if run is None and not pairs and beside:
            return None
        if pairs:
            (one, run), *_ = pairs
            named, measurement, at = ([*named, one[0].values], together(measurement, one[1]), together(one[1], at))
    turned = (f for f in (way.of, run, *(f for f in found if most > 1 and f[1].max() > _FEW)) if f)
    if (turn := next((f[0].words for f in turned if _ANGLE.search(f[0].words)), None)) is not None:
        what = f"places come again at each {turn.strip()!r}, which may be of a table that turned"
        raise NotReadError(what, fix="Write a recording with it as c_deg: docs/reference/columns.md")
    first = np.unique(measurement, return_index=True)[1]
    texts = [" ".join(one[k] for one in named) or "1" for k in first]
    columns = {"measurement": [texts[m] for m in measurement.tolist()]}
    if way.point is not None:
        columns["point"] = [*way.point[0].values]
    else:
        rows = np.sort(np.unique(at, return_index=True)[1])
        turns = dict(zip(at[rows].tolist(), in_turn(measurement[rows]).tolist(), strict=True))
        columns["point"] = [f"{turns[one]}" for one in at.tolist()]
    if int((visits := in_turn(at)).max()) > 1:
        columns["repeat"] = [f"{n}" for n in (visits if run is None else factors.numbered_runs(run[0].values))]
    return columns
