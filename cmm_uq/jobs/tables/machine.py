"""``[machine]``: the machine, its travel, its error maps, the temperatures of its scales, and when it is calibrated again."""

from __future__ import annotations

import datetime as dt
from collections.abc import Iterable, Iterator
from typing import Annotated, Literal

from pydantic import AfterValidator, Field

from cmm_uq.base.files import table as forms
from cmm_uq.base.files.limits import COLUMNS, LISTED, MAPS
from cmm_uq.base.files.table import JobTable, Length, Limit, Number, Range, Temperature, Triple, key, required
from cmm_uq.jobs.tables import rotary_axes
from cmm_uq.jobs.tables.arm import MOST_JOINTS, ArmFacts, JointFacts
from cmm_uq.jobs.tables.rotary_axes import HeadFacts, RotaryErrorsFile, RotaryFacts, RotaryTableFacts

Method = Literal["fixed", "A3", "S2", "staircase", "control chart", "drift"]
Months = Annotated[int, Field(ge=1, le=600)]


class Recalibration(JobTable):
    """``calibrate``: without a method a fixed interval, or method A3 where a reliability is given."""

    every_months: Months = 12
    """Months between calibrations; where a method adapts them, the interval it begins with."""
    method: Method | None = None
    """How the interval follows from the history: `fixed`, NCSLI RP-1 `A3` or `S2`, `staircase`, `control chart`, `drift`."""
    reliability: Annotated[float, Field(ge=0.5, le=0.999)] | None = None
    """Probability with which the machine is to be within its limits at its next calibration; 0.95 where nothing is said."""
    shortest_months: Months = key(1, "Shortest interval that a method may come to.")
    longest_months: Months | None = None
    """Longest interval that a method, or with a fixed one interim checks in control, may come to."""

    def problems(self) -> Iterator[str]:
        longest = self.longest_months
        if longest is not None and not self.shortest_months <= self.every_months <= longest:
            yield (
                f"every_months = {self.every_months} lies outside {self.shortest_months} to {longest} months: "
                "give shortest_months ≤ every_months ≤ longest_months"
            )
        if self.method == "fixed" and self.reliability is not None:
            yield "a fixed interval knows no reliability: leave it out, or name another method"


HOTTEST_C = 100.0  # °C at which a machine may be mapped: far beyond any, and far below any temperature in kelvin
ZERO_C = 273.15  # K
SHORTEST_TRAVEL_MM = 1e-3  # positions are divided by the travel
Angle = Annotated[float, Field(ge=-36_000, le=36_000)]  # A squareness error, ″: ten degrees
Turn = Annotated[float, Field(ge=-360, le=360)]  # an angle of a pose, °

Sensors = Annotated[list[forms.Column], Field(min_length=1, max_length=COLUMNS.most)]
"""Columns of the thermocouples on one scale."""


class Travel(JobTable):
    """``travel_mm``: lowest and highest scale reading of each axis."""

    x: Range | None = key(None, "Lowest and highest scale reading of x.")
    y: Range | None = key(None, "Lowest and highest scale reading of y.")
    z: Range | None = key(None, "Lowest and highest scale reading of z.")

    def problems(self) -> Iterator[str]:
        for axis in "xyz":
            travel = getattr(self, axis)
            if travel and travel[1] - travel[0] < SHORTEST_TRAVEL_MM:
                yield f"{axis} = {travel}: a travel of less than {SHORTEST_TRAVEL_MM:g} mm is none"


class SquarenessFacts(JobTable):
    """``squareness_arcsec``: beside an error map."""

    xy: Angle = key(0.0, "Squareness of y to x: e_x = −S·y.")
    yz: Angle = key(0.0, "Squareness of z to y: e_y = −S·z.")
    zx: Angle = key(0.0, "Squareness of z to x: e_x = −S·z.")


def _of_a_workshop(celsius: float) -> float:
    if celsius > HOTTEST_C:
        kelvin = f": {celsius:g} K are {celsius - ZERO_C:g} °C" if ZERO_C - 50 <= celsius <= ZERO_C + HOTTEST_C else ""
        raise ValueError(f"no machine is mapped at {celsius:g} °C{kelvin}. Give the temperature in °C")
    return celsius


