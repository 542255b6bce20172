"""``[plan]``, ``[acquire]`` and ``[prove]``: what may be measured, by which instruments, and what a proof must reach.

``[[effect]]``: physics that a laboratory states in its own job, as a formula with its parameters.
"""

from __future__ import annotations

from collections.abc import Iterator
from math import hypot
from typing import Annotated, Literal

from pydantic import Field, field_validator

from cmm_uq.base.files import table as forms
from cmm_uq.base.files.limits import COLUMNS, LISTED
from cmm_uq.base.files.table import Column, JobTable, Length, Triple, Uncertainty, Unit, at_least, key, required
from cmm_uq.base.messages import Text, Verbatim

Criterion = Literal["separation", "D", "A", "worst"]
Duration = Annotated[float, Field(ge=0, le=1e6)]  # minutes or seconds
_SHORTEST = 1e-6  # length of a direction below which it is none
Direction = Annotated[list[Annotated[float, Field(ge=-1e6, le=1e6)]], Field(min_length=3, max_length=3)]


_Least = Annotated[int, Field(ge=1, le=1_000_000)]


class CompleteTest(JobTable):
    """``complete``: what a complete test has at least, by the laboratory's own rule; copies do not count."""

    measurements: _Least = required("Measurements, each a position or placing of the artefact.")
    repeats: _Least = required("Repeats of each measurement.")
    points: _Least = required("Points of each repeat.")


class FixtureFacts(JobTable):
    """``[plan.fixtures]``: how the artefact may stand."""

    directions: Annotated[list[Direction], Field(max_length=LISTED.most)] = []
    """Directions in which a bar or gauge can be held, either way along it, or normals of a plate or triangle; any
    without them."""
    heights_mm: forms.Pair | None = key(None, "Lowest and highest z reading of the artefact's middle.")

    def problems(self) -> Iterator[str]:
        if any(not any(direction) for direction in self.directions):
            yield "directions: [0, 0, 0] points nowhere"
        if any(hypot(*direction) < _SHORTEST for direction in self.directions):
            yield f"directions: one is shorter than {_SHORTEST:g}"
        if self.heights_mm is not None and not self.heights_mm[0] <= self.heights_mm[1]:
            yield f"heights_mm = {self.heights_mm}: the first number must be the lower one"


class ObstacleFacts(JobTable):
    """One ``[[plan.poses.obstacle]]``: a box in the frame of the machine, of an arm that of its base."""

    low_mm: Triple = required("Its lowest corner, [x, y, z].")
    high_mm: Triple = required("Its highest corner.")
    name: str = key("", "What stands there.")

    def problems(self) -> Iterator[str]:
        if any(low >= high for low, high in zip(self.low_mm, self.high_mm, strict=True)):
            yield f"obstacle {self.low_mm} to {self.high_mm} has no inside: give low_mm below high_mm along x, y and z"


class PosesFacts(JobTable):
    """``[plan.poses]``: what stands in the way of an arm, and of the beam of a tracker."""

    obstacle: Annotated[list[ObstacleFacts], Field(max_length=LISTED.most)] = []
    """Boxes that no link, no joint and no tool may enter, and that hide the reflector."""
    floor_mm: forms.Position | None = key(
        None, "Height along z of the base's frame below which nothing that moves goes."
    )
    clearance_mm: Annotated[float, Field(ge=0, le=1e4)] = 50.0
    """How far links, which are taken as lines, keep from floor and boxes, and a beam from links."""
    station_mm: Triple | None = key(
        None, "Where the tracker stands in the machine's frame, to which the reflector is seen."
    )
    opening: Direction | None = None
    """Direction in the last frame into which the reflector opens, where nobody turns it towards the tracker."""
    acceptance_deg: Annotated[float, Field(gt=0, le=180)] = 30.0
    """Largest angle between that direction and the beam."""

    def problems(self) -> Iterator[str]:
        if self.opening is not None and self.station_mm is None:
            yield "opening needs a tracker to open to: give station_mm = [x, y, z]"
        if self.opening is not None and hypot(*self.opening) < _SHORTEST:
            yield f"opening = {self.opening} is no direction"


