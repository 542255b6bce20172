"""The kind of runs along axes: what a job says of the instrument, and what a new job begins with."""

from __future__ import annotations

from collections.abc import Iterator
from itertools import pairwise
from typing import Annotated, ClassVar

from pydantic import Field

from cmm_uq.base.files.limits import LISTED
from cmm_uq.base.files.table import JobTable, Length, Position, Triple, Uncertainty, key
from cmm_uq.base.points import AXES
from cmm_uq.jobs.tables.artefact import ArtefactFacts, CertifiedValue
from cmm_uq.machine.model.kind import AT_20_C, POSITIONING, SIX, Beginning, Kind, circumstances

APPROACHES, READ, TURN = (tuple(f"{name}_{a}" for a in AXES) for name in ("approach", "read", "turn"))


class InterferometerFacts(ArtefactFacts):
    """What reads displacements of optics on the ram."""

    certified_values: ClassVar[tuple[CertifiedValue, ...]] = ()

    u_scale_um_per_m: Uncertainty | None = None
    """Standard uncertainty of a displacement along the beam, per metre: wavelength, alignment, stability; without it the
    instrument's scale stays free."""
    optics_mm: Triple = Field(default_factory=lambda: [0.0, 0.0, 0.0])
    """Offset of the moving optics from the end of the ram, along x, y, z, by which rotations reach it; columns tip_x_mm,
    tip_y_mm, tip_z_mm of the recording go before it."""
    air_corrected: bool = True
    """Whether displacements are corrected for the refractive index of air already; else they are, from 20 °C, 1013.25 hPa and
    50 % to `temp_air_c`, `pressure_hpa`, `humidity_pct`."""

    @property
    def traced(self) -> bool:
        return self.u_scale_um_per_m is not None


Targets = Annotated[list[Position], Field(min_length=2, max_length=LISTED.most)]


class OnTheFly(JobTable):
    """``[artefact.on_the_fly]``: readings taken in motion, and where along each axis figures are evaluated of them."""

    x: Targets = Field(default_factory=list)
    """Targets along X, mm by its scale: each is interpolated linearly between the two nearest readings of every run."""
    y: Targets = Field(default_factory=list, description="The same along Y.")
    z: Targets = Field(default_factory=list, description="The same along Z.")
    u_delay_um: Uncertainty | None = None
    """Standard uncertainty of what a delay between the scales and the instrument makes of a displacement at the speed of the
    runs; 0 where one trigger reads both. Without it nothing is decided."""

    def problems(self) -> Iterator[str]:
        for axis in AXES:
            targets = getattr(self, axis)
            if any(after <= before for before, after in pairwise(targets)):
                yield f"{axis}: targets must grow"
        if not (self.x or self.y or self.z):
            yield "x, y or z must have targets"


class AxisRunsFacts(InterferometerFacts):
    """What reads along the runs: a laser interferometer, straightness or angular optics, a level, a straightedge."""

    u_straightness_um: Uncertainty | None = None
    """Standard uncertainty of what a straightness is read against, as a bow over the run: straightness optics, straightedge
    that was not reversed."""
    u_rotation_arcsec: Uncertainty | None = None
    """Standard uncertainty of a rotation at the end of a run against its beginning: angular optics, level, autocollimator."""
    u_polygon_arcsec: Uncertainty | None = None
    """Standard uncertainty of the certified angle of each face of a polygon, or of an index table, that a rotary table is read
    against; without it the faces are found by closure, from several settings of the polygon on the table."""
    u_bar_um: Uncertainty | None = None
    """Standard uncertainty of the calibrated length of a telescoping ballbar that reads along circles; without it their
    radius stays free."""
    square_arcsec: float = key(0.0, "Angle of a square less 90°, by its certificate; see the column square.")
    u_square_arcsec: Uncertainty | None = key(None, "Standard uncertainty of the angle of a square.")
    arm_mm: Length = key(100.0, "Arm over which a rotation is read: distance of two retroreflectors, base of a level.")
    zero_each_repeat: bool = key(False, "Whether the instrument was set to zero before each repeat, and not once.")
    dead_path_mm: Uncertainty = key(0.0, "Path in air between interferometer and zero, where air is not corrected for.")
    on_the_fly: OnTheFly | None = key(None, "Readings taken in motion, evaluated at targets of these.")