class ErrorMapFile(JobTable):
    """One error map, the temperature it was taken at, and the squareness of the axes at that temperature."""

    file: str = required("CSV of the map: axis, position_mm, three translations in µm and three rotations in ″.")
    temperature_c: Annotated[Temperature, AfterValidator(_of_a_workshop)]
    """Temperature of the scales at which the map was taken."""
    squareness_arcsec: SquarenessFacts | None = key(None, "Squareness of the axes at that temperature.")
    covariance: str | None = None
    """Factor F of the covariance F·Fᵀ of the map's figures, as an `.npy` file that `compensate --new-map` writes."""
    u_beside_um: Annotated[list[forms.Uncertainty], Field(min_length=3, max_length=3)] = [0.0, 0.0, 0.0]
    """Standard uncertainties along x, y and z of errors that the map does not hold, beside its covariance."""

    def problems(self) -> Iterator[str]:
        if any(self.u_beside_um) and self.covariance is None:
            yield 'u_beside_um stands beside a covariance: name its file, covariance = "….npy", or leave it out'


def _of_all_or_none(maps: list[ErrorMapFile]) -> list[ErrorMapFile]:
    stated = [given.file for given in maps if given.covariance is not None]
    if stated and len(maps) > 1:
        raise ValueError(
            f"the map {stated[0]!r} has a covariance, which says nothing of maps between two. Name that map alone, or none"
        )
    without = [given.file for given in maps if given.squareness_arcsec is None]
    if without and len(without) < len(maps):
        raise ValueError(
            f"the map {without[0]!r} has no squareness_arcsec, and another has: between them it would fall to zero. "
            "Give it for each map"
        )
    return maps


class ScaleColumns(JobTable):
    """``columns`` of a temperature log: the thermocouples on each scale, by the names of their columns."""

    x: Sensors = required("Columns of the thermocouples on the scale of x.")
    y: Sensors = required("Columns of the thermocouples on the scale of y.")
    z: Sensors = required("Columns of the thermocouples on the scale of z.")


class TemperatureLogFile(JobTable):
    """``temperature_log``: what the scales' thermocouples showed while the recording was made."""

    file: str = required("CSV of the log: `time_s` or `time`, and the temperatures.")
    start: dt.datetime | None = key(None, "Moment at which the recording's `time_s` was 0, for a log that gives dates.")
    columns: ScaleColumns | None = None
    """Columns of the thermocouples on each scale, where their names do not say so."""
    max_gap_s: forms.Positive | None = key(None, "Longest interval of the log that is interpolated over.")


class Pose(JobTable):
    """Attitude of a digitizer in one index of the wrist: Euler angles 3-1-3 (Harris 2004 eq. 7)."""

    pose: Number = key(1, "Number of the pose, as the cloud or the recording gives it.")
    alpha_deg: Turn = required("First Euler angle (3-1-3).")
    beta_deg: Turn = required("Second Euler angle.")
    gamma_deg: Turn = required("Third Euler angle.")


class DigitizerFacts(JobTable):
    """``digitizer``: a laser digitizer on the ram."""

    offset_mm: Triple | None = key(None, "[U1, V1, W1]: the mount in the digitizer's frame.")
    poses: Annotated[list[Pose], Field(max_length=LISTED.most)] = key([], "Attitudes of the digitizer.")
    calibration: Annotated[str, Field(min_length=1)] | None = None
    """In place of both: `results.json` of the digitizer's calibration, or the folder with it, inside the job's."""

    def problems(self) -> Iterator[str]:
        if (self.offset_mm is None) == (self.calibration is None):
            yield 'give either offset_mm = [U1, V1, W1] with poses, or calibration = "FOLDER"'
        if self.offset_mm is not None and not self.poses:
            yield "offset_mm is given without poses: give the Euler angles of each"
        numbers = [pose.pose for pose in self.poses]
        for number in numbers:
            if numbers.count(number) > 1:
                yield f"pose {number} is there twice: number each pose as the cloud does"


Reading = Literal[
    "exposed optical grating", "sealed optical grating", "laser interferometer", "inductive scale", "magnetic scale",
    "rack and rotary encoder", "ball screw and rotary encoder", "unknown",
]  # fmt: skip
SCREW = "ball screw and rotary encoder"
Interval = Annotated[list[Length], Field(min_length=2, max_length=2)]  # mm, and the largest deviation within, µm


