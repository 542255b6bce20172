"""The built-in kinds: what a job says of each artefact, what a new job of it begins with, and where its parts are."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Annotated, Any, ClassVar, Literal

from pydantic import Field

from cmm_uq.artefacts.axis_runs.kind import APPROACHES, AXIS_RUNS, InterferometerFacts
from cmm_uq.artefacts.spheres.kind import RING
from cmm_uq.base.files.limits import LISTED
from cmm_uq.base.files.table import JobTable, Length, Number, Numbers, Position, Triple, Uncertainty, key, required
from cmm_uq.base.points import AXES
from cmm_uq.jobs.tables import artefact as tables
from cmm_uq.jobs.tables.artefact import ArtefactFacts, CertifiedValue, ReferencedFacts, UncertifiedFacts
from cmm_uq.machine.model.kind import AT_20_C, BARS, FORMS, LENGTHS, SIX, Beginning, Kind, circumstances

_HERE = "cmm_uq.artefacts"
# figures that a laboratory may decide by its own rule
ERRORS = "error", "mean error", "standard deviation of errors"
SWEPT = (
    "repeatability", "span", "standard deviation", "span corrected", "standard deviation corrected", "pivot offset",
)  # fmt: skip


def _kind(
    name: str, table: type[ArtefactFacts], artefact: str, begin: Beginning | str, *tested: str, page: str = "", plan: str = "",
    **further: Any,
) -> Kind:  # fmt: skip
    """A kind whose parts are in the module of its artefact (``module:Class``), its page and its plan there or elsewhere."""
    module = artefact.partition(":")[0]
    return Kind(
        name, table, f"{_HERE}.{artefact}", f"{_HERE}.{module}:SCREENING", f"{_HERE}.{plan or f'{module}:PLANNING'}",
        f"{_HERE}.{page or module}:PAGE", begin, tested=tested, **further,
    )  # fmt: skip


def _also(*names: str) -> dict[str, str]:
    return {name: f"{_HERE}.beginnings:{name.upper()}" for name in names}


class BallbarFacts(ArtefactFacts):
    """Of a bar whose balls a laser digitizer scans: where that is mounted, and how round the balls are."""

    carries_probe: ClassVar[bool] = True

    offset_mm: Triple | None = None
    """[U1, V1, W1] of the digitizer that scanned the balls, by its drawing or an earlier calibration; sought anew where the
    two ends of the bars are seen in several attitudes."""
    ball_form_um: Uncertainty = 0.0
    """Largest less smallest diameter of the scanned balls, by their grade: 5.08 of grade 200."""


def _own_rule(figure: str, limit_um: float, measurements: int, repeats: int, points: int) -> dict[str, Any]:
    """What a new job wishes to be decided by the laboratory's own rule."""
    complete = {"measurements": measurements, "repeats": repeats, "points": points}
    return {"standard": "laboratory's own rule", "characteristic": figure, "limit_um": limit_um, "complete": complete}


BALLBAR = _kind("ballbar", BallbarFacts, "optical.ballbar:observe", Beginning(
    title="Ballbar in twenty positions (ASME B89.4.1)", measured="Ballbar: two balls on a bar",
    numbering="One measurement is one position of the bar; points 1 and 2 are the centres of its balls.",
    artefact={"name": "Ballbar", "length_mm": 400.0, "u_um": 0.5, "cte_per_k": 11.5e-6},
    conformity={"standard": "ASME B89.4.1-1997", "limit_um": 10.0, "rule": "ISO 14253-1"},
    test=circumstances(u_repeat_um=0.1), recorded=AT_20_C, plan={"repeats": 1},
    further={"ball": "Which ball of its bar, 1 or 2, a point that a laser digitizer scanned is of."},
), BARS, LENGTHS, page="ballbar")  # fmt: skip