class PlanFacts(JobTable):
    """``[plan]``.

    With a ``criterion`` a better plan than the ready one is searched for: of ``number`` placings, or of ``more`` beside those
    that there are.
    """

    ready: str | None = None
    """Name of the ready plan to start from; the usual one of the kind where it is left out."""
    volume_mm: dict[Literal["x", "y", "z"], forms.Range] = {}
    """Scale readings that points may have; the machine's travel, else the recorded range."""
    margin_mm: Annotated[float, Field(ge=0, le=1e6)] = key(10.0, "Kept free at each end of that range.")
    fixtures: FixtureFacts = FixtureFacts.left_out("How the artefact may stand.")
    poses: PosesFacts = PosesFacts.left_out("What stands in the way of an arm, and of the beam of a tracker.")
    length_mm: Length | None = key(None, "Length of an artefact that is not certified, roughly.")
    lengths_mm: Annotated[list[Length], Field(max_length=LISTED.most)] = []
    """Distances of a gauge's faces from the first, or lengths of blocks."""
    pitch_mm: Length | None = None
    """Distance of neighbouring faces of a gauge (20 mm by default) or balls of a plate."""
    grid: Annotated[list[Annotated[int, Field(ge=2, le=100)]], Field(min_length=2, max_length=2)] = [5, 5]
    """Balls of a plate, or points on a surface, along each side."""
    faces: Annotated[int, Field(ge=3, le=360)] = key(12, "Faces of a polygon on a rotary table.")
    both_ways: bool | None = None
    """Whether faces of a gauge are met on the way back too; the ready plan of ISO 10360-2 does so by default."""
    repeats: Annotated[int, Field(ge=1, le=20)] = key(3, "How often each point is measured.")
    rivals: forms.Names | None = None
    """Effects that may act and are not named in the model; by default all linear ones that these columns could show."""
    columns: Annotated[dict[Column, forms.AnyFloat], Field(max_length=COLUMNS.most)] = {}
    """Further columns of the recording at a constant value, such as temperatures."""
    unseen: bool | None = None
    """Whether what a diagnosis says to measure next shall also show what the recording could not have shown; by default where
    it agrees with the model."""
    criterion: Criterion | None = None
    """What a better plan is searched by: that effects can be told apart, or the volume, mean or worst variance."""
    number: Annotated[int, Field(ge=1, le=200)] | None = None
    """Placings of the better plan; as many as the ready plan by default."""
    more: Annotated[int, Field(ge=1, le=50)] | None = key(None, "Placings to be added to those that there are.")
    candidates: Annotated[int, Field(ge=1, le=2000)] = key(300, "Placings that a better plan is chosen from.")
    minutes_per_placing: Duration = key(5.0, "Time to set up the artefact once, min.")
    seconds_per_point: Duration = key(10.0, "Time to measure one point, s.")
    noise_from: str | None = None
    """`results.json` of an earlier recording, or the folder with it inside the job's, whose noise is expected again."""
    placing_um: Uncertainty | None = key(None, "Standard deviation of a set-up offset, instead.")
    growth_um: Uncertainty | None = None
    """Standard deviation of what grows with the length, at the longest, instead."""
    budget_min: Annotated[float, Field(gt=0, le=1e6), at_least(1e-3)] | None = None
    """Time that there is, min; unlimited by default."""

    def problems(self) -> Iterator[str]:
        if self.number is not None and self.more is not None:
            yield "number and more are both given: a plan of so many, or so many beside what there is"
        if self.noise_from is not None and (self.placing_um is not None or self.growth_um is not None):
            yield "noise_from and placing_um or growth_um are both given: name the recording, or state the sizes"
        if self.criterion is None and (self.number is not None or self.more is not None):
            yield 'number and more need a criterion: criterion = "separation", "D", "A" or "worst"'


class DeclaredSource(JobTable):
    """One ``[[acquire.source]]``: an instrument, the port it is at, and what of it is recorded."""

    name: Annotated[str, Field(pattern=r"^[A-Za-z0-9._-]+$", max_length=60)]
    """Name of the source in this job, unique: letters, digits, `.`, `_` and `-`."""
    profile: Annotated[str, Field(min_length=1, max_length=200)]
    """How the instrument speaks: a ready profile (`cmm-uq instruments list`), or a TOML file of one's own beside job.toml."""
    port: Annotated[str, Field(max_length=300)] = ""
    """Where it is: `/dev/ttyUSB0`, `COM3`, `socket://host:port`, `rfc2217://host:port`, `tcp://host:port`,
    `visa://RESOURCE`, `pt104://host:port`, or `file:NAME` to replay bytes. """
    serial: str = key("", "Serial number of the instrument; one that it gives itself must be the same.")
    certificate: str = key("", "Number of its calibration certificate.")
    values: Annotated[dict[str, Column], Field(max_length=100)] = {}
    """Column of the recording by the quantity that the instrument gives; without it each goes into the column of its name."""
    units: Annotated[dict[str, Unit], Field(max_length=100)] = {}
    """Unit by quantity, where the instrument does not say it: `{ length_mm = "inch" }`; that of the profile where left out."""
    latency_ms: Annotated[float, Field(ge=0, le=1e6)] = 0.0
    """How long before the last byte of a message came its quantities were measured."""


