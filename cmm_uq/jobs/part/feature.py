"""``[[feature]]``, ``[form]`` and ``[[characteristic]]``: nominals, surfaces, and what the drawing asks for.

Where a feature is meant to be, where it is probed, and how its surface may deviate; of which features a characteristic is,
about which datums, within which limits.

Coordinates are those of the part, mm, at 20 °C. What drawings ask for and programs do that is not modelled is refused by its
name, in the words that are said once here, to follow the name of a feature or of a characteristic.
"""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Iterator, Mapping
from typing import Annotated, Any, Literal, get_args

from pydantic import Field, field_validator, model_validator

from cmm_uq.base.files.limits import INPUTS, LISTED
from cmm_uq.base.files.table import JobTable, Length, Position, Triple, Uncertainty, key, required
from cmm_uq.base.values import dataclass

_COUNT = re.compile(r"[1-9][0-9]{0,3}")
FEWEST_UNDULATIONS = 2  # one undulation per revolution is a shift, none a change of size


class FormFacts(JobTable):
    """What is known of a surface about its nominal one, along its normals."""

    field_um: Uncertainty = 0.0
    """Standard deviation of a form that nobody knows, as a random field on the surface."""
    correlation_mm: Length = 10.0
    """Distance on the surface over which the correlation of that field falls to exp(−½)."""
    harmonics_um: Annotated[dict[str, Uncertainty], Field(max_length=INPUTS.most)] = {}
    """Standard deviations of lobes of any phase about a feature's axis, by their number: `{ 2 = 1.0, 3 = 0.5 }`; heeded by
    circles, cylinders and cones."""
    surface_points: Annotated[int, Field(ge=0, le=5000)] = 0
    """Points, spread over the whole surface, by which a feature with its form is true; 0 where it is true by its nominal, and
    all of its form is an error."""
    roughness_um: Uncertainty = 0.0
    """Standard deviation of a contact point by roughness, from point to point on its own."""

    def problems(self) -> Iterator[str]:
        for name in self.harmonics_um:
            if not _COUNT.fullmatch(name) or int(name) < FEWEST_UNDULATIONS:
                yield f"harmonics_um has {name!r}: give numbers of lobes from {FEWEST_UNDULATIONS}, as {{ 3 = 0.5 }}"


SCANNED = (
    "is scanned: what scanning adds (dynamic errors, filters, points that lie close together) is not modelled; plan it by "
    "points that are probed one by one"
)
LINE_PROFILE = "is the profile of a line, which is not modelled"
SURFACE_PROFILE = "is the profile of a surface, which is not modelled"
POINT_PROFILE = "is the profile of a surface at a point, which is not modelled"
MAXIMUM_MATERIAL = "holds at maximum material condition, which is not modelled"
LEAST_MATERIAL = "holds at least material condition, which is not modelled"
TWO_POINT = "is a two-point size (LP), which is not modelled: sizes are those of associated features"
PROJECTED = "has a projected tolerance zone, which is not modelled"
SYMMETRY = "is a symmetry: the median plane of two faces is not modelled"
FREE_STATE = "is toleranced in the free state, and how a part bends is not modelled"
Name = Annotated[str, Field(min_length=1, max_length=100)]
_INSTEAD = "leave it out, and name it in [part] not_measured"

# as somebody may write them in job.toml
_WORDS: Mapping[str, str] = {
    "mmc": MAXIMUM_MATERIAL, "mmr": MAXIMUM_MATERIAL, "maximum_material": MAXIMUM_MATERIAL, "m": MAXIMUM_MATERIAL,
    "lmc": LEAST_MATERIAL, "lmr": LEAST_MATERIAL, "least_material": LEAST_MATERIAL, "l": LEAST_MATERIAL,
    "lp": TWO_POINT, "two_point": TWO_POINT, "local_size": TWO_POINT, "two_point_size": TWO_POINT,
    "free_state": FREE_STATE, "f": FREE_STATE, "projected": PROJECTED, "p": PROJECTED,
    "profile": SURFACE_PROFILE, "surface_profile": SURFACE_PROFILE, "profile_of_a_surface": SURFACE_PROFILE,
    "line_profile": LINE_PROFILE, "profile_of_a_line": LINE_PROFILE, "point_profile": POINT_PROFILE,
    "symmetry": SYMMETRY,
    "scan": SCANNED, "scanning": SCANNED, "scanned": SCANNED, "continuous": SCANNED,
}  # fmt: skip
_KEYS: Mapping[str, str | None] = {
    "what": None, "pattern": None, "association": None, "modifier": None, "material_condition": None, "condition": None,
    "free_state": FREE_STATE, "mmc": MAXIMUM_MATERIAL, "lmc": LEAST_MATERIAL, "projected_zone_mm": PROJECTED,
    "projected_mm": PROJECTED, "scan": SCANNED, "scanning": SCANNED, "scan_speed_mm_s": SCANNED, "filter": SCANNED,
}  # fmt: skip
"""Keys that say such a thing, or whose value does."""


