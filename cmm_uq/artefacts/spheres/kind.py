"""What a job says of spheres on a turning table, and what a new one begins with."""

from __future__ import annotations

from typing import ClassVar

from cmm_uq.base.files.table import Length, Position, key
from cmm_uq.jobs.tables.artefact import ArtefactFacts, CertifiedValue
from cmm_uq.machine.model.kind import AT_20_C, Beginning, Kind, circumstances


class TableSpheresFacts(ArtefactFacts):
    """Nothing of the spheres is certified; where they are planned to stand on the table."""

    certified_values: ClassVar[tuple[CertifiedValue, ...]] = ()

    radius_mm: Length = key(200.0, "Distance of both spheres from the table's axis, for a plan.")
    height_mm: Length = key(200.0, "By how much sphere B lies higher than sphere A along the axis, for a plan.")
    low_mm: Position = key(0.0, "Height of sphere A above the stated point of the table's axis, for a plan.")

    @property
    def traced(self) -> bool:
        return False


_HERE = "cmm_uq.artefacts.spheres.table_spheres"
_AXIS = tuple(f"rotary_{name}" for name in ("location_c_x", "location_c_y", "tilt_c_x", "tilt_c_y", "positioning_c_1"))
TABLE_SPHERES = Kind(
    "table_spheres",
    TableSpheresFacts,
    f"{_HERE}:TableSpheres",
    f"{_HERE}:SCREENING",
    f"{_HERE}:PLANNING",
    f"{_HERE}:PAGE",
    begin=Beginning(
        title="Two spheres on a turning table (ISO 10360-3)",
        numbering="One measurement is one load of the table; points 1 and 2 are the centres of spheres A and B, repeat counts "
        "the positions of the table in their order.",
        artefact={"name": "Spheres A and B", "radius_mm": 200.0, "height_mm": 200.0},
        effects=_AXIS,
        machine={"chain": "XYZ|C", "origin_mm": [350.0, 500.0, -500.0], "table": {"travel_deg": [0.0, 720.0]}},
        conformity={"standard": "ISO 10360-3:2000", "characteristic": "FR", "limit_um": 5.0, "rule": "ISO 14253-1"},
        test=circumstances(u_repeat_um=0.1),
        columns={"c_deg": ""},
        further={"c_approach": ""},
        noise_um=0.3,
        plan={"repeats": 1},
        recorded=AT_20_C,
    ),
    tested=("FR", "FT", "FA"),
)
