"""The typed contents of a job: what job.toml may say, key by key, and the recording it names."""

from __future__ import annotations

import datetime as dt
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any, Literal, Self

from pydantic import Field, ValidationInfo, field_validator, model_validator

from cmm_uq.errors import suggestion
from cmm_uq.files.limits import CONFORMITY, EFFECTS, LISTED, MAPS
from cmm_uq.jobs.file_names import device_name
from cmm_uq.jobs.origin import MEASURED, DerivedFrom, Origin
from cmm_uq.jobs.plan import PlanFacts
from cmm_uq.jobs.table import (
    AnyFloat,
    Length,
    Limit,
    Names,
    Number,
    Numbers,
    Position,
    Range,
    Table,
    Temperature,
    Triple,
    Uncertainty,
    at_least,
)
from cmm_uq.points import Points

ArtefactKind = Literal[
    "ballbar", "bryan", "step_gauge", "gauge_blocks", "plate", "triangle", "sphere", "plane", "shift", "error_map"
]
SHIFT, ERROR_MAP = "shift", "error_map"
"""Kinds that are no points of an artefact in the volume: readings along one axis, and the machine's error maps."""

WITH_REFERENCES = ("step_gauge", "gauge_blocks", "plate")
"""Kinds whose certified figures stand in the recording; their ``u_um`` may stand without ``length_mm``."""

Standard = Literal["ASME B89.4.1-1997", "ISO 10360-2:2009", "ISO 10360-5:2010", "VDI/VDE 2617"]

CHARACTERISTICS: Mapping[Standard, str] = {
    "ASME B89.4.1-1997": "volumetric performance", "ISO 10360-2:2009": "E0", "ISO 10360-5:2010": "P_FTU",
    "VDI/VDE 2617": "E0",
}  # fmt: skip
"""The characteristic that is decided of each standard, of all that it has."""

LENGTH_STANDARDS: tuple[Standard, ...] = ("ISO 10360-2:2009", "VDI/VDE 2617")
"""Standards that compare with calibrated lengths."""

SHORTEST_TRAVEL_MM = 1e-3
"""Positions are divided by the travel."""

Angle = Annotated[float, Field(ge=-36_000, le=36_000)]
"""A squareness error, ″: ten degrees."""

Tolerance = Annotated[float, Field(gt=0, le=1e9), at_least(1e-9)]
"""A permissible size of an effect in its own unit."""


class JobFacts(Table):
    """``[job]``: identification, and free text for the certificate.

    ``origin`` and ``derived_from`` are written by the commands that make a recording out of another.
    """

    id: Annotated[str, Field(pattern=r"^[A-Za-z0-9._-]+$", max_length=100)]
    date: dt.date
    number: str = ""
    issued: dt.date | None = None
    customer: str = ""
    address: str = ""
    place: str = ""
    operator: str = ""
    procedure: str = ""
    order: str = ""
    conditions: str = ""
    remarks: str = ""
    diagnosis_on_certificate: bool = False
    origin: Origin = MEASURED
    derived_from: DerivedFrom | None = None

    @model_validator(mode="after")
    def _derived(self) -> Self:
        if self.derived_from is not None and self.origin == MEASURED:
            raise ValueError(
                'derived_from says that the recording was made from another: origin must be "simulated" or "compensated"'
            )
        return self

    @model_validator(mode="after")
    def _names_a_folder(self) -> Self:
        if set(self.id) == {"."}:
            raise ValueError("must name a folder of its own, so it cannot consist of dots")
        if device_name(self.id):
            raise ValueError("must name a folder of its own, and Windows takes this name for a device")
        return self


class Laboratory(Table):
    """``[laboratory]``: who answers for the certificate."""

    name: str = ""
    address: str = ""
    accreditation: str = ""
    signatory: str = ""
    signatory_role: str = ""


class Travel(Table):
    """``travel_mm``: lowest and highest scale reading of each axis."""

    x: Range | None = None
    y: Range | None = None
    z: Range | None = None

    @model_validator(mode="after")
    def _ordered(self) -> Self:
        for axis in "xyz":
            given = getattr(self, axis)
            if given and not given[0] < given[1]:
                raise ValueError(f"{axis} = {given}: the first number must be the lower one")
            if given and given[1] - given[0] < SHORTEST_TRAVEL_MM:
                raise ValueError(f"{axis} = {given}: a travel of less than {SHORTEST_TRAVEL_MM:g} mm is none")
        return self


class ErrorMapFile(Table):
    """One error map and the temperature it was taken at."""

    file: str
    temperature_c: Temperature


class SquarenessFacts(Table):
    """``squareness_arcsec``: beside an error map."""

    xy: Angle = 0.0
    yz: Angle = 0.0
    zx: Angle = 0.0