class AcquireFacts(JobTable):
    """``[acquire]``: a recording taken live, by `cmm-uq acquire`."""

    plan: str | None = None
    """Plan to be measured, a CSV of `cmm-uq plan` beside job.toml; without it the one that `[plan]` asks for."""
    folder: str | None = None
    """Folder that the machine's program drops results into, as seen from job.toml; each file is read once it stands still."""
    max_gap_s: Annotated[float, Field(gt=0, le=1e6), at_least(1e-3)] = 10.0
    """Longest time between two readings of an instrument that is interpolated over; in a longer one a point has no value."""
    soak_k_per_h: Annotated[float, Field(gt=0, le=1000)] | None = None
    """Largest change of each temperature in an hour before the measurement begins; that of `[rated_conditions]` without it."""
    soak_min: Annotated[float, Field(gt=0, le=1e5), at_least(0.01)] = 30.0
    """Time over which that change is taken, min."""
    repeats_most: Annotated[int, Field(ge=1, le=100)] = 5
    """How often a set-up is measured at most, where the scatter of its repeats asks for more."""
    source: Annotated[list[DeclaredSource], Field(max_length=100)] = []
    """The instruments, each a table of its own."""

    @field_validator("source")
    @classmethod
    def _names_differ(cls, sources: list[DeclaredSource]) -> list[DeclaredSource]:
        names = [source.name for source in sources]
        for name in names:
            if names.count(name) > 1:
                raise ValueError(f"two sources are called {name!r}: give each a name of its own")
        return sources


Percent = Annotated[float, Field(ge=0, le=100)]


class ProveFacts(JobTable):
    """``[prove]``: what `cmm-uq prove` compares its figures with. It is sealed with the truth of the cases."""

    false_alarms_pct: Annotated[float, Field(gt=0, lt=100)] = 2.0
    """Largest rate of false alarms, in percent of the recordings that hide nothing."""
    coverage_pct: Annotated[list[Percent], Field(min_length=2, max_length=2), forms.RISING] = [93.0, 97.0]
    """Lowest and highest percentage of 95 % intervals that hold the truth."""
    wrong_names_pct: Annotated[float, Field(gt=0, lt=100)] | None = None
    """Largest percentage of recordings in which an effect is named that does not act."""
    found_pct: Percent | None = None
    """Least percentage of hidden effects that are found, of all strengths that are drawn."""


Name = Annotated[str, Field(pattern=r"^[a-z][a-z0-9_]*$", max_length=40)]
Size = Annotated[float, Field(gt=0, le=1e12), at_least(1e-12)]  # in a unit that only the table itself says
SHAPES = 2  # parameters that shape an effect, at most


class EffectParameter(JobTable):
    """A number that says how large an effect is, or that shapes it."""

    unit: str = required(
        "Its unit: `µm`, `µm/m`, `µm/m²`, `ppm`, `″`, `″/m`, `µm/K`, `µm/h`, `h`, …; `1` for a mere number."
    )
    prior: Size | None = key(None, "Standard deviation that physics allows, about zero, in its unit.")
    low: Size | None = key(
        None, "Least value of one that shapes the effect, in place of `prior`: a length, a time constant."
    )
    high: Size | None = key(None, "Largest value of it.")

    def problems(self) -> Iterator[str]:
        if self.prior is None and (self.low is None or self.high is None or self.low >= self.high):
            yield "a parameter has a prior, or a low below a high: give one or the other"
        if self.prior is not None and not self.low is self.high is None:
            yield "a parameter has a prior, or low and high: leave one of them out"


class EffectFacts(JobTable):
    """An effect of the laboratory's own."""

    name: Name = required("Its name, by which `[model] effects`, truth.toml and results.json call it.")
    formula: str | Annotated[list[str], Field(min_length=1, max_length=3)]
    """The error in mm by the rule *true = indicated + e*, `e_x = k*x*(y - 500)/1000`; several with `;` between, or a list."""
    title: str = key("", "In a few words, for documents; its name where it is left out.")
    unit: str | None = key(None, "Unit of `k`, where that is the only parameter.")
    prior: Size | None = key(None, "Standard deviation of `k` that physics allows, about zero, in its unit.")
    parameters: Annotated[dict[Name, EffectParameter], Field(max_length=10)] = {}
    """Parameters by name, where there are others than `k`: `{ bow = { unit = "µm", prior = 5 }, tau = { unit = "h", low = 0.2,
    high = 20 } }`."""
    points_to: str = ""
    """What a technician should look at where it is found, to follow "What it points to:", without a full stop."""

    def problems(self) -> Iterator[str]:
        alone = self.unit is not None and self.prior is not None
        if bool(self.parameters) == alone or (self.unit is None) != (self.prior is None):
            yield "give unit and prior of k, or a table of parameters"
        if sum(one.low is not None for one in self.parameters.values()) > SHAPES:
            yield f"more than {SHAPES} parameters have low and high: a diagnosis tries all their values with each other"

    @property
    def parts(self) -> tuple[str, ...]:
        """The formula, an equation each."""
        text = [self.formula] if isinstance(self.formula, str) else self.formula
        return tuple(part.strip() for one in text for part in one.split(";") if part.strip())

    @property
    def each(self) -> dict[str, EffectParameter]:
        """The parameters by name."""
        return self.parameters or {"k": EffectParameter(unit=self.unit or "1", prior=self.prior)}

    @property
    def words(self) -> Text:
        return Verbatim(self.title or self.name.replace("_", " ").capitalize())