BRYAN = _kind("bryan", ArtefactFacts, "bryan:Bryan", Beginning(
    title="Bryan gauge, a bar swept about a fixed ball",
    numbering="One measurement is one position of the swept ball, which is point 1; the fixed ball is not recorded.",
    artefact={"name": "Swept bar", "length_mm": 250.0, "u_um": 0.5}, plan={"repeats": 1},
    conformity=_own_rule("span", 10.0, 25, 1, 1), test=circumstances(u_repeat_um=0.1), recorded=AT_20_C,
), "error", *SWEPT)  # fmt: skip

# of what nothing but the lengths of the artefact is in doubt
_OF_LENGTHS = circumstances(u_cte_per_k=1e-6, u_temperature_k=0.1, u_alignment_um=0.1, u_fixturing_um=0.1)


def _gauge(name: str, class_: str, effects: tuple[str, ...], further: tuple[str, ...], **others: Any) -> Kind:
    begin = Beginning(
        effects=(*SIX, *effects), recorded=AT_20_C, columns={"reference_mm": ""}, further=dict.fromkeys(further, ""),
        conformity={"standard": "ISO 10360-2:2009", "mpe": "4 + L/100", "rule": "ISO 14253-1"}, test=_OF_LENGTHS,
        plan={"lengths_mm": [20.0, *(100.0 * i for i in range(1, 10))], "repeats": 3}, **others,
    )  # fmt: skip
    artefact, plan = f"gauge_lines:{class_}", f"gauge_lines:{name.upper()}"
    also = _also("arm_lengths") if name == "step_gauge" else {}
    return _kind(
        name, ReferencedFacts, artefact, begin, LENGTHS, *ERRORS, page="gauge_lines_page", plan=plan, begin_also=also
    )


NORMALS = ("nx", "ny", "nz")
STEP_GAUGE = _gauge(
    "step_gauge", "StepGauge", ("hysteresis_x", "hysteresis_y", "hysteresis_z"), APPROACHES,
    title="Step gauge on seven lines (ISO 10360-2)",
    measured="Step gauge or ball beam: points on a line", artefact={"name": "Step gauge", "u_um": 0.4, "cte_per_k": 11.5e-6},
    numbering="One measurement is one line; its points are the faces, numbered as they are met, again where met again.",
)  # fmt: skip
GAUGE_BLOCKS = _gauge(
    "gauge_blocks", "GaugeBlocks", ("probe_radius",), (*APPROACHES, *NORMALS),
    title="Gauge blocks on seven lines (ISO 10360-2)",
    measured="Gauge blocks, or any lengths on lines", artefact={"name": "Gauge blocks", "u_um": 0.15, "cte_per_k": 11.5e-6},
    numbering="One measurement is one block in one place; points 1 and 2 are its outer faces.",
)  # fmt: skip


class PlateFacts(ReferencedFacts):
    """Two recordings of a plate at two dates can be compared."""

    with_earlier: ClassVar[bool] = True


PLATE = _kind("plate", PlateFacts, "plate:Plate", Beginning(
    title="Ball plate in three attitudes, two places each", measured="Ball plate, hole plate, or balls in a body",
    numbering="One measurement is one place of the plate; its points are the balls or holes.",
    artefact={"name": "Ball plate", "u_um": 0.5, "cte_per_k": 11.5e-6}, plan={"pitch_mm": 80.0, "repeats": 1},
    columns=dict.fromkeys((f"reference_{a}_mm" for a in AXES), ""),
), LENGTHS)  # fmt: skip


class TriangleFacts(ArtefactFacts):
    """``blocks_mm`` (1–2, 2–3, 3–1) and the diameters ``cylinders_mm`` (1, 2, 3), with the standard uncertainty of each."""

    certified_values: ClassVar[tuple[CertifiedValue, ...]] = (
        CertifiedValue("blocks_mm", "u_blocks_um", tables.LENGTH_WORDS, count=3),
        CertifiedValue("cylinders_mm", "u_cylinders_um", tables.DIAMETER_WORDS, count=3),
    )

    blocks_mm: Triple = required("Lengths of the gauge blocks 1–2, 2–3 and 3–1.")
    u_blocks_um: Uncertainty = key(0.0, "Standard uncertainty of each block.")
    cylinders_mm: Triple = required("Diameters of the cylinders 1, 2 and 3.")
    u_cylinders_um: Uncertainty = key(0.0, "Standard uncertainty of each diameter.")

    @property
    def traced(self) -> bool:
        return True