def material_condition(datum: str) -> str:
    """What a datum says of its material condition, as ``B(M)`` does; nothing where it says nothing."""
    _, bracket, said = datum.strip().rstrip("Ⓜ Ⓛ").partition("(")
    condition = said.rstrip(") ").casefold() if bracket else ""
    condition = {"Ⓜ": "m", "Ⓛ": "l"}.get(datum.strip()[-1:], condition)
    return _WORDS.get(condition, "") if condition in ("m", "l", "mmc", "lmc") else ""


class Modelled(JobTable):
    """A table that says nothing which is not modelled."""

    @model_validator(mode="before")
    @classmethod
    def _modelled(cls, table: Any) -> Any:
        for name in _KEYS.keys() & (table.keys() if isinstance(table, Mapping) else set()):
            value = table[name]
            told = _KEYS[name] if value is not False else None
            if name == "what" and isinstance(value, str) and value.strip().casefold() == "concentricity":
                raise ValueError('ask for "coaxiality", of a circle as of an axis')
            if isinstance(value, str):
                told = _WORDS.get(value.strip().casefold().replace(" ", "_").replace("-", "_").strip("()"), told)
            if told:
                raise ValueError(f"{name} = {value!r} {told}: {_INSTEAD}")
        return table


Kind = Literal["point", "line", "plane", "circle", "sphere", "cylinder", "cone"]
Association = Literal["least_squares", "minimum_zone", "maximum_inscribed", "minimum_circumscribed", "tangent"]
Pattern = Literal["points", "grid", "sections", "lines", "circles", "spiral"]
# points that determine a feature
FEWEST: Mapping[Kind, int] = {"point": 1, "line": 2, "plane": 3, "circle": 3, "sphere": 4, "cylinder": 5, "cone": 6}

# of each kind, the first of which is its usual one
PATTERNS: Mapping[Kind, tuple[Pattern, ...]] = {
    "point": (), "line": ("points",), "plane": ("points", "grid", "circles", "spiral"), "circle": ("points",),
    "sphere": ("points", "sections", "spiral"), "cylinder": ("points", "sections", "lines", "spiral"),
    "cone": ("points", "sections", "lines", "spiral"),
}  # fmt: skip
# kinds with a diameter, whose material lies inside of it or around it
ROUND: tuple[Kind, ...] = ("circle", "sphere", "cylinder", "cone")
# kinds that are nothing without a direction: that in which a point is probed is against its normal
DIRECTED: tuple[Kind, ...] = ("point", "line", "plane", "circle", "cylinder", "cone")

# ways in which each kind is made of its points
ASSOCIATIONS: Mapping[Kind, tuple[Association, ...]] = {
    "point": ("least_squares",), "line": ("least_squares", "minimum_zone", "tangent"),
    "plane": ("least_squares", "minimum_zone", "tangent"),
    "circle": get_args(Association)[:4], "sphere": get_args(Association)[:4], "cylinder": get_args(Association)[:4],
    "cone": get_args(Association)[:2],
}  # fmt: skip
# keys that only some kinds have
KEYS: Mapping[str, tuple[Kind, ...]] = {
    "diameter_mm": (*ROUND, "plane"), "inner_diameter_mm": ("plane",), "angle_deg": ("cone",), "inner": ROUND,
    "length_mm": ("line", "plane", "cylinder", "cone"), "width_mm": ("plane",), "normal": ("line",),
    "along": ("plane", "circle", "sphere", "cylinder", "cone"),
}  # fmt: skip
_NEEDED: Mapping[Pattern, tuple[str, ...]] = {
    "points": ("points",), "grid": ("rows", "columns"), "sections": ("sections", "points"), "lines": ("lines", "points"),
    "circles": ("circles", "points"), "spiral": ("turns", "points"),
}  # fmt: skip

# keys of a strategy that only some patterns of some kinds heed
_ONLY: Mapping[str, Callable[[Kind, Pattern], bool]] = {
    "cap_deg": lambda kind, _: kind == "sphere",
    "margin_mm": lambda kind, _: kind not in ("circle", "sphere"),
    "start_deg": lambda kind, pattern: kind != "line" and (kind, pattern) not in (("plane", "grid"), ("plane", "points")),
    "sweep_deg": lambda kind, pattern: _ONLY["start_deg"](kind, pattern)
    and (pattern != "spiral" and (kind, pattern) != ("sphere", "points")),
}  # fmt: skip
Count = Annotated[int, Field(ge=1, le=LISTED.most)]
Angle = Annotated[float, Field(ge=-360, le=360)]
_NONE_OF_LENGTH = 1e-9  # length of a vector below which it has no direction


