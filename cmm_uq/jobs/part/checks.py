"""What a part's tables say together: names that lead somewhere, datums that fix a frame, a part within the travel.

Common datums are written ``A-B`` as ISO 5459 writes them. Each feature is invariant under some rigid motions (its invariance
class, ISO 5459); datums fix the frame where no motion but standing still leaves all of them in place. To first order these
motions are a linear space of six dimensions.
"""

from __future__ import annotations

from collections.abc import Collection, Iterator, Mapping, Sequence
from functools import cache
from itertools import compress

import numpy as np

from cmm_uq.base.errors import CmmUqError, Gathered, suggestion
from cmm_uq.base.points import AXES, Floats, beyond_travel
from cmm_uq.jobs.part.feature import ASSOCIATIONS, FEWEST, CharacteristicFacts, Kind, material_condition, with_article
from cmm_uq.jobs.part.probed import Probed
from cmm_uq.jobs.part.tables import PartFile, Places, PlacingFacts

BETWEEN = "-"
_APART_MM = 0.01  # from one axis: what lies farther from it by its nominal lies on another
_ACROSS = 1e-3  # sine of the angle below which two directions are one, a twentieth of a degree
# singular value below which a motion counts as free: datums that lean by less than a twentieth of a degree are one
_FREE = 1e-3
_FACES: tuple[Kind, ...] = ("plane", "point")
_ROUND: tuple[Kind, ...] = ("circle", "cylinder", "cone")
# of a nominal orientation: what is off by more than a degree is another orientation than the drawing's
_NEARLY = np.sin(np.radians(1.0))
_FAR = 0.1  # share of a nominal size by which the middle of its limits may lie beside it, for fits
Problem = tuple[str, str, str]  # what is wrong with a characteristic, its key, and what mends it


def members(name: str, known: Collection[str]) -> tuple[str, ...]:
    """Names of the features that a datum is on: one, or those between the hyphens of ``A-B``.

    A feature that has a hyphen in its own name is found by its whole name.
    """
    if name in known:
        return (name,)
    words = [word.strip() for word in name.split(BETWEEN)]

    @cache
    def read(start: int) -> list[tuple[str, ...]]:
        """Two ways at most to read the words from one on as names."""
        if start == len(words):
            return [()]
        firsts = ((end, BETWEEN.join(words[start:end])) for end in range(start + 1, len(words) + 1))
        return [(first, *rest) for end, first in firsts if first in known for rest in read(end)][:2]

    ways = read(0)
    if not ways:
        unknown = next((word for word in words if word not in known), name)
        of = f" of the common datum {name!r}" if len(words) > 1 else ""
        raise CmmUqError(f"there is no feature {unknown!r}{of}", fix=suggestion(unknown, known))
    if len(ways) > 1:
        one, other = (" and ".join(map(repr, way)) for way in ways)
        raise CmmUqError(f"the common datum {name!r} is {one}, or {other}", fix="Give features names without hyphens")
    if twice := [each for each in ways[0] if ways[0].count(each) > 1]:
        raise CmmUqError(f"the common datum {name!r} names {twice[0]!r} twice", fix="Name each of its features once")
    return ways[0]


def as_one(features: Sequence[Probed]) -> tuple[Kind, Floats, Floats | None]:
    """What features are as one datum by their nominals: kind, a point (3,) of it, and its direction (3,).

    A ``line`` where all lie on one axis: circles, cylinders and cones with theirs, spheres with their centres. A ``plane``
    where all are parallel faces, or points of such. Else a ``point``, without direction.
    """
    points = np.array([one.facts.point_mm for one in features], dtype=np.float64)
    faces = [one.facts.kind in _FACES for one in features]
    if all(faces):
        normals = np.array([one.normals[0] for one in features])
        same = np.all(np.linalg.norm(np.cross(normals, normals[0]), axis=1) < _ACROSS)
        return ("plane", points.mean(axis=0), normals[0]) if same else ("point", points.mean(axis=0), None)
    axes = [one.direction for one in features if one.direction is not None and one.facts.kind in _ROUND]
    apart = points - points[0]
    farthest = apart[int(np.argmax(np.linalg.norm(apart, axis=1)))]
    along = axes[0] if axes else farthest / (float(np.linalg.norm(farthest)) or 1.0)
    on_it = np.linalg.norm(apart - np.outer(apart @ along, along), axis=1) < _APART_MM
    parallel = all(np.linalg.norm(np.cross(axis, along)) < _ACROSS for axis in axes)
    if not any(faces) and parallel and on_it.all():
        return "line", points[0], np.asarray(along)
    return "point", points.mean(axis=0), None