TRIANGLE = _kind("triangle", TriangleFacts, "triangle:Triangle", Beginning(
    title="Triangle of gauge blocks and cylinders in seven placings",
    numbering="One measurement is one placing; points 1, 2 and 3 are the centres of the cylinders.",
    artefact={"name": "Triangle of gauge blocks and cylinders", "cte_per_k": 11.5e-6,
              "blocks_mm": [380.0, 280.0, 340.0], "u_blocks_um": 0.1, "cylinders_mm": [20.0] * 3, "u_cylinders_um": 0.1},
    plan={"repeats": 3}, further=dict.fromkeys((f"tip_{a}_mm" for a in AXES), ""), noise_um=0.3,
    conformity=_own_rule("mean error", 2.0, 7, 3, 3), recorded=AT_20_C, test=_OF_LENGTHS,
), *ERRORS, "angle error", "repeatability", page="triangle_page")  # fmt: skip


class SphereFacts(ArtefactFacts):
    """``length_mm`` is the diameter, ``form_um`` the form deviation by the sphere's certificate."""

    form_key: ClassVar[str | None] = "form_um"
    certified_values: ClassVar[tuple[CertifiedValue, ...]] = (
        tables.DIAMETER,
        CertifiedValue("form_um", "", tables.FORM_WORDS, needed=False, line="form"),
    )

    form_um: Uncertainty | None = key(None, "Form deviation of the sphere by its certificate.")


SPHERE = _kind("sphere", SphereFacts, "spheres.sphere:SphereArtefact", Beginning(
    title="Test sphere, twenty-five points (ISO 10360-5)", measured="Test sphere: points all over a ball",
    numbering="One measurement is one place of the sphere; its points are the points probed.",
    artefact={"name": "Test sphere", "length_mm": 25.0, "u_um": 0.1, "form_um": 0.1},
    effects=("probe_radius", "probe_lobing"), test=circumstances(u_form_um=0.02), recorded=AT_20_C, plan={"repeats": 1},
    conformity={"standard": "ISO 10360-5:2010", "limit_um": 4.0, "rule": "ISO 14253-1"},
    further=dict.fromkeys((*NORMALS, *APPROACHES), ""), noise_um=0.3,
), FORMS, "L_Dia", begin_also=_also("arm_sphere", "arm_orientations"))  # fmt: skip


class PlaneFacts(ArtefactFacts):
    """``probe_offset_mm`` is the effective radius by which the plane of the probe's centres is moved to the surface.

    ``acceptance_deg`` is the largest angle between the normal and the direction of approach at which that is believed.
    """

    form_key: ClassVar[str | None] = "form_um"
    certified_values: ClassVar[tuple[CertifiedValue, ...]] = ()

    probe_offset_mm: Length | None = None
    """Effective radius of the probe, by which the plane of its centres is moved to the surface."""
    u_probe_offset_um: Uncertainty = key(0.0, "Standard uncertainty of the probe's effective radius.")
    acceptance_deg: Annotated[float, Field(ge=0.01, le=89.99)] = 60.0
    """Largest angle between the normal and the direction of approach at which the radius is believed."""
    form_um: Uncertainty | None = key(None, "Flatness deviation of the surface by its certificate.")


PLANE = _kind("plane", PlaneFacts, "plane:PlaneSurface", Beginning(
    title="Surface plate, a grid of points",
    numbering="One measurement is one place of the surface; point 0, where there is one, lies just before contact.",
    artefact={"name": "Surface plate", "form_um": 1.0}, effects=("straightness_x_z", "straightness_y_z"),
    conformity=_own_rule("flatness", 10.0, 1, 2, 49), test=circumstances(u_form_um=0.1), recorded=AT_20_C,
    plan={"grid": [7, 7], "repeats": 2},
), "flatness")  # fmt: skip