class Strategy(Modelled):
    """``strategy``: a pattern of points on the nominal surface."""

    pattern: Pattern
    """`points` spread evenly, a `grid`, `sections` across the axis, `lines` along it, `circles` about a plane's point, or
    a `spiral`."""
    points: Count | None = key(None, "Points in all; of `sections`, `lines` and `circles` those of each.")
    sections: Count | None = key(None, "Sections across the axis, or circles of latitude on a sphere.")
    lines: Count | None = key(None, "Lines along the axis.")
    circles: Count | None = key(None, "Concentric circles on a plane.")
    rows: Count | None = key(None, "Rows of a grid, across the plane's length.")
    columns: Count | None = key(None, "Columns of a grid, along the plane's length.")
    turns: Annotated[float, Field(gt=0, le=1000)] | None = key(None, "Turns of a spiral.")
    start_deg: Angle = key(0.0, "Angle of the first point from `along`, counted about the direction by the right hand.")
    sweep_deg: Annotated[float, Field(gt=0, le=360)] = 360.0
    """Angle that is probed, for part of a circle, cylinder or cone."""
    cap_deg: Annotated[float, Field(gt=0, lt=180)] = key(90.0, "Of a sphere, how far from its direction it is probed.")
    margin_mm: Annotated[float, Field(ge=0, le=1e6)] = key(0.0, "What stays free at each end and edge.")

    def problems(self) -> Iterator[str]:
        needed = _NEEDED[self.pattern]
        for name in needed:
            if getattr(self, name) is None:
                yield f"the pattern {self.pattern!r} needs {name}: give {' and '.join(needed)}"
        counts = {name for keys in _NEEDED.values() for name in keys}
        for name in sorted(counts & self.model_fields_set - set(needed)):
            yield f"the pattern {self.pattern!r} has no {name}: leave it out"