def freedoms(datums: Sequence[tuple[Probed, ...]]) -> tuple[str, ...]:
    """What the datums leave free, in words; nothing where they fix the frame."""
    points = np.concatenate([np.zeros((0, 3)), *(one.points for datum in datums for one in datum)])
    centre = points.mean(axis=0) if len(points) else np.zeros(3)
    size = float(np.abs(points - centre).max(initial=1.0))  # so that shifts and rotations are of one size
    fixed = [_fixed(one, centre, size, alone=len(datum) == 1) for datum in datums for one in datum]
    rows = np.concatenate([np.zeros((0, 6)), *fixed])
    shifts, turns = _null(np.concatenate([rows, np.eye(6)[3:]]))[:, :3], _null(rows)[:, 3:]
    free: list[str] = []
    for words, motions in (("shift along", shifts), ("rotation about", turns)):
        moved = np.linalg.norm(motions, axis=0) > _FREE
        free += [f"{words} {axis}" for axis in compress(AXES, moved.tolist())]
    return tuple(free)


def _null(rows: Floats) -> Floats:
    """(k, 6) orthonormal motions that the rows do not see."""
    _, values, motions = np.linalg.svd(rows, full_matrices=True)
    return np.asarray(motions[np.append(values, np.zeros(6))[:6] <= _FREE])


def _fixed(one: Probed, centre: Floats, size: float, *, alone: bool) -> Floats:
    """(r, 6) of what a feature fixes: shifts of it and rotations, of a motion (shift, rotation about the centre).

    A point alone fixes all three shifts; in a common datum it holds the others' plane or face, along its normal.
    """
    arm = (np.array(one.facts.point_mm) - centre) / size
    place = np.hstack([np.eye(3), np.cross(np.eye(3), arm).T])  # the shift of the feature's point is t + r × arm
    if one.facts.kind == "point" and not alone:
        return np.asarray(one.normals[:1] @ place)
    if one.direction is None:
        return place
    across = np.linalg.svd(one.direction[None])[2][1:]
    if one.facts.kind == "circle":  # its direction is nominal
        return np.asarray(across @ place)
    held = one.direction if one.facts.kind == "plane" else across
    return np.vstack([held @ place, np.hstack([np.zeros((2, 3)), across])])


def rotation(placing: PlacingFacts) -> Floats:
    """(3, 3) coordinates of the machine = rotation · those of the part + origin: about x, then y, then z of the machine."""
    a, b, c = np.radians(placing.rotation_deg)
    about_x = np.array([[1, 0, 0], [0, np.cos(a), -np.sin(a)], [0, np.sin(a), np.cos(a)]])
    about_y = np.array([[np.cos(b), 0, np.sin(b)], [0, 1, 0], [-np.sin(b), 0, np.cos(b)]])
    about_z = np.array([[np.cos(c), -np.sin(c), 0], [np.sin(c), np.cos(c), 0], [0, 0, 1]])
    return np.asarray(about_z @ about_y @ about_x)


