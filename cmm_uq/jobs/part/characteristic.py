"""``[[characteristic]]``: what the drawing asks for, of which features, about which datums, within which limits."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Annotated, Literal

from pydantic import Field

from cmm_uq.base.files.table import Length, Position, Uncertainty, key, required
from cmm_uq.jobs.part.feature import Association, Kind, Modelled, Name

What = Literal[
    "size", "straightness", "flatness", "roundness", "cylindricity", "sphericity", "distance", "angle", "parallelism",
    "perpendicularity", "angularity", "position", "coaxiality", "x", "y", "z", "circular_runout", "total_runout",
]  # fmt: skip

AXIAL: tuple[Kind, ...] = ("line", "cylinder", "cone")
# kinds whose direction is measured; that of a circle is nominal
TURNED: tuple[Kind, ...] = ("line", "plane", "cylinder", "cone")
DIRECTED: tuple[Kind, ...] = ("line", "plane", "circle", "cylinder", "cone")
EVERY: tuple[Kind, ...] = ("point", "line", "plane", "circle", "sphere", "cylinder", "cone")
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
    "parallelism": Asks(TURNED, 1, DIRECTED, 1), "perpendicularity": Asks(TURNED, 1, DIRECTED, 1),
    "angularity": Asks(TURNED, 1, DIRECTED, 1),
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