class MachineFacts(Table):
    """``[machine]``."""

    name: str
    manufacturer: str = ""
    model: str = ""
    serial: str = ""
    owner: str = ""
    chain: Annotated[str, Field(pattern=r"^[XYZF]{3,4}$")] = "XYZ"
    travel_mm: Travel = Travel()
    origin_mm: Triple = [0.0, 0.0, 0.0]
    error_map: Annotated[list[ErrorMapFile], Field(max_length=MAPS.most)] = []
    squareness_arcsec: SquarenessFacts | None = None

    @model_validator(mode="after")
    def _three_carriages(self) -> Self:
        if sorted(self.chain.replace("F", "", 1)) != ["X", "Y", "Z"]:
            raise ValueError(
                f"chain = {self.chain!r}: give X, Y, Z once each, and F for the frame if the workpiece moves"
            )
        return self


class Traceability(Table):
    """The artefact's own certificate."""

    number: str = ""
    laboratory: str = ""
    date: dt.date | None = None
    due: dt.date | None = None


class KnownLength(Table):
    """A known length between two points of a shifted artefact."""

    from_point: Annotated[Number, Field(alias="from")]
    to_point: Annotated[Number, Field(alias="to")]
    length_mm: Length
    u_um: Uncertainty


class ArtefactFacts(Table):
    """``[artefact]``; without ``length_mm`` it is uncalibrated, unless its certified figures stand in the recording.

    ``nominal`` says that those figures are nominal only: their common scale then stays free. ``form_um`` is the form
    deviation of a test sphere by its certificate. ``blocks_mm`` (1–2, 2–3, 3–1) and the diameters ``cylinders_mm`` (1, 2, 3)
    make a triangle, with the standard uncertainty of each. ``probe_offset_mm`` is the effective radius by which a probed
    plane is moved to the surface. A shifted artefact lies along an ``axis`` or, a plate, in a ``plane``.
    """

    kind: ArtefactKind
    name: str = ""
    serial: str = ""
    length_mm: Length | None = None
    u_um: Uncertainty | None = None
    nominal: bool = False
    form_um: Uncertainty | None = None
    blocks_mm: Triple | None = None
    u_blocks_um: Uncertainty = 0.0
    cylinders_mm: Triple | None = None
    u_cylinders_um: Uncertainty = 0.0
    probe_offset_mm: Length | None = None
    u_probe_offset_um: Uncertainty = 0.0
    cte_per_k: AnyFloat = 0.0
    certificate: Traceability | None = None
    axis: Literal["x", "y", "z"] | None = None
    plane: Literal["xy", "yz", "zx"] | None = None
    shifts_mm: Annotated[list[Position], Field(max_length=LISTED.most)] = []
    u_shift_um: Uncertainty = 0.0
    known: KnownLength | None = None

    @model_validator(mode="after")
    def _uncertainty_of_something(self) -> Self:
        if self.u_um is not None and self.length_mm is None and self.kind not in WITH_REFERENCES:
            raise ValueError("u_um is given without length_mm: give both, or neither for an uncalibrated artefact")
        if self.nominal and (self.u_um is not None or self.length_mm is not None or self.kind not in WITH_REFERENCES):
            raise ValueError(
                "nominal = true says that the recording's references are not certified: leave out length_mm and u_um; "
                f"only {', '.join(WITH_REFERENCES)} have references"
            )
        given = self.blocks_mm is not None, self.cylinders_mm is not None
        if given != (self.kind == "triangle",) * 2:
            raise ValueError(
                "a triangle is made of blocks_mm = [1–2, 2–3, 3–1] and cylinders_mm = [1, 2, 3], and nothing else is: give "
                'both for kind = "triangle", neither for another kind'
            )
        if self.plane is not None and (
            self.kind != "shift" or self.axis is not None or self.shifts_mm or self.u_shift_um
        ):
            raise ValueError(
                "plane belongs to a plate that is shifted and turned: its placings are found from the readings; leave out "
                "axis, shifts_mm and u_shift_um, or leave out plane"
            )
        if self.probe_offset_mm is not None and self.kind != "plane":
            raise ValueError(f"probe_offset_mm moves a probed plane, not a {self.kind}: leave it out")
        if self.form_um is not None and self.kind != "sphere":
            raise ValueError(f"form_um is the form deviation of a test sphere, not of a {self.kind}: leave it out")
        if abs(self.cte_per_k) > 1e-3:
            raise ValueError(
                f"cte_per_k = {self.cte_per_k:g} is no expansion coefficient: steel has 11.5e-6 per kelvin"
            )
        return self


class RecordingFacts(Table):
    """``[recording]``. Measurements named in ``set_aside`` stay on the certificate but are not used for estimates.

    ``earlier`` names a recording of the same plate in the same placings at an earlier date: what is estimated then is what
    changed between.
    """

    file: str
    earlier: str | None = None
    earlier_date: dt.date | None = None
    u_coordinate_um: Limit | None = None
    set_aside: Numbers = []


class ModelFacts(Table):
    """``[model]``: the physics that the simulation is told about.

    ``tolerances``: largest permissible size of an effect's (first) parameter, by its name and in its unit.
    """

    effects: Names
    tolerances: Annotated[dict[str, Tolerance], Field(max_length=EFFECTS.most)] = {}

    @model_validator(mode="after")
    def _tolerances_of_effects(self) -> Self:
        for name in self.tolerances:
            if name not in self.effects:
                raise ValueError(
                    f"tolerances names {name!r}, which is not among the effects: {suggestion(name, self.effects)}"
                )
        return self