class FeatureFacts(Modelled):
    """One ``[[feature]]``."""

    name: Name = required("Name by which datums and characteristics name it.")
    kind: Kind = required("What it is.")
    point_mm: Triple = required("A point on it: its centre, the middle of its axis or line, or a point of its plane.")
    direction: Triple | None = None
    """Along a line or an axis, or normal: of a plane and a point out of the material. Of a sphere from its centre to the
    middle of what is probed, by default z. Of any length."""
    diameter_mm: Length | None = key(None, "Nominal diameter; of a cone at `point_mm`; of a round plane its outer one.")
    inner_diameter_mm: Length | None = key(None, "Inner diameter of a plane that is a ring.")
    angle_deg: Annotated[float, Field(gt=0, lt=180)] | None = None
    """Whole angle of a cone, which widens along its direction."""
    inner: bool | None = key(None, "Whether it is a hole: material lies around it.")
    length_mm: Length | None = None
    """How long it is along its direction, half on either side of `point_mm`; of a plane along `along`."""
    width_mm: Length | None = key(None, "How wide a plane is across `along`.")
    along: Triple | None = None
    """Across the direction: where angles begin and along what a plane's length lies; by default the axis of the part that is
    the most across, the first of several."""
    normal: Triple | None = key(None, "Of a line, out of the material of the surface that it lies on.")
    stylus: str = key("", "Name of the stylus that probes it; may be left out where there is one.")
    association: Association = "least_squares"
    """How it is made of its points, where a characteristic says nothing else."""
    strategy: Strategy | None = key(None, "Where it is probed: a pattern of points.")
    points_mm: Annotated[list[Triple], Field(max_length=LISTED.most)] | None = None
    """In place of a pattern, its contact points on the nominal surface; normals follow from it."""
    form: FormFacts | None = key(None, "Its own form and roughness, in place of `[form]`.")
    reported_as: str = key("", "Its name in the report that `[recording] values` names, where that is another.")

    @field_validator("direction", "along", "normal")
    @classmethod
    def _directions(cls, vector: list[float] | None) -> list[float] | None:
        if vector is not None and math.hypot(*vector) < _NONE_OF_LENGTH:
            raise ValueError(f"{vector} has no direction: give three components that are not all 0")
        return vector

    def problems(self) -> Iterator[str]:
        kind = self.kind
        for name, kinds in KEYS.items():
            if name in self.model_fields_set and kind not in kinds:
                yield f"a {kind} has no {name}: leave it out"
        if kind in DIRECTED and self.direction is None:
            yield f"a {kind} needs a direction: give direction = [x, y, z]"
        if kind in ROUND and (self.diameter_mm is None or self.inner is None):
            yield f"a {kind} needs diameter_mm, and inner: true of a hole, false of a shaft"
        if kind == "cone" and self.angle_deg is None:
            yield "a cone needs angle_deg: give its whole angle"
        if kind == "line" and self.normal is None:
            yield "a line needs normal: out of the material of the surface that it lies on"
        if self.association not in ASSOCIATIONS[kind]:
            known = ", ".join(ASSOCIATIONS[kind])
            yield f"a {kind} has no association {self.association!r}: give one of {known}"
        yield from self._source_of_points()

    def _source_of_points(self) -> Iterator[str]:
        kind = self.kind
        if kind == "point" and (self.strategy is not None or self.points_mm is not None):
            yield "a point is probed at point_mm: leave strategy and points_mm out"
        if kind != "point" and (self.strategy is None) == (self.points_mm is None):
            yield 'give either strategy = { pattern = "…", … } or points_mm = [[x, y, z], …]'
        if self.strategy is not None:
            yield from self._unfit(self.strategy)

    def _unfit(self, strategy: Strategy) -> Iterator[str]:
        """What keeps a pattern from being probed on it."""
        kind, pattern, disk = self.kind, strategy.pattern, self.diameter_mm is not None
        square = self.length_mm is not None and self.width_mm is not None
        if kind == "plane":
            if pattern == "grid" and not square:
                yield "a plane that is probed by a grid needs length_mm and width_mm"
            if pattern in ("circles", "spiral") and not disk:
                yield f"a plane that is probed by the pattern {pattern!r} needs diameter_mm"
            if square == disk:
                yield "a plane has either length_mm and width_mm, or diameter_mm"
            if self.inner_diameter_mm is not None and not 0 < self.inner_diameter_mm < (self.diameter_mm or 0.0):
                yield "inner_diameter_mm must be smaller than diameter_mm"
        elif kind in KEYS["length_mm"] and self.length_mm is None:
            yield f"a {kind} that is probed by a pattern needs length_mm"
        if pattern not in PATTERNS[kind]:
            known = ", ".join(PATTERNS[kind])
            yield f"a {kind} is not probed by the pattern {pattern!r}: give one of {known}"
        for name in sorted(strategy.model_fields_set & set(_ONLY)):
            if not _ONLY[name](kind, pattern):
                yield f"the pattern {pattern!r} of a {kind} has no {name}: leave it out"


What = Literal[
    "size", "straightness", "flatness", "roundness", "cylindricity", "sphericity", "distance", "angle", "parallelism",
    "perpendicularity", "angularity", "position", "coaxiality", "x", "y", "z", "circular_runout", "total_runout",
]  # fmt: skip

AXIAL: tuple[Kind, ...] = ("line", "cylinder", "cone")
# kinds whose direction is measured; that of a circle is nominal
TURNED: tuple[Kind, ...] = ("line", "plane", "cylinder", "cone")
ORIENTED: tuple[Kind, ...] = ("line", "plane", "circle", "cylinder", "cone")
EVERY: tuple[Kind, ...] = get_args(Kind)
PLACED: tuple[Kind, ...] = ("point", "circle", "sphere", "cylinder", "cone")


@dataclass(frozen=True)
class Asks:
    """What a characteristic is of."""

    kinds: tuple[Kind, ...]  # of features that it may be of
    features: int = 1  # how many of them
    datum_kinds: tuple[Kind, ...] = ()  # of datums that it may have; none where it has no datums
    datums: int = 0  # how many of them at least
    # how the drawing limits it: by a ``zone``, by ``lengths`` or by ``angles``
    limits: Literal["zone", "lengths", "angles"] = "zone"
    framed: bool = False  # whether it needs the alignment where it has no datums of its own
    alone: tuple[Kind, ...] = ()  # kinds of features of which it may be with one of them only