class ReferenceSphereFacts(ArtefactFacts):
    """``length_mm`` is the diameter of the reference sphere, for a recording of scans.

    ``offset_mm`` [U1 V1 W1] by the drawing, to hold the result against and to plan by; ``u_attitude_arcsec`` standard
    uncertainty of the attitude in one measurement, about each axis of the machine; ``u_centre_um`` standard
    uncertainties, along x, y, z of the machine, of what shifts the sphere's centre as found in one measurement as a
    whole, however many points it has: the ball's form, the digitizer, the scales.
    """

    carries_probe: ClassVar[bool] = True
    certified_values: ClassVar[tuple[CertifiedValue, ...]] = (tables.DIAMETER,)

    offset_mm: Triple | None = None
    """[U1, V1, W1] by the drawing, to hold the result against and to plan by; it is not taken as known."""
    u_attitude_arcsec: Annotated[float, Field(ge=0, le=36_000)] = 0.0
    """Standard uncertainty of the attitude in one measurement, about each axis of the machine."""
    u_centre_um: Annotated[list[Uncertainty], Field(min_length=3, max_length=3)] = Field(
        default_factory=lambda: [0.0] * 3
    )
    """Standard uncertainties along x, y, z of what shifts the sphere's centre as a whole in one measurement: form,
    digitizer, scales."""


DIGITIZER = _kind("digitizer", ReferenceSphereFacts, "digitizer:DigitizerArtefact", Beginning(
    title="Laser digitizer aligned on a reference sphere in three attitudes",
    numbering="One measurement is one attitude; its points are scanned points of the sphere, or its centre as point 1.",
    artefact={"name": "Laser digitizer", "length_mm": 25.4, "u_um": 0.3, "offset_mm": [1.0, 200.0, 130.0],
              "u_attitude_arcsec": 2.0, "u_centre_um": [1.0, 1.0, 1.0]},
    effects=(), plan={"repeats": 2}, noise_um=5.0,
    conformity=_own_rule("closure", 20.0, 3, 2, 37), test=circumstances(u_repeat_um=0.5), recorded=AT_20_C,
    columns={
        "alpha_deg": "First Euler angle (3-1-3) of the digitizer.", "beta_deg": "Second Euler angle of the digitizer.",
        "gamma_deg": "Third Euler angle of the digitizer.",
    },
    further={
        "u_mm": "u of a scanned point in the digitizer's scan plane; left out where centres are recorded.",
        "v_mm": "v of a scanned point in the digitizer's scan plane, likewise.",
    },
), "closure", page="digitizer_page")  # fmt: skip


class MultilaterationFacts(InterferometerFacts):
    """The tracking interferometer."""

    dead_path_drifts: bool = key(False, "Whether the dead path of each station may drift, in proportion to `time_s`.")


MULTILATERATION = _kind("multilateration", MultilaterationFacts, "multilateration.artefact:Multilateration", Beginning(
    title="Distances from four stations of a tracking interferometer",
    numbering="One measurement is one station with one reflector; its points are the targets, numbered by place.",
    artefact={"name": "Tracking interferometer", "u_scale_um_per_m": 0.2, "optics_mm": [0.0, 0.0, -120.0]},
    plan={"grid": [4, 4], "repeats": 1}, further={f"tip_{a}_mm": "" for a in AXES}, noise_um=0.3,
    columns={"reading_mm": "Distance by the interferometer from a zero that is the same for the whole measurement."},
), page="multilateration.page")  # fmt: skip


class KnownLength(JobTable):
    """A known length between two points of a shifted artefact."""

    from_point: Annotated[Number, Field(alias="from")] = required("Point from which the known length goes.")
    to_point: Annotated[Number, Field(alias="to")] = required("Point to which it goes.")
    length_mm: Length = required("The known length.")
    u_um: Uncertainty = required("Standard uncertainty (k = 1) of the known length.")


UNSTATED_SHIFT_UM = 1000.0


