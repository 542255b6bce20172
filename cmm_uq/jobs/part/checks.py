"""Where the part lies in the machine, and what its axes read at a point.

What a part's tables say together: names that lead somewhere, datums that fix a frame, a part within the travel.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence

import numpy as np

from cmm_uq.base.errors import CmmUqError, Gathered, suggestion
from cmm_uq.base.points import AXES, Floats, beyond_travel
from cmm_uq.jobs.part.characteristic import CharacteristicFacts, with_article
from cmm_uq.jobs.part.datums import BETWEEN, as_one, freedoms, members
from cmm_uq.jobs.part.feature import ASSOCIATIONS, FEWEST, material_condition
from cmm_uq.jobs.part.probed import Probed
from cmm_uq.jobs.part.tables import PartFile, Places, PlacingFacts, StylusFacts


def rotation(placing: PlacingFacts) -> Floats:
    """(3, 3) coordinates of the machine = rotation · those of the part + origin: about x, then y, then z of the machine."""
    a, b, c = np.radians(placing.rotation_deg)
    about_x = np.array([[1, 0, 0], [0, np.cos(a), -np.sin(a)], [0, np.sin(a), np.cos(a)]])
    about_y = np.array([[np.cos(b), 0, np.sin(b)], [0, 1, 0], [-np.sin(b), 0, np.cos(b)]])
    about_z = np.array([[np.cos(c), -np.sin(c), 0], [np.sin(c), np.cos(c), 0], [0, 0, 1]])
    return np.asarray(about_z @ about_y @ about_x)


def readings(feature: Probed, stylus: StylusFacts, facts: PartFile) -> Floats:
    """(n, 3) what the scales read while a feature is probed, mm: of the ram's reference point, which is not at the tip.

    Where the job does not say where the part lies, it lies at the origin.
    """
    centres = feature.points + 0.5 * stylus.diameter_mm * feature.normals
    origin = facts.placing.origin_mm or [0.0, 0.0, 0.0]
    placed = centres @ rotation(facts.placing).T + origin
    return np.asarray(placed - stylus.offset_mm + np.array(facts.machine_state.origin_mm))


# of a nominal orientation: what is off by more than a degree is another orientation than the drawing's
_NEARLY = np.sin(np.radians(1.0))
_FAR = 0.1  # share of a nominal size by which the middle of its limits may lie beside it, for fits


def check_names(facts: PartFile, places: Places, wrong: Gathered) -> None:
    """Gather names that stand twice or lead nowhere."""
    for table, named in (
        ("stylus", facts.stylus),
        ("feature", facts.feature),
        ("characteristic", facts.characteristic),
    ):
        names = [one.name for one in named]
        for i, name in enumerate(names):
            if name in names[:i]:
                wrong.add(CmmUqError(f"the {table} {name!r} stands there twice", where=places.of(table, "name", i),
                                     fix="Give each a name of its own"))  # fmt: skip
    styli, features = [one.name for one in facts.stylus], [one.name for one in facts.feature]
    for i, feature in enumerate(facts.feature):
        if not feature.stylus and len(styli) > 1:
            said = f"there are {len(styli)} styli, and {feature.name!r} does not say which probes it"
            where = places.of("feature", "stylus", i)
            wrong.add(CmmUqError(said, where=where, fix=f"Give stylus = {styli[0]!r} or another"))
        _known([feature.stylus] if feature.stylus else [], styli, "stylus", places.of("feature", "stylus", i), wrong)
    _datums(facts.alignment.datums, features, places.of("alignment", "datums"), wrong)
    for i, one in enumerate(facts.characteristic):
        _known(one.features, features, "feature", places.of("characteristic", "features", i), wrong)
        _datums(one.datums, features, places.of("characteristic", "datums", i), wrong)
    order = facts.probing.order
    _known(order, features, "feature", places.of("probing", "order"), wrong)
    left = [name for name in features if name not in order]
    if order and (left or len(order) != len(features)):
        said = f"leaves {left[0]!r} out" if left else "names a feature twice"
        wrong.add(CmmUqError(said, where=places.of("probing", "order"), fix="Name each feature once"))


def _known(names: Sequence[str], known: Sequence[str], what: str, where: str, wrong: Gathered) -> None:
    for name in names:
        if name not in known:
            wrong.add(CmmUqError(f"there is no {what} {name!r}", where=where, fix=suggestion(name, known)))


def _datums(names: Sequence[str], known: Sequence[str], where: str, wrong: Gathered) -> None:
    """Datums are features, or common datums of features, each of which stands in one of them."""
    taken: list[str] = []
    for name in names:
        try:
            own = members(name, known)
        except CmmUqError as error:
            condition = material_condition(name)
            problem = f"the datum {name!r} {condition}" if condition else error.problem
            fix = "Leave the characteristic out, and name it in [part] not_measured" if condition else error.fix
            wrong.add(CmmUqError(problem, where=where, fix=fix))
            continue
        twice = next((each for each in own if each in taken), None)
        if twice is not None:
            wrong.add(CmmUqError(f"{twice!r} stands in two of these datums", where=where, fix="Name it in one of them"))
        taken += own


def check_plan(facts: PartFile, features: Mapping[str, Probed], places: Places, wrong: Gathered) -> None:
    """Gather what the tables say against each other; all names lead somewhere."""
    for check in (_tips, _common_faces, _alignment, _characteristics, _travel):
        for error in check(facts, features, places):
            wrong.add(error)


def _tips(facts: PartFile, features: Mapping[str, Probed], places: Places) -> Iterator[CmmUqError]:
    styli = {one.name: one for one in facts.stylus}
    for i, one in enumerate(facts.feature):
        tip = styli[one.stylus or facts.stylus[0].name].diameter_mm
        if one.inner and one.diameter_mm is not None and tip >= one.diameter_mm:
            yield CmmUqError(f"a tip of {tip:g} mm does not fit into {one.name!r}, a hole of {one.diameter_mm:g} mm",
                             where=places.of("feature", "diameter_mm", i), fix="Name a smaller stylus")  # fmt: skip


def _common_faces(facts: PartFile, features: Mapping[str, Probed], places: Places) -> Iterator[CmmUqError]:
    """That a common datum on points of one face has as many as a plane needs."""
    tables = [("alignment", None, facts.alignment.datums), *(
        ("characteristic", i, one.datums) for i, one in enumerate(facts.characteristic)
    )]  # fmt: skip
    told: set[str] = set()
    for table, number, datums in tables:
        for name in datums:
            own = _named(name, features)
            if len(own) < 2 or name in told or as_one(own)[0] != "plane":
                continue
            if sum(len(one.points) for one in own) < FEWEST["plane"]:
                told.add(name)
                every = BETWEEN.join(datums)
                yield CmmUqError(f"the datum {name!r} is on {len(own)} points of one face, which are no plane",
                                 where=places.of(table, "datums", number),
                                 fix=f"Of targets (3-2-1) make one datum of all that fix the part: {every!r}, "
                                     "or probe a line or a plane there")  # fmt: skip


def _alignment(facts: PartFile, features: Mapping[str, Probed], places: Places) -> Iterator[CmmUqError]:
    given = facts.alignment
    if given.datums:
        named = [_named(name, features) for name in given.datums]
        if free := freedoms(named):
            yield _unfixed(free, places.of("alignment", "datums"))
        elif not freedoms(named[:-1]):
            said = f"the datum {given.datums[-1]!r} fixes nothing: those before it fix the part already"
            fix = f"Leave it out, or make one datum of all, that heeds each: {BETWEEN.join(given.datums)!r}"
            yield CmmUqError(said, where=places.of("alignment", "datums"), fix=fix)
    elif not given.best_fit:
        asking = [(i, one) for i, one in enumerate(facts.characteristic) if one.asks.framed and not one.datums]
        if asking:
            i, one = asking[0]
            yield CmmUqError(f"the {one.what} of {one.features[0]!r} has no datums, and there is no alignment",
                             where=places.of("characteristic", "datums", i),
                             fix="Give datums, or [alignment] datums = [\"…\", …] or best_fit = true")  # fmt: skip


def _unfixed(free: Sequence[str], where: str) -> CmmUqError:
    fix = (
        "Add a feature that fixes it, as a plane, a line across it and a point (3-2-1); of a round part whose "
        "characteristics all have datums of their own leave the alignment out"
    )
    return CmmUqError(f"these datums do not fix the part: they leave free {', '.join(free)}", where=where, fix=fix)


def _named(datum: str, features: Mapping[str, Probed]) -> tuple[Probed, ...]:
    return tuple(features[name] for name in members(datum, features))


_Check = Callable[[CharacteristicFacts, Mapping[str, Probed]], tuple[str, str, str] | None]


def _characteristics(facts: PartFile, features: Mapping[str, Probed], places: Places) -> Iterator[CmmUqError]:
    for i, one in enumerate(facts.characteristic):
        if found := unfit(one, features):
            problem, key, fix = found
            yield CmmUqError(problem, where=places.of("characteristic", key, i), fix=fix)


def unfit(one: CharacteristicFacts, features: Mapping[str, Probed]) -> tuple[str, str, str] | None:
    """What keeps a characteristic from being evaluated: the problem, the key, and what mends it."""
    checks: tuple[_Check, ...] = (_of_its_kinds, _association, _nominal_orientation, _limits_of_the_value, _whole_frame)
    return next((found for check in checks if (found := check(one, features))), None)


def _of_its_kinds(one: CharacteristicFacts, features: Mapping[str, Probed]) -> tuple[str, str, str] | None:
    """That it is of features, and about datums, that can have it."""
    alone = len(one.features) < one.asks.features
    said_of, own = ("of one feature is of", one.asks.alone) if alone else ("is of", one.asks.kinds)
    for names, kinds, key, of in (
        (one.features, own, "features", said_of), (one.datums, one.asks.datum_kinds, "datums", "is about"),
    ):  # fmt: skip
        for name in names:
            parts = _named(name, features)
            kind = parts[0].facts.kind if len(parts) == 1 else as_one(parts)[0]
            if kind not in kinds:
                said = f"a {kind}" if len(parts) == 1 else _AS_ONE[kind]
                return (f"{with_article(one.what)} {of} a {' or '.join(kinds)}, and {name!r} is {said}", key,
                        "Name another feature, or another characteristic")  # fmt: skip
    return None


def _association(one: CharacteristicFacts, features: Mapping[str, Probed]) -> tuple[str, str, str] | None:
    """That its features can be made of their points as it says."""
    for name in one.features:
        kind = features[name].facts.kind
        if one.association and one.association not in ASSOCIATIONS[kind]:
            return (f"{name!r} is a {kind}, which has no association {one.association!r}", "association",
                    f"Give one of {', '.join(ASSOCIATIONS[kind])}, or leave it out")  # fmt: skip
    return None


_AS_ONE = {
    "line": "an axis",
    "plane": "a plane",
    "point": "neither one axis nor one plane by the nominals of its features",
}
"""What a common datum is."""


def _nominal_orientation(one: CharacteristicFacts, features: Mapping[str, Probed]) -> tuple[str, str, str] | None:
    """That what is to be parallel or perpendicular to its datum is so by its nominal."""
    if one.what not in ("parallelism", "perpendicularity"):
        return None
    feature, own = features[one.features[0]], _named(one.datums[0], features)
    kind, _, direction = (own[0].facts.kind, None, own[0].direction) if len(own) == 1 else as_one(own)
    if feature.direction is None or direction is None:
        return None
    one_normal = (feature.facts.kind in _NORMAL) != (kind in _NORMAL)
    cosine = abs(float(feature.direction @ direction))
    sine = float(np.linalg.norm(np.cross(feature.direction, direction)))
    along = (one.what == "parallelism") != one_normal
    if (sine if along else cosine) <= _NEARLY:
        return None
    angle = np.degrees(np.arctan2(sine, cosine))
    angle = 90 - angle if one_normal else angle
    return (f"{one.features[0]!r} lies at {angle:.4g}° to {one.datums[0]!r} by their nominals, which is no {one.what}", "what",
            'Mend a direction, or ask for "angularity"')  # fmt: skip


_NORMAL = ("plane",)  # kinds whose direction is across what they are; a circle is told by its axis


def _limits_of_the_value(one: CharacteristicFacts, features: Mapping[str, Probed]) -> tuple[str, str, str] | None:
    """That limits of a size are limits of the size, not deviations from it."""
    nominal = features[one.features[0]].facts.diameter_mm
    if one.what != "size" or nominal is None:
        return None
    given = [limit for limit in (one.lower_mm, one.upper_mm) if limit is not None]
    if not given or abs(sum(given) / len(given) - nominal) <= _FAR * nominal:
        return None
    said = " to ".join(f"{limit:g}" for limit in given)
    return (f"limits of {said} mm, where {one.features[0]!r} has a nominal diameter of {nominal:g} mm",
            "lower_mm" if one.lower_mm is not None else "upper_mm",
            "Give limits of the diameter itself, as 9.9 and 10.1, not deviations from it")  # fmt: skip


def _whole_frame(one: CharacteristicFacts, features: Mapping[str, Probed]) -> tuple[str, str, str] | None:
    """That a place with datums of its own has a whole frame: a zone that may turn about its datums is not modelled."""
    if not one.asks.framed or not one.datums:
        return None
    free = freedoms([_named(name, features) for name in one.datums])
    said = (
        f"the {one.what} of {one.features[0]!r} is to datums that leave free {', '.join(free)}, which is not modelled"
    )
    return (
        (said, "datums", "Add a datum that fixes it, as the drawing's next one, or ask for a distance")
        if free
        else None
    )


def _travel(facts: PartFile, features: Mapping[str, Probed], places: Places) -> Iterator[CmmUqError]:
    """That the axes reach every point: once an axis, by its farthest point."""
    if facts.placing.origin_mm is None:
        return
    given, styli = facts.machine_state.travel_mm, {one.name: one for one in facts.stylus}
    named = list(features.values())
    read = [readings(one, styli[one.facts.stylus or facts.stylus[0].name], facts) for one in named]
    every = np.concatenate([np.zeros((0, len(AXES))), *read])
    owner = np.repeat(np.arange(len(named)), [len(one) for one in read])
    travel = np.array([getattr(given, axis) or (np.nan, np.nan) for axis in AXES], dtype=np.float64)
    for i, row in beyond_travel(every, travel):
        name, (low, high) = named[owner[row]].facts.name, travel[i]
        yield CmmUqError(f"axis {AXES[i]} would have to go to {every[row, i]:.6g} mm for {name!r}, and its travel is "
                         f"{low:g} to {high:g} mm", where=places.of("placing", "origin_mm"),
                         fix="Place the part elsewhere, or name another stylus")  # fmt: skip
