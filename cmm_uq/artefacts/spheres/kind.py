"""The ring: what a job says of it, what a new job of it begins with, and where its parts are."""

from __future__ import annotations

from typing import ClassVar

from cmm_uq.base.files.table import Uncertainty, key
from cmm_uq.base.points import AXES
from cmm_uq.jobs.tables import artefact as tables
from cmm_uq.jobs.tables.artefact import ArtefactFacts, CertifiedValue
from cmm_uq.machine.model.kind import AT_20_C, Beginning, Kind, circumstances

_RING = "cmm_uq.artefacts.spheres.ring"


class RingFacts(ArtefactFacts):
    """``length_mm`` is the diameter, ``form_um`` the roundness deviation by the ring's certificate."""

    form_key: ClassVar[str | None] = "form_um"
    certified_values: ClassVar[tuple[CertifiedValue, ...]] = (
        tables.DIAMETER,
        CertifiedValue("form_um", "", tables.FORM_WORDS, needed=False, line="form"),
    )

    form_um: Uncertainty | None = key(None, "Roundness deviation of the ring by its certificate.")
    plug: bool = key(False, "Whether it is probed from outside, as a plug gauge or a master disc.")
    one_direction: bool = False
    """Whether the certified diameter is one of two opposite points, and not the mean over a turn: what the form deviation
    makes of that is then in its uncertainty."""


RING = Kind(
    "ring", RingFacts, f"{_RING}:RingGauge", f"{_RING}:SCREENING", f"{_RING}:PLANNING", f"{_RING}:PAGE", Beginning(
        title="Setting ring, twenty-five points around",
        measured="Ring or plug gauge: points around a cylinder",
        numbering="One measurement is one place of the ring; its points are the points probed, at one height or several.",
        artefact={"name": "Setting ring", "length_mm": 50.0, "u_um": 0.2, "form_um": 0.2, "cte_per_k": 11.5e-6},
        effects=("probe_radius", "probe_lobing", "squareness_xy"), test=circumstances(u_form_um=0.05, u_temperature_k=0.1),
        recorded=AT_20_C, plan={"repeats": 3}, noise_um=0.3,
        conformity={"standard": "laboratory's own rule", "characteristic": "roundness", "limit_um": 4.0,
                    "complete": {"measurements": 1, "repeats": 3, "points": 25}},
        further=dict.fromkeys(("nx", "ny", "nz", *(f"approach_{axis}" for axis in AXES), "turned_deg"), ""),
    ), tested=("error", "mean error", "standard deviation of errors", "roundness"),
)  # fmt: skip