def readings(feature: Probed, facts: PartFile) -> Floats:
    """(n, 3) what the scales read while a feature is probed, mm: of the ram's reference point, which is not at the tip.

    Where the job does not say where the part lies, it lies at the origin.
    """
    stylus = facts.stylus_of(feature.facts)
    centres = feature.points + 0.5 * stylus.diameter_mm * feature.normals
    placed = centres @ rotation(facts.placing).T + (facts.placing.origin_mm or [0.0, 0.0, 0.0])
    return np.asarray(placed - stylus.offset_mm + np.array(facts.machine_state.origin_mm))


def check_names(facts: PartFile, places: Places, wrong: Gathered) -> None:
    """Gather names that stand twice or lead nowhere."""
    names = {"stylus": [one.name for one in facts.stylus], "feature": [one.name for one in facts.feature],
             "characteristic": [one.name for one in facts.characteristic]}  # fmt: skip
    for table, own in names.items():
        for i, name in enumerate(own):
            if name in own[:i]:
                wrong.tell(f"the {table} {name!r} stands there twice", where=places.of(table, "name", i),
                           fix="Give each a name of its own")  # fmt: skip
    styli, features = names["stylus"], names["feature"]
    for i, feature in enumerate(facts.feature):
        where = places.of("feature", "stylus", i)
        if not feature.stylus and len(styli) > 1:
            said = f"there are {len(styli)} styli, and {feature.name!r} does not say which probes it"
            wrong.tell(said, where=where, fix=f"Give stylus = {styli[0]!r} or another")
        _known([feature.stylus] if feature.stylus else [], styli, "stylus", where, wrong)
    _datums(facts.alignment.datums, features, places.of("alignment", "datums"), wrong)
    for i, one in enumerate(facts.characteristic):
        _known(one.features, features, "feature", places.of("characteristic", "features", i), wrong)
        _datums(one.datums, features, places.of("characteristic", "datums", i), wrong)
    order, where = facts.probing.order, places.of("probing", "order")
    _known(order, features, "feature", where, wrong)
    left = [name for name in features if name not in order]
    if order and (left or len(order) != len(features)):
        said = f"leaves {left[0]!r} out" if left else "names a feature twice"
        wrong.tell(said, where=where, fix="Name each feature once")
    for cause in facts.stated_and_declared:
        wrong.tell("has a figure, and is declared negligible", where=places.of("negligible", cause),
                   fix="Leave one of the two out")  # fmt: skip


def _known(names: Sequence[str], known: Sequence[str], what: str, where: str, wrong: Gathered) -> None:
    for name in names:
        if name not in known:
            wrong.tell(f"there is no {what} {name!r}", where=where, fix=suggestion(name, known))


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
            wrong.tell(problem, where=where, fix=fix)
            continue
        if twice := [each for each in own if each in taken]:
            fix = "Name it in one of them"
            wrong.tell(f"{twice[0]!r} stands in two of these datums", where=where, fix=fix)
        taken += own


def check_plan(facts: PartFile, features: Mapping[str, Probed], places: Places, wrong: Gathered) -> None:
    """Gather what the tables say against each other; all names lead somewhere."""
    for check in (_tips, _common_faces, _alignment, _characteristics, _travel):
        for error in check(facts, features, places):
            wrong.add(error)


def _tips(facts: PartFile, features: Mapping[str, Probed], places: Places) -> Iterator[CmmUqError]:
    for i, one in enumerate(facts.feature):
        tip = facts.stylus_of(one).diameter_mm
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
            few = sum(len(one.points) for one in own) < FEWEST["plane"]
            if name not in told and len(own) > 1 and few and as_one(own)[0] == "plane":
                told.add(name)
                yield CmmUqError(f"the datum {name!r} is on {len(own)} points of one face, which are no plane",
                                 where=places.of(table, "datums", number),
                                 fix=f"Of targets (3-2-1) make one datum of all that fix the part: {BETWEEN.join(datums)!r}, "
                                     "or probe a line or a plane there")  # fmt: skip