class AxisFacts(JobTable):
    """One ``[[axes]]``: how axes are read, as a data sheet states it; what is left out is as published of the kind."""

    names: Annotated[list[Literal["x", "y", "z"]], Field(min_length=1, max_length=3)] = required("Axes that it is of.")
    reading: Reading = required("What its coordinate is read by; unknown leaves all to the recording.")
    source: Annotated[str, Field(max_length=200)] = key("", "Who states this: data sheet or nameplate, with its date.")
    period_mm: Length | None = None
    """Period of a scale's signal (20 µm: 0.02); of a screw its lead, of a rack the travel for one turn of its pinion."""
    interpolation_um: Limit | None = key(None, "Largest deviation within one period, to either side.")
    deviation: Annotated[list[Interval], Field(max_length=8)] = []
    """Largest deviations to either side within sections: `[[1000, 5], [10, 0.275]]` is a scale of ±5 µm in a metre and
    ±0.275 µm in 10 mm."""
    grade: Literal[1, 3, 5, 7] | None = key(None, "Tolerance grade of a ball screw by ISO 3408-3.")
    play_um: Limit | None = key(None, "Largest difference of readings of one place reached from either side.")

    def problems(self) -> Iterator[str]:
        stated = ("period_mm", "interpolation_um", "deviation", "grade", "play_um")
        figures = [name for name in stated if getattr(self, name)]
        if self.reading == "unknown" and (figures or self.source):
            yield f'reading = "unknown" knows no {(figures or ["source"])[0]}: leave it out, or say how the axis is read'
        if self.reading != "unknown" and not self.source.strip():
            yield 'nobody states this: name the data sheet with its date, source = "…"'
        if self.grade is not None and (self.reading != SCREW or self.deviation):
            yield f'grade is of reading = "{SCREW}", in place of its deviation: leave one out'
        for name in ("interpolation_um", "grade"):
            if getattr(self, name) is not None and self.period_mm is None:
                yield f"{name} is of a period, of a screw its lead: give period_mm"
        if self.interpolation_um is not None and self.period_mm and self.interpolation_um > 500 * self.period_mm:
            yield f"interpolation_um = {self.interpolation_um:g} is more than half of period_mm = {self.period_mm:g}"
        if self.reading.startswith(("rack", "ball")) and self.period_mm is not None and self.period_mm < 0.1:
            yield f"period_mm = {self.period_mm:g}: of a screw the lead, of a rack the travel for one turn of its pinion"


def _each_once(axes: list[AxisFacts]) -> list[AxisFacts]:
    every = [name for one in axes for name in one.names]
    for name in sorted({name for name in every if every.count(name) > 1}):
        raise ValueError(f"how {name} is read is stated twice: leave one out")
    return axes


AxesFacts = Annotated[list[AxisFacts], Field(max_length=3), AfterValidator(_each_once)]


def stated_axes(axes: Iterable[AxisFacts]) -> dict[str, AxisFacts]:
    """By axis, of those of which something is known."""
    return {name: one for one in axes if one.reading != "unknown" for name in one.names}


class FurtherFacts(JobTable):
    """One ``further``: another certificate of the machine, of another artefact or of another day."""

    certificate: Annotated[str, Field(min_length=1, max_length=100)]
    """The certificate (PDF, or XML with its inputs), or the folder with it, inside the job's."""
    corrected: bool = False
    """Whether the machine corrected what its calibration found while that recording was made; the artefact is then seen by a
    corrected machine."""


FurtherList = Annotated[list[FurtherFacts], Field(max_length=8)]


