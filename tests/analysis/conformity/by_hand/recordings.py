"""Recordings of complete tests, whose every error is put in by hand. Nothing of the package under test is used here.

A recording is rows by (place, length, repeat); an error is that of the length, the sphere or the bar. Beside the errors that a
case names every length has one below 0.05 µm, which no rule of the tables cares for, so that no two repeats are copies.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from fnmatch import fnmatchcase
from itertools import count, product
from math import cos, hypot, pi, radians, sin, sqrt

Row = dict[str, float]
Vector = tuple[float, float, float]

XYZ = ("x_mm", "y_mm", "z_mm")

TRAVEL = 500.0
"""mm, of each axis; the machine is a cube."""

SPACE = [(1.0, 1.0, 1.0), (1.0, -1.0, 1.0), (-1.0, 1.0, 1.0), (-1.0, -1.0, 1.0)]
AXES = [(1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0)]
FACES = [(1.0, 1.0, 0.0), (-1.0, 1.0, 0.0), (0.0, 1.0, 1.0), (0.0, -1.0, 1.0), (1.0, 0.0, 1.0), (-1.0, 0.0, 1.0)]

ON_DIAGONAL = (20, 160, 300, 440, 580)
ON_FACE = (20, 140, 260, 380, 500)
ON_AXIS = (20, 100, 180, 260, 340)
"""mm: five lengths from 20 mm to more than 66 % of the travel of 866, 707 and 500 mm."""


@dataclass
class Wish:
    """What a case changes in a complete test.

    Parameters
    ----------
    errors : µm, by a pattern of place/length/repeat; the last that fits counts.
    left_out : patterns of what was not measured.
    copies : pairs of patterns of whose first the coordinates stand in the place of the second.
    further : repeats of a place/length measured again, with the error of each, µm.
    words : everything else, by its first word.
    """

    errors: list[tuple[str, float]] = field(default_factory=list)
    left_out: list[str] = field(default_factory=list)
    copies: list[tuple[str, str]] = field(default_factory=list)
    further: list[tuple[str, list[float]]] = field(default_factory=list)
    words: dict[str, list[str]] = field(default_factory=dict)

    def error(self, *key: object) -> float | None:
        """µm, of one length, sphere or bar; ``None`` where the case names none."""
        return next((value for pattern, value in reversed(self.errors) if fits(pattern, *key)), None)

    def measured(self, *key: object) -> bool:
        return not any(fits(pattern, *key) for pattern in self.left_out)

    def number(self, word: str, otherwise: float) -> float:
        return float(self.words[word][0]) if word in self.words else otherwise


def fits(pattern: str, *key: object) -> bool:
    """Whether place/length/repeat is meant by a pattern, as 1/300/2, 1/300 or */*/3."""
    wanted = pattern.split("/")
    return len(wanted) <= len(key) and all(
        fnmatchcase(str(own), part) for own, part in zip(key, [*wanted, *["*"] * len(key)], strict=False)
    )


def wish_of(text: str) -> Wish:
    """A case's changes: ``+5.2 at 1/300; without 3; copy 1/*/1 to 1/*/2; again 1/300: 0.1 0.2; temperature 25``."""
    wish = Wish()
    for part in filter(None, (part.strip() for part in text.split(";"))):
        first, *rest = part.split()
        if "at" in rest:
            wish.errors += [(pattern, float(first.replace("−", "-"))) for pattern in rest[rest.index("at") + 1 :]]
        elif first == "without":
            wish.left_out += rest
        elif first == "copy":
            wish.copies.append((rest[0], rest[2]))
        elif first == "again":
            values = [float(value.replace("−", "-")) for value in rest[1:]]
            wish.further.append((rest[0].rstrip(":"), values))
        else:
            wish.words[first] = rest
    return wish


def small(numbers: Iterator[int]) -> float:
    """µm: an even sequence within ±0.05 µm."""
    return 0.1 * ((next(numbers) * 0.618033988749895) % 1.0) - 0.05


def unit(direction: Vector) -> Vector:
    size = sqrt(sum(a * a for a in direction))
    return direction[0] / size, direction[1] / size, direction[2] / size


def signs(direction: Vector, sense: float) -> Vector:
    """Of a travel along a direction, or against it."""
    x, y, z = (0.0 if abs(a) < 1e-9 else sense * a / abs(a) for a in direction)
    return x, y, z


def along(start: Vector, direction: Vector, distance: float) -> Vector:
    return tuple(a + distance * b for a, b in zip(start, direction, strict=True))  # type: ignore[return-value]


def across(direction: Vector) -> Vector:
    """A direction square to another."""
    x, y, _ = direction
    return unit((y, -x, 0.0)) if hypot(x, y) > 0.1 else (1.0, 0.0, 0.0)


MIDDLE = (0.5 * TRAVEL, 0.5 * TRAVEL, -0.5 * TRAVEL)


def step_gauge(lines: Sequence[Vector], lengths: Callable[[Vector], Sequence[float]]) -> Callable[[Wish], list[Row]]:
    """Each line through the middle of the volume: a first face met on the way out, five faces met on the way back."""

    def rows(wish: Wish) -> list[Row]:
        found, numbers = [], count(1)
        for place, line in enumerate(lines, 1):
            if not wish.measured(place):
                continue
            far = chosen(wish, lengths(line))
            kept = [length for length in far if wish.measured(place, f"{length:g}")]
            for repeat in range(1, int(wish.number("repeats", 3)) + 1):
                faces = [length for length in kept if wish.measured(place, f"{length:g}", repeat)]
                found += run(wish, numbers, place, line, far[-1], repeat, faces, far)
            repeat = int(wish.number("repeats", 3))
            for pattern, errors in wish.further:
                for length in far:
                    if fits(pattern, place, f"{length:g}"):
                        for error in errors:
                            repeat += 1
                            found += run(wish, numbers, place, line, far[-1], repeat, [length], far, error)
        return damaged(wish, found)

    return rows


def run(
    wish: Wish, numbers: Iterator[int], place: int, line: Vector, longest: float, repeat: int, faces: Sequence[float],
    far: Sequence[float], again: float | None = None,
) -> list[Row]:  # fmt: skip
    if not faces:
        return []
    u = unit(line)
    shift = along(along(MIDDLE, u, -0.5 * longest), across(u), 1e-4 * small(numbers))
    degrees = wish.number("temperature", 20.0)
    grown = 1 + wish.number("expansion", 1e-5) * (degrees - 20.0)
    found = []
    for number, face in [(1, 0.0), *((far.index(face) + 2, face) for face in faces)]:
        stated = wish.error(place, f"{face:g}", repeat) if again is None else again
        error = 0.0 if not face else small(numbers) if stated is None else stated
        x, y, z = along(shift, u, face * grown + error * 1e-3)
        row = {
            "measurement": place,
            "point": number,
            "repeat": repeat,
            "x_mm": x,
            "y_mm": y,
            "z_mm": z,
            "reference_mm": face,
        }
        sense = 1.0 if number == 1 or "oneway" in wish.words else -1.0
        row |= dict(zip(("approach_x", "approach_y", "approach_z"), signs(u, sense), strict=True))
        found.append(row | {"temp_artefact_c": degrees})
    return found


def blocks(lines: Sequence[Vector], lengths: Callable[[Vector], Sequence[float]]) -> Callable[[Wish], list[Row]]:
    """Blocks one after the other in each place, a measurement each: two faces that look away from each other."""

    def rows(wish: Wish) -> list[Row]:
        found, numbers, measurement = [], count(1), 0
        degrees = wish.number("temperature", 20.0)
        grown = 1 + wish.number("expansion", 1e-5) * (degrees - 20.0)
        for place, line in enumerate(lines, 1):
            for length in chosen(wish, lengths(line)):
                measurement += 1
                for repeat in range(1, int(wish.number("repeats", 3)) + 1):
                    if not wish.measured(place, f"{length:g}", repeat):
                        continue
                    u, stated = unit(line), wish.error(place, f"{length:g}", repeat)
                    error = small(numbers) if stated is None else stated
                    start = along(along(MIDDLE, u, -0.5 * length), across(u), 1e-4 * small(numbers))
                    for point, face in ((1, 0.0), (2, length)):
                        x, y, z = along(start, u, face * grown + (error * 1e-3 if face else 0.0))
                        sense = 1.0 if point == 1 else -1.0
                        row = {
                            "measurement": measurement,
                            "point": point,
                            "repeat": repeat,
                            "x_mm": x,
                            "y_mm": y,
                            "z_mm": z,
                        }
                        row |= {"reference_mm": face, "temp_artefact_c": degrees}
                        row |= dict(zip(("approach_x", "approach_y", "approach_z"), signs(u, sense), strict=True))
                        found.append(row)
        return damaged(wish, found)

    return rows


def plate(wish: Wish) -> list[Row]:
    """Two rows of eleven balls, 34 mm apart, along each axis; an error moves one ball of the first row along it."""
    found, numbers = [], count(1)
    for place, line in enumerate(AXES, 1):
        u, v = unit(line), across(unit(line))
        for repeat in range(1, 4):
            if not wish.measured(place, "*", repeat):
                continue
            aside = 1e-4 * small(numbers)
            for number, (row, ball) in enumerate(product((0, 1), range(11)), 1):
                if not wish.measured(place, ball, repeat):
                    continue
                error = (wish.error(place, ball, repeat) or 0.0) if not row else 0.0
                at = along(along(along(MIDDLE, u, -170.0), u, 34.0 * ball + error * 1e-3), v, 34.0 * row + aside)
                reference = {"reference_x_mm": 34.0 * ball, "reference_y_mm": 34.0 * row, "reference_z_mm": 0.0}
                x, y, z = at
                found.append({"measurement": place, "point": number, "repeat": repeat, "x_mm": x, "y_mm": y, "z_mm": z,
                              **reference, "temp_artefact_c": wish.number("temperature", 20.0)})  # fmt: skip
    return damaged(wish, found)


TWENTY = [*FACES, *SPACE, *[AXES[0]] * 4, *[AXES[1]] * 4, *[AXES[2]] * 2]
"""Six face and four space diagonals, four bars along X, four along Y, two along Z."""


def bars(wish: Wish) -> list[Row]:
    """A bar of 300 mm in twenty places or one more, each 12 mm further up, those along Z aside."""
    found, numbers = [], count(1)
    for place, direction in enumerate([*TWENTY, FACES[0]][: int(wish.number("bars", 20))], 1):
        if not wish.measured(place):
            continue
        for repeat in range(1, int(wish.number("repeats", 1)) + 1):
            stated = wish.error(place, repeat)
            found += bar(
                wish, numbers, place, repeat, direction, 12.0 * (place - 10.5), 0.0 if stated is None else stated
            )
    return damaged(wish, found)


def bar(
    wish: Wish, numbers: Iterator[int], place: int, repeat: int, direction: Vector, up: float, error: float
) -> list[Row]:
    u, (x, y, z) = unit(direction), MIDDLE
    moved = (x + up, y, z) if direction == AXES[2] else (x, y, z + up)
    middle = along(moved, across(u), 1e-4 * small(numbers))
    degrees = wish.number("temperature", 20.0)
    grown = 1 + wish.number("expansion", 1e-5) * (degrees - 20.0)
    found = []
    for point, half in ((1, -0.5), (2, 0.5)):
        x, y, z = along(middle, u, half * (300.0 * grown + error * 1e-3))
        found.append({"measurement": place, "point": point, "repeat": repeat, "x_mm": x, "y_mm": y, "z_mm": z,
                      "temp_artefact_c": degrees})  # fmt: skip
    return found


def tips(wish: Wish) -> list[Row]:
    """The bar along four diagonals of vertical planes, each with the tip 150 mm to either side, square to the plane."""
    found, numbers, measurement = [], count(1), 0
    for place, direction in enumerate(FACES[2:], 1):
        axis = direction.index(0.0)
        for side in (1, 2):
            measurement += 1
            if not wish.measured(place, side):
                continue
            rows = bar(wish, numbers, measurement, 1, direction, 0.0, wish.error(place, side) or 0.0)
            for row in rows:
                offset = [0.0, 0.0, -100.0]
                offset[axis] = 150.0 * (1 if side == 1 else -1)
                row |= dict(zip(("tip_x_mm", "tip_y_mm", "tip_z_mm"), offset, strict=True))
            found += rows
    return damaged(wish, found)


def hemisphere() -> list[Vector]:
    """A pole, four points 22.5° from it, eight at 45°, four at 67.5°, eight on the equator."""
    found: list[Vector] = [(0.0, 0.0, 1.0)]
    for polar, number, turn in ((22.5, 4, 0.0), (45.0, 8, 22.5), (67.5, 4, 0.0), (90.0, 8, 22.5)):
        for i in range(number):
            a, b = radians(polar), radians(turn) + 2 * pi * i / number
            found.append((sin(a) * cos(b), sin(a) * sin(b), cos(a)))
    return found


def spheres(wish: Wish) -> list[Row]:
    """A sphere of 25 mm in some places, 25 points each.

    Its form is put on the eight points of the equator, in turn half of it outwards and inwards: by the symmetry neither middle
    nor radius of the least-squares sphere changes. Its size is put on all radii.
    """
    found, numbers = [], count(1)
    size, pole = wish.number("diameter", 25.0), wish.number("cap", 90.0) / 90.0
    degrees = wish.number("temperature", 20.0)
    for place in range(1, int(wish.number("spheres", 1)) + 1):
        if not wish.measured(place):
            continue
        for repeat in range(1, int(wish.number("repeats", 1)) + 1):
            form, larger = wish.error(place, "form", repeat) or 0.0, wish.error(place, "size", repeat) or 0.0
            aside = (60.0 * place - 30.0 + 1e-5 * small(numbers), 1e-3 * (wish.error(place, "y", repeat) or 0.0), 0.0)
            for number, n in enumerate(hemisphere()[: int(wish.number("points", 25))], 1):
                if pole < 1:  # the same longitudes, nearer to the pole
                    polar, rho = radians(90.0 * pole) * (1 - n[2]), hypot(n[0], n[1]) or 1.0
                    n = (sin(polar) * n[0] / rho, sin(polar) * n[1] / rho, cos(polar))
                bump = 0.5 * form * (1 if number % 2 else -1) if number > 17 else 0.0
                bump += wish.error(place, "point", number) or 0.0
                radius = 0.5 * (size + larger * 1e-3) + bump * 1e-3
                x, y, z = along((aside[0], 250.0 + aside[1], -250.0), n, radius)
                found.append({"measurement": place, "point": number, "repeat": repeat, "x_mm": x, "y_mm": y, "z_mm": z,
                              "nx": n[0], "ny": n[1], "nz": n[2], "temp_artefact_c": degrees})  # fmt: skip
    return damaged(wish, found)


def damaged(wish: Wish, rows: list[Row]) -> list[Row]:
    """Copies, columns that were not recorded or are the same everywhere, scatter, and another unit."""
    for source, to in wish.copies:
        first = [row for row in rows if _run(row) == source]
        for row, original in zip((row for row in rows if _run(row) == to), first, strict=True):
            row |= {name: original[name] for name in XYZ}
    factor, scatter, numbers = wish.number("unit", 1.0), 1e-2 * wish.number("scatter", 0.0), count(1)
    constant = wish.words.get("column", [])
    for row in rows:
        for name in [name for name in row if any(name.startswith(word) for word in wish.words.get("no", []))]:
            del row[name]
        if "calibrated" in wish.words:
            a, b = map(float, wish.words["calibrated"])
            row["reference_u_um"] = a + b * row["reference_mm"] / 1000.0
        row |= {name: factor * (row[name] + (scatter * small(numbers) if scatter else 0.0)) for name in XYZ}
        row |= {name: float(value) for name, value in zip(constant[::2], constant[1::2], strict=True)}
    return rows


def _run(row: Row) -> str:
    return f"{row['measurement']:g}/{row['repeat']:g}"


def csv(rows: Sequence[Mapping[str, float]]) -> bytes:
    names = list(rows[0]) if rows else ["measurement", "point", "repeat", "x_mm", "y_mm", "z_mm"]
    return "\n".join([",".join(names), *(",".join(f"{row[name]:.12g}" for name in names) for row in rows), ""]).encode()


def chosen(wish: Wish, lengths: Sequence[float]) -> list[float]:
    """Lengths of a line in place of the usual ones, or beside them; ``…`` is the usual longest."""
    longest = float(max(lengths))
    given = [longest if word == "…" else float(word) for word in wish.words.get("lengths", [])] or list(
        map(float, lengths)
    )
    return sorted([*given, *map(float, wish.words.get("besides", []))])


def on(line: Vector) -> Sequence[int]:
    """The five lengths of a line."""
    return {3: ON_DIAGONAL, 2: ON_FACE, 1: ON_AXIS}[sum(1 for a in line if a)]


def ten(line: Vector) -> Sequence[int]:
    return tuple(range(34, 341, 34))


RECORDINGS: Mapping[str, Callable[[Wish], list[Row]]] = {
    "step gauge, seven lines": step_gauge([*SPACE, *AXES], on),
    "step gauge, space diagonals": step_gauge(SPACE, on),
    "step gauge, face diagonals": step_gauge(FACES, on),
    "step gauge, diagonals of Y-Z": step_gauge(FACES[2:4], on),
    "step gauge, axes": step_gauge(AXES, on),
    "step gauge, axes, ten lengths": step_gauge(AXES, ten),
    "gauge blocks, seven lines": blocks([*SPACE, *AXES], on),
    "gauge blocks, axes": blocks(AXES, on),
    "gauge block, four orientations": blocks([*AXES, (1.0, 1.0, 1.0)], lambda line: (20,)),
    "plate along the axes": plate,
    "ballbar, twenty places": bars,
    "ballbar, tips to both sides": tips,
    "sphere": spheres,
}
"""Complete tests, by what is measured."""