def _alignment(facts: PartFile, features: Mapping[str, Probed], places: Places) -> Iterator[CmmUqError]:
    datums, where = facts.alignment.datums, places.of("alignment", "datums")
    named = [_named(name, features) for name in datums]
    asking = [(i, one) for i, one in enumerate(facts.characteristic) if one.asks.framed and not one.datums]
    if datums and (free := freedoms(named)):
        yield CmmUqError(f"these datums do not fix the part: they leave free {', '.join(free)}", where=where,
                         fix="Add a feature that fixes it, as a plane, a line across it and a point (3-2-1); of a round part "
                             "whose characteristics all have datums of their own leave the alignment out")  # fmt: skip
    elif datums and not freedoms(named[:-1]):
        said = f"the datum {datums[-1]!r} fixes nothing: those before it fix the part already"
        fix = f"Leave it out, or make one datum of all, that heeds each: {BETWEEN.join(datums)!r}"
        yield CmmUqError(said, where=where, fix=fix)
    elif not datums and not facts.alignment.best_fit and asking:
        i, one = asking[0]
        yield CmmUqError(f"the {one.what} of {one.features[0]!r} has no datums, and there is no alignment",
                         where=places.of("characteristic", "datums", i),
                         fix="Give datums, or [alignment] datums = [\"…\", …] or best_fit = true")  # fmt: skip


def _named(datum: str, features: Mapping[str, Probed]) -> tuple[Probed, ...]:
    return tuple(features[name] for name in members(datum, features))


def _characteristics(facts: PartFile, features: Mapping[str, Probed], places: Places) -> Iterator[CmmUqError]:
    for i, one in enumerate(facts.characteristic):
        if found := unfit(one, features):
            problem, key, fix = found
            yield CmmUqError(problem, where=places.of("characteristic", key, i), fix=fix)


def unfit(one: CharacteristicFacts, features: Mapping[str, Probed]) -> Problem | None:
    """What keeps a characteristic from being evaluated."""
    checks = (_of_its_kinds, _association, _form, _nominal_orientation, _limits_of_the_value, _whole_frame)
    return next((found for check in checks if (found := check(one, features))), None)


def _of_its_kinds(one: CharacteristicFacts, features: Mapping[str, Probed]) -> Problem | None:
    """That it is of features, and about datums, that can have it."""
    asks, alone = one.asks, len(one.features) < one.asks.features
    of_features = ("of one feature is of", asks.alone) if alone else ("is of", asks.kinds)
    for names, key, (of, kinds) in (
        (one.features, "features", of_features), (one.datums, "datums", ("is about", asks.datum_kinds)),
    ):  # fmt: skip
        for name in names:
            parts = _named(name, features)
            kind = parts[0].facts.kind if len(parts) == 1 else as_one(parts)[0]
            if kind not in kinds:
                said = f"a {kind}" if len(parts) == 1 else _AS_ONE[kind]
                return (f"{with_article(one.what)} {of} a {' or '.join(kinds)}, and {name!r} is {said}", key,
                        "Name another feature, or another characteristic")  # fmt: skip
    return None


# what a common datum is
_AS_ONE = {"line": "an axis", "plane": "a plane"}
_AS_ONE["point"] = "neither one axis nor one plane by the nominals of its features"


def _association(one: CharacteristicFacts, features: Mapping[str, Probed]) -> Problem | None:
    """That its features can be made of their points as it says."""
    for name in one.features:
        kind = features[name].facts.kind
        if one.association and one.association not in ASSOCIATIONS[kind]:
            return (f"{name!r} is a {kind}, which has no association {one.association!r}", "association",
                    f"Give one of {', '.join(ASSOCIATIONS[kind])}, or leave it out")  # fmt: skip
    return None