class ShiftFacts(ArtefactFacts):
    """A shifted artefact lies along an ``axis`` or, a plate, in a ``plane``."""

    certified_values: ClassVar[tuple[CertifiedValue, ...]] = (
        CertifiedValue("known.length_mm", "known.u_um", tables.LENGTH_WORDS),
    )

    axis: Literal["x", "y", "z"] | None = key(None, "Axis along which the artefact is shifted.")
    plane: Literal["xy", "yz", "zx"] | None = None
    """Plane in which a plate is shifted and turned, in place of `axis` and `shifts_mm`."""
    shifts_mm: Annotated[list[Position], Field(max_length=LISTED.most)] = Field(default_factory=list)
    """Nominal shift of each series along the axis."""
    u_shift_um: Uncertainty | None = None
    """Standard uncertainty of the shifts, which are estimated; 0 where they are known exactly and give the scale. Left out,
    they are taken as 1 mm off."""
    known: KnownLength | None = None
    """A known length between two points of the artefact, for the mean scale of the axis."""
    integrated_points: Annotated[list[Numbers], Field(max_length=20)] = Field(default_factory=list)
    """Of two series along an axis: numbers of points from which alone the integrations of the method's source are made too,
    a list each, to be compared with the joint fit of all readings."""

    def problems(self) -> Iterator[str]:
        yield from super().problems()
        if self.integrated_points and (self.plane is not None or len(self.shifts_mm) != 2):
            yield "integrated_points are of two series along an axis: give axis and two shifts_mm, or leave them out"
        if self.plane is not None and (self.axis is not None or self.shifts_mm or self.u_shift_um):
            yield (
                "plane belongs to a plate that is shifted and turned: its placings are found from the readings; leave out "
                "axis, shifts_mm and u_shift_um, or leave out plane"
            )

    @property
    def traced(self) -> bool:
        return self.known is not None

    @property
    def sd_shift_um(self) -> float:
        """Standard uncertainty of the shifts, large where nobody states it: nominal shifts give no scale."""
        return UNSTATED_SHIFT_UM if self.u_shift_um is None else self.u_shift_um


SHIFT = Kind(
    "shift", ShiftFacts, f"{_HERE}.shift.artefact:ShiftedArtefact", plan=f"{_HERE}.shift.artefact:PLANNING",
    begin=Beginning(
        title="Self-calibration of an axis by shifting an uncalibrated gauge",
        numbering="One measurement is one series, at one shift; its points are those of the gauge.",
        artefact={
            "name": "Step gauge, uncalibrated but for its length", "axis": "x", "shifts_mm": [0.0, 20.0, 50.0],
            "u_shift_um": 100.0, "known": {"from": 1, "to": 21, "length_mm": 400.0, "u_um": 0.5},
        },
        effects=(), plan={"repeats": 3}, recorded=AT_20_C,
        conformity=_own_rule("linearity", 10.0, 3, 3, 21), test=circumstances(),
    ),
    begin_also=_also("shift_plate"),
    check=f"{_HERE}.shift.artefact:refuse_unfit", own=f"{_HERE}.shift.artefact:OWN",
    refusal="a shift job cannot be {}: its machine error is a free function, no list of effects",
    instead="cmm-uq report JOB estimates it", tested=("linearity", "straightness", "squareness"),
)  # fmt: skip


class ErrorMapFacts(ArtefactFacts):
    """The maps are named under ``[machine]``."""

    with_recording: ClassVar[bool] = False
    certified_values: ClassVar[tuple[CertifiedValue, ...]] = ()


ERROR_MAP = Kind(
    "error_map", ErrorMapFacts,
    begin=f"{_HERE}.beginnings:BEGINNING",
    check=f"{_HERE}.error_maps.diagnosis:refuse_unfit", own=f"{_HERE}.error_maps.page:OWN",
    refusal="error maps cannot be {}: they are free functions, no points of an artefact",
    instead="cmm-uq diagnose JOB compares them with each other",
)  # fmt: skip