ASKS: Mapping[What, Asks] = {
    "size": Asks(("circle", "sphere", "cylinder"), limits="lengths"),
    "straightness": Asks(("line",)), "flatness": Asks(("plane",)), "roundness": Asks(("circle",)),
    "cylindricity": Asks(("cylinder",)), "sphericity": Asks(("sphere",)),
    "distance": Asks(EVERY, 2, limits="lengths"), "angle": Asks(TURNED, 2, limits="angles", alone=("cone",)),
    "parallelism": Asks(TURNED, 1, ORIENTED, 1), "perpendicularity": Asks(TURNED, 1, ORIENTED, 1),
    "angularity": Asks(TURNED, 1, ORIENTED, 1),
    "position": Asks(EVERY, 1, EVERY, framed=True), "coaxiality": Asks(("circle", *AXIAL), 1, AXIAL, 1),
    **{axis: Asks(PLACED, 1, EVERY, limits="lengths", framed=True) for axis in ("x", "y", "z")},
    "circular_runout": Asks(("plane", "circle", "cylinder"), 1, AXIAL, 1),
    "total_runout": Asks(("plane", "cylinder"), 1, AXIAL, 1),
}  # fmt: skip
"""Of each kind of characteristic (ISO 1101, ISO 5459, ISO 14405-1)."""


def with_article(what: str) -> str:
    """A characteristic in a sentence: ``an angle``."""
    return f"a coordinate {what}" if what in ("x", "y", "z") else f"{'an' if what.startswith('a') else 'a'} {what}"


# keys of a characteristic's limits, by how the drawing limits it
LIMITS: Mapping[str, tuple[str, ...]] = {
    "zone": ("tolerance_mm",), "lengths": ("lower_mm", "upper_mm"), "angles": ("lower_deg", "upper_deg"),
}  # fmt: skip
Degrees = Annotated[float, Field(ge=-360, le=360)]


class CharacteristicFacts(Modelled):
    """One ``[[characteristic]]``."""

    name: Name = required("Name or number on the drawing.")
    what: What = required("What is asked for.")
    features: Annotated[list[Name], Field(max_length=2)] = []
    """Names of the features that it is of: two of a distance and an angle, one of all else and of the angle of a cone."""
    datums: Annotated[list[Name], Field(max_length=6)] = []
    """Names of the features that are its datums, in order, `"A-B"` of a common datum on both; where it needs some and has
    none, those of `[alignment]`."""
    tolerance_mm: Length | None = None
    """Width of the tolerance zone, of form, orientation, location and runout; of a position its diameter."""
    lower_mm: Position | None = key(None, "Lower limit of a size, distance or coordinate.")
    upper_mm: Position | None = key(None, "Upper limit of a size, distance or coordinate.")
    lower_deg: Degrees | None = key(None, "Lower limit of an angle.")
    upper_deg: Degrees | None = key(None, "Upper limit of an angle.")
    u_operator_um: Uncertainty = 0.0
    """Standard uncertainty by who measures and how, of repeats of one's own; of a length."""
    u_operator_deg: Annotated[float, Field(ge=0, le=10)] = key(0.0, "The same of an angle, °.")
    association: Association | None = None
    """How its features are made of their points, where not as they say themselves."""
    reported_as: str = key("", "Its name in the report that `[recording] values` names: `LOC1.D` of PC-DMIS.")

    @property
    def asks(self) -> Asks:
        return ASKS[self.what]

    def problems(self) -> Iterator[str]:
        count = self.asks.features
        if not self.features:
            example = ", ".join(['"…"'] * count)
            yield f"names no feature: give features = [{example}], whose {self.what} it is"
        if len(self.features) != count and not (self.asks.alone and len(self.features) == 1):
            said = f"{count} {'features' if count > 1 else 'feature'}"
            yield f"{with_article(self.what)} is of {said}: give so many"
        if len(set(self.features)) < len(self.features):
            yield f"{with_article(self.what)} is of two features: {self.features[0]!r} stands there twice"
        if self.datums and not self.asks.datum_kinds:
            yield f"{self.what} has no datums: leave them out"
        if len(self.datums) < self.asks.datums:
            yield f"{self.what} is about a datum: give datums with the name of a feature"
        if twice := [name for name in self.datums if self.datums.count(name) > 1 or name in self.features]:
            yield f"{twice[0]!r} cannot be its own datum, or a datum twice"
        yield from self._unfit_limits()

    def _unfit_limits(self) -> Iterator[str]:
        what, own, angle = with_article(self.what), LIMITS[self.asks.limits], self.asks.limits == "angles"
        for name in (name for names in LIMITS.values() for name in names):
            if getattr(self, name) is not None and name not in own:
                yield f"{what} has no {name}: its limits are {' and '.join(own)}"
        if self.u_operator_um if angle else self.u_operator_deg:
            yield f"{what} has no u_operator_{'um' if angle else 'deg'}: give the other one"
        for low, high in ((self.lower_mm, self.upper_mm), (self.lower_deg, self.upper_deg)):
            if low is not None and high is not None and not low < high:
                yield f"its lower limit {low:g} is not below its upper limit {high:g}: exchange or mend them"