def _form(one: CharacteristicFacts, features: Mapping[str, Probed]) -> Problem | None:
    """That a form is seen: by more points than determine the feature, which leave none, and would conform whatever it is."""
    if one.what not in ("straightness", "flatness", "roundness", "cylindricity", "sphericity"):
        return None
    (feature,) = (features[name] for name in one.features)
    least, count = FEWEST[feature.facts.kind], len(feature.points)
    if count > least:
        return None
    problem = f"{count} points determine {one.features[0]!r} and show nothing of its form"
    return problem, "features", f"Probe {least + 1} points or more, or leave the {one.what} out"


def _nominal_orientation(one: CharacteristicFacts, features: Mapping[str, Probed]) -> Problem | None:
    """That what is to be parallel or perpendicular to its datum is so by its nominal."""
    if one.what not in ("parallelism", "perpendicularity"):
        return None
    feature, own = features[one.features[0]], _named(one.datums[0], features)
    kind, _, direction = (own[0].facts.kind, None, own[0].direction) if len(own) == 1 else as_one(own)
    if feature.direction is None or direction is None:
        return None
    one_normal = (feature.facts.kind == "plane") != (kind == "plane")  # the direction of a plane is across what it is
    cosine = abs(float(feature.direction @ direction))
    sine = float(np.linalg.norm(np.cross(feature.direction, direction)))
    along = (one.what == "parallelism") != one_normal
    if (sine if along else cosine) <= _NEARLY:
        return None
    angle = np.degrees(np.arctan2(sine, cosine))
    angle = 90 - angle if one_normal else angle
    return (f"{one.features[0]!r} lies at {angle:.4g}° to {one.datums[0]!r} by their nominals, which is no {one.what}", "what",
            'Mend a direction, or ask for "angularity"')  # fmt: skip


def _limits_of_the_value(one: CharacteristicFacts, features: Mapping[str, Probed]) -> Problem | None:
    """That limits of a size are limits of the size, not deviations from it."""
    nominal = features[one.features[0]].facts.diameter_mm
    limits = [limit for limit in (one.lower_mm, one.upper_mm) if limit is not None]
    if one.what != "size" or nominal is None or not limits:
        return None
    if abs(sum(limits) / len(limits) - nominal) <= _FAR * nominal:
        return None
    said = " to ".join(f"{limit:g}" for limit in limits)
    return (f"limits of {said} mm, where {one.features[0]!r} has a nominal diameter of {nominal:g} mm",
            "lower_mm" if one.lower_mm is not None else "upper_mm",
            "Give limits of the diameter itself, as 9.9 and 10.1, not deviations from it")  # fmt: skip


def _whole_frame(one: CharacteristicFacts, features: Mapping[str, Probed]) -> Problem | None:
    """That a place with datums of its own has a whole frame: a zone that may turn about its datums is not modelled."""
    if not one.asks.framed or not one.datums or not (free := freedoms([_named(name, features) for name in one.datums])):
        return None
    said = (
        f"the {one.what} of {one.features[0]!r} is to datums that leave free {', '.join(free)}, which is not modelled"
    )
    return said, "datums", "Add a datum that fixes it, as the drawing's next one, or ask for a distance"


def _travel(facts: PartFile, features: Mapping[str, Probed], places: Places) -> Iterator[CmmUqError]:
    """That the axes reach every point: once an axis, by its farthest point."""
    if facts.placing.origin_mm is None:
        return
    read = {name: readings(one, facts) for name, one in features.items()}
    every = np.concatenate([np.zeros((0, len(AXES))), *read.values()])
    owner = [name for name, own in read.items() for _ in own]
    travel = [getattr(facts.machine_state.travel_mm, axis) or (np.nan, np.nan) for axis in AXES]
    for i, row in beyond_travel(every, np.array(travel, dtype=np.float64)):
        low, high = travel[i]
        yield CmmUqError(f"axis {AXES[i]} would have to go to {every[row, i]:.6g} mm for {owner[row]!r}, and its travel is "
                         f"{low:g} to {high:g} mm", where=places.of("placing", "origin_mm"),
                         fix="Place the part elsewhere, or name another stylus")  # fmt: skip