_HYSTERESES = tuple(f"hysteresis_{a}" for a in AXES)
CIRCLES = Beginning(
    title="Circles in three planes by telescoping ballbar (ISO 230-4)",
    numbering="One measurement is one circle; its points go round it, and back.",
    artefact={"name": "Telescoping ballbar", "u_bar_um": 0.5, "cte_per_k": 11.5e-6},
    effects=(*SIX, *_HYSTERESES), plan={"ready": "circles", "repeats": 1, "length_mm": 300.0}, recorded=AT_20_C,
    conformity={"standard": "ISO 230-4:1996", "characteristic": "G", "limit_um": 15.0, "rule": "ISO 14253-1"},
    test=circumstances(u_alignment_um=0.1, u_temperature_k=0.1, u_repeat_um=0.2), noise_um=0.3,
)  # fmt: skip
_BY_LABORATORY = {"by": "the laboratory", "reason": "the polygon stands on the axis, level to 10 arcsec"}
POLYGON = Beginning(
    title="A rotary table against a polygon, by autocollimator (ISO 230-2)",
    numbering="One measurement is one setting of the polygon on the table; its points are the faces there, and back.",
    artefact={"name": "Polygon of 12 faces", "u_polygon_arcsec": 0.1},
    effects=("rotary_positioning_c_1", "rotary_positioning_c_2", "rotary_play_c"),
    machine={"chain": "XYZ|C", "origin_mm": [350.0, 500.0, -500.0], "table": {"travel_deg": [0.0, 360.0]}},
    plan={"ready": "polygon", "repeats": 5}, recorded=AT_20_C, noise_um=0.02,
    columns={
        "reading_arcsec": "By how much the face is turned beyond its nominal place, by the right hand.",
        **{f"turn_{a}": f"Axis of the table, its part along {a}." for a in AXES}, "c_deg": "", "c_approach": "",
        "face": "Number of the face that is read.", "face_arcsec": "Certified deviation of its angle.",
    },
    conformity={"standard": "ISO 230-2:2014", "characteristic": "A", "limit_arcsec": 15.0, "rule": "ISO 14253-1"},
    test=circumstances(u_repeat_arcsec=0.05, negligible={"alignment": _BY_LABORATORY}),
)  # fmt: skip
_RUNS = "cmm_uq.artefacts.axis_runs"
AXIS_RUNS = Kind(
    "axis_runs", AxisRunsFacts, f"{_RUNS}.artefact:AxisRuns", f"{_RUNS}.plan:SCREENING", f"{_RUNS}.plan:PLANNING",
    f"{_RUNS}.page:PAGE",
    Beginning(
        title="Runs along three axes by laser interferometer and angular optics (ISO 230-2)",
        numbering="One measurement is one quantity along one line; its points are the targets, again on the way back.",
        artefact={"name": "Laser interferometer", "u_scale_um_per_m": 0.3}, effects=(*SIX[:3], *_HYSTERESES),
        plan={"repeats": 5}, recorded=AT_20_C, noise_um=0.3,
        columns={
            "reading_um": "Displacement by the instrument less that of the target; 0 where a rotation is read.",
            "reading_arcsec": "Rotation by the instrument, by the right hand; 0 where a displacement is read.",
            **{f"read_{a}": f"Direction along which a displacement is read, its part along {a}." for a in AXES},
            **{f"turn_{a}": f"Axis about which a rotation is read, its part along {a}." for a in AXES},
        },
        conformity={"standard": "ISO 230-2:2014", "limit_um": 10.0, "rule": "ISO 14253-1"},
        test=circumstances(
            u_alignment_um=0.2, u_repeat_um=0.1,
            negligible={"temperature": {"by": "the laboratory", "reason": "light does not expand"}},
        ),
        further={
            **dict.fromkeys((*APPROACHES, *(f"tip_{a}_mm" for a in AXES)), ""),
            "straightedge": "+1 against a straightedge as it lies first, −1 against it turned over, 0 without one.",
            "face": "Number of the polygon's face that is read, where a rotary table turns.",
            "face_arcsec": "Certified deviation of that face's angle, by the right hand as it stands on the table.",
            "square": "Number of the setting of a square, the same along both of its legs; 0 without one.",
        },
    ),
    begin_also={"circular_test": f"{_RUNS}.kind:CIRCLES", "polygon": f"{_RUNS}.kind:POLYGON"}, tested=(POSITIONING,),
)  # fmt: skip