class MachineFacts(JobTable):
    """``[machine]``."""

    name: str = required("Name of the machine.")
    manufacturer: str = key("", "Manufacturer of the machine.")
    model: str = key("", "Model or type of the machine.")
    serial: str = key("", "Serial number of the machine (7.8.2.1 g).")
    owner: str = key("", "Owner of the machine.")
    chain: Annotated[str, Field(pattern=r"^[XYZF]{3,4}(-[A-Z]*)?(\|[A-Z]*)?$")] = "XYZ"
    """Carriages from the table to the ram, with F for the frame where the workpiece moves; behind a hyphen the rotary axes of
    a head, from the ram to the probe, such as `XYZ-CA`; behind a bar the rotary tables that the workpiece stands on, from
    the bed, such as `XYZ|C`, or `XYZ|AC` with C on A."""
    table: RotaryTableFacts = RotaryTableFacts.left_out("The rotary table of the chain.")
    rotary: Annotated[list[RotaryFacts], Field(max_length=3)] = key(
        [], "The rotary axes of a chain with several, or with a head."
    )
    head: HeadFacts = HeadFacts.left_out("The head that turns the probe.")
    joint: Annotated[list[JointFacts], Field(max_length=MOST_JOINTS)] = []
    """Joints of an arm, or of a robot, from the base to the flange, in place of carriages."""
    arm: ArmFacts = ArmFacts.left_out("What holds for all joints, and the tool.")
    travel_mm: Travel = Travel.left_out("Lowest and highest scale reading of each axis.")
    origin_mm: Triple = [0.0, 0.0, 0.0]
    """Scale reading of the recording's origin: scale reading = recorded coordinate + origin."""
    axes: AxesFacts = key([], "How axes are read: what is known beforehand of their periodic errors and play.")
    error_map: Annotated[list[ErrorMapFile], Field(max_length=MAPS.most), AfterValidator(_of_all_or_none)] = []
    """Error maps of the machine; several are interpolated by the temperature of the scales."""
    squareness_arcsec: SquarenessFacts | None = key(None, "Squareness of the axes beside an error map.")
    rotary_errors: RotaryErrorsFile | None = key(
        None, "Errors of a machine with rotary axes, beside maps of its carriages."
    )
    temperature_log: TemperatureLogFile | None = None
    """What the scales' thermocouples showed while the recording was made."""
    digitizer: DigitizerFacts | None = key(None, "A laser digitizer on the ram.")
    further: FurtherList = []
    """Further certificates of the machine, whose recordings are taken together with this one: for its error factors over the
    measuring range and for its error map."""
    calibrate: Recalibration | None = key(None, "When the machine is to be calibrated again, for `cmm-uq due`.")

    def problems(self) -> Iterator[str]:
        for file in [each.file for each in self.error_map if each.squareness_arcsec and self.squareness_arcsec]:
            yield f"squareness_arcsec is given for the machine and for the map {file!r}: leave out one of the two"
        rotary_axes.check_carriages(self.chain)
        yield from rotary_axes.rotary_problems(self.chain, self.rotary, self.table, self.head)
        if self.rotary_errors and not set(self.chain) & set("-|"):
            yield "rotary_errors are of a machine with rotary axes: name an error_map, or mend the chain"
        own = _OF_ARMS if self.joint else _OF_ARMS | {"origin_mm"}
        if self.is_arm and (wrong := sorted(self.model_fields_set - own)):
            an_arm = "[[machine.joint]]" if self.joint else "[machine.arm]"
            yield f"{wrong[0]} is of a machine of carriages, and {an_arm} of an arm: leave one of them out"
        screws = [number for number, joint in enumerate(self.joint, 1) if joint.direction is not None]
        if screws and len(screws) < len(self.joint):
            other = next(i for i in range(1, len(self.joint) + 1) if i not in screws)
            yield f"joint {screws[0]} is a screw axis and joint {other} a row: state all joints in one way"
        if screws and not self.arm.home:
            yield "[machine.arm] home is missing: screw axes do not say where the last frame is when all joints read 0"
        if self.arm.home and self.joint and not screws:
            yield "[machine.arm] home is of screw axes, and joints are rows: leave it out, or give direction and point_mm"
        if screws and "convention" in self.arm.model_fields_set:
            yield "[machine.arm] convention is of rows, and joints are screw axes: leave it out"
        rows = self.joint and not screws and not any(self.arm.tool_mm)
        if rows and not any((one.a_mm, one.d_mm) != (0, 0) for one in self.joint):
            yield "no [[machine.joint]] has a length, and the tool is on the last: give a_mm and d_mm of its rows"
        if not self.joint and self.arm.model_fields_set - ({"reach_mm", "up"} if self.is_arm else set()):
            yield "[machine.arm] is of an arm: give its rows, [[machine.joint]], or of one whose joints are not read reach_mm"

    @property
    def corrections(self) -> tuple[ErrorMapFile | RotaryErrorsFile, ...]:
        """What the machine is corrected by."""
        return (*self.error_map, *([self.rotary_errors] if self.rotary_errors else []))

    @property
    def is_arm(self) -> bool:
        return bool(self.joint or self.arm.reach_mm)


_OF_ARMS = frozenset(("name", "manufacturer", "model", "serial", "owner", "joint", "arm", "calibrate"))


class ProbeFacts(JobTable):
    """``[probe]``: with what the recording was made; ``sensing`` says whether it touches."""

    sensing: Literal["contacting", "optical"] | None = None
    """Whether the probe touches; standards are for one or the other."""
    name: str = key("", "Name of the probe.")
    stylus: str = key("", "Name of the stylus.")