_SCANNED = f"{_HERE}.optical.planes"
SCANNED_PLANES = Kind(
    "scanned_planes", UncertifiedFacts, f"{_SCANNED}:ScannedPlanes", page=f"{_SCANNED}:PAGE", begin=f"{_SCANNED}:BEGIN"
)


class TrackedFacts(ReferencedFacts):
    """The reference instrument."""

    frame: Literal["own", "base"] = "own"
    """Whether its places are in a frame of its own, or of the base of the robot, as pose accuracy (ISO 9283) needs."""


_TRACKED = f"{_HERE}.optical.tracked"
TRACKED_POINTS = Kind(
    "tracked_points", TrackedFacts, f"{_TRACKED}:TrackedPoints", f"{_TRACKED}:SCREENING",
    f"{_HERE}.optical.poses:PLANNING", f"{_TRACKED}:PAGE", f"{_TRACKED}:BEGIN",
    begin_also=_also("robot_poses"), tested=("AP", "RP", *(f"{of}_{angle}" for of in ("AP", "RP") for angle in "abc")),
)  # fmt: skip


class TableSpheresFacts(UncertifiedFacts):
    """Where the spheres are planned to stand on the table."""

    stay: bool = key(
        False, "Whether the spheres stayed where they are through all measurements, each being a run of axes."
    )
    radius_mm: Length = key(200.0, "Distance of both spheres from the table's axis, for a plan.")
    height_mm: Length = key(200.0, "By how much sphere B lies higher than sphere A along the axis, for a plan.")
    low_mm: Position = key(0.0, "Height of sphere A above the stated point of the table's axis, for a plan.")


_SEAT = f"{_HERE}.spheres.seat"
SEAT = Kind(
    "seat", UncertifiedFacts, f"{_SEAT}:Seat", f"{_SEAT}:SCREENING", page=f"{_SEAT}:PAGE", begin=f"{_HERE}.beginnings:SEATS",
    instead="Choose seats near the base, in the middle of the reach and far out; bend the arm otherwise for each reading",
    tested=("SPAT", "SPAT maximum"),
)  # fmt: skip

_TABLE = f"{_HERE}.spheres.table_spheres"
_AXIS = tuple(f"rotary_{name}" for name in ("location_c_x", "location_c_y", "tilt_c_x", "tilt_c_y", "positioning_c_1"))
TABLE_SPHERES = Kind(
    "table_spheres", TableSpheresFacts, f"{_TABLE}:TableSpheres", f"{_TABLE}:SCREENING", f"{_TABLE}:PLANNING",
    f"{_TABLE}_page:PAGE", Beginning(
        title="Two spheres on a turning table (ISO 10360-3)",
        numbering="One measurement is one load of the table; points 1 and 2 are the centres of spheres A and B, repeat counts "
        "the positions of the table in their order.",
        artefact={"name": "Spheres A and B", "radius_mm": 200.0, "height_mm": 200.0}, effects=_AXIS, noise_um=0.3,
        machine={"chain": "XYZ|C", "origin_mm": [350.0, 500.0, -500.0], "table": {"travel_deg": [0.0, 720.0]}},
        conformity={"standard": "ISO 10360-3:2000", "characteristic": "FR", "limit_um": 5.0, "rule": "ISO 14253-1"},
        test=circumstances(u_repeat_um=0.1), columns={"c_deg": ""}, further={"c_approach": ""}, plan={"repeats": 1},
        recorded=AT_20_C,
    ), begin_also={"five_axes": f"{_TABLE}:FIVE_AXES"}, tested=("FR", "FT", "FA"),
)  # fmt: skip
BUILT_IN = {kind.name: kind for kind in (
    BALLBAR, BRYAN, STEP_GAUGE, GAUGE_BLOCKS, PLATE, TRIANGLE, SPHERE, PLANE, SHIFT, ERROR_MAP, DIGITIZER, AXIS_RUNS,
    MULTILATERATION, SCANNED_PLANES, TRACKED_POINTS, TABLE_SPHERES, SEAT, RING,
)}  # fmt: skip