class MaximumPermissibleError(Table):
    """``mpe``: E = A + L/K, with L in mm and E in µm."""

    a_um: Uncertainty
    k: Annotated[float, Field(gt=0, le=1e12), at_least(1e-3)]


class GuardBand(Table):
    """A guard band of so many expanded uncertainties (ILAC-G8:09/2019, 4.2.2)."""

    guard_band: Annotated[float, Field(ge=0, le=100)]


class FalseAccept(Table):
    """Accept only when the probability of not conforming is at most this."""

    max_false_accept: Annotated[float, Field(gt=0, lt=1), at_least(1e-12)]


Rule = Literal["simple", "ISO 14253-1"] | GuardBand | FalseAccept


class ConformityFacts(Table):
    """One ``[[conformity]]``: a standard, a limit and a decision rule."""

    standard: Standard
    characteristic: str | None = None
    limit_um: Limit | None = None
    mpe: MaximumPermissibleError | None = None
    rule: Rule = "ISO 14253-1"

    @model_validator(mode="after")
    def _one_limit(self) -> Self:
        if (self.limit_um is None) == (self.mpe is None):
            raise ValueError("give either limit_um or mpe = { a_um = …, k = … }")
        return self

    @model_validator(mode="after")
    def _decided_here(self) -> Self:
        known = CHARACTERISTICS[self.standard]
        if self.characteristic not in (None, known):
            raise ValueError(
                f"characteristic = {self.characteristic!r} of {self.standard} is not decided here: only {known}"
            )
        return self

    def uncertainty_missing(self, artefact: ArtefactFacts) -> str | None:
        """The key of ``[artefact]`` whose uncertainty the rule needs and does not have; ``None`` when nothing is missing."""
        if self.rule == "simple":
            return None
        if self.standard == "ISO 10360-5:2010":
            return None if artefact.kind != "sphere" or artefact.form_um else "form_um"
        certified = artefact.length_mm is not None or (artefact.kind in WITH_REFERENCES and not artefact.nominal)
        return "u_um" if self.standard in LENGTH_STANDARDS and certified and not artefact.u_um else None


def needed(key: str, wish: ConformityFacts) -> tuple[str, str]:
    """That a rule needs an uncertainty which ``[artefact]`` does not state, and how to mend it."""
    rule = wish.rule if isinstance(wish.rule, str) else next(iter(wish.rule.model_dump()))
    return (
        f"the rule {rule} needs the uncertainty of what {wish.standard} compares with, and [artefact] states no {key} above 0",
        f'Give {key} in [artefact], or rule = "simple", which takes no account of it',
    )


class JobFile(Table):
    """All of job.toml. A job whose recording are the machine's error maps has no ``[recording]``."""

    job: JobFacts
    laboratory: Laboratory = Laboratory()
    machine: MachineFacts
    artefact: ArtefactFacts
    recording: RecordingFacts
    model: ModelFacts
    conformity: Annotated[list[ConformityFacts], Field(max_length=CONFORMITY.most)] = []
    plan: PlanFacts = PlanFacts()

    @field_validator("conformity")
    @classmethod
    def _rules_have_their_uncertainty(
        cls, wishes: list[ConformityFacts], info: ValidationInfo
    ) -> list[ConformityFacts]:  # fmt: skip
        artefact = info.data.get("artefact")
        for wish in wishes:
            key = wish.uncertainty_missing(artefact) if artefact is not None else None
            if key is not None:
                raise ValueError(". ".join(needed(key, wish)))
        return wishes

    @model_validator(mode="before")
    @classmethod
    def _maps_are_the_recording(cls, data: Any) -> Any:
        artefact = data.get("artefact") if isinstance(data, dict) else None
        if isinstance(artefact, dict) and artefact.get("kind") == ERROR_MAP:
            return {"recording": {"file": ""}, **data}
        return data


@dataclass(frozen=True, eq=False)
class Job:
    """A job as read: its facts, its recording, and the bytes of every file it was read from.

    Parameters
    ----------
    folder : where it lies.
    facts : job.toml.
    points : the recording.
    inputs : contents of each input by its path inside the folder, for hashes and attachments.
    altered : names of files that were changed after a command derived them.
    planned : whether the recording holds the nominal coordinates of a plan.
    """

    folder: Path
    facts: JobFile
    points: Points
    inputs: Mapping[str, bytes]
    altered: tuple[str, ...] = ()
    planned: bool = False

    @property
    def origin(self) -> Origin:
        """Of the recording."""
        return self.facts.job.origin

    @property
    def paths(self) -> tuple[Path, ...]:
        """Every file that it was read from."""
        return tuple(self.folder / name for name in self.inputs)

    @property
    def recording_path(self) -> str:
        """The recording, as messages name it."""
        return str(self.folder / self.facts.recording.file)
