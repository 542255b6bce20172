"""The typed contents of a job: what job.toml may say, key by key, and the recording it names."""

from __future__ import annotations

import datetime as dt
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import cache
from html import escape
from pathlib import Path
from typing import Annotated, Any, ClassVar, Literal, Self

from pydantic import Field, ValidationInfo, create_model, field_validator, model_validator

from cmm_uq.errors import suggestion
from cmm_uq.files.limits import CONFORMITY, EFFECTS
from cmm_uq.jobs.file_names import device_name
from cmm_uq.jobs.machine import MachineFacts
from cmm_uq.jobs.origin import MEASURED, DerivedFrom, Origin
from cmm_uq.jobs.plan import PlanFacts
from cmm_uq.jobs.table import (
    AnyFloat,
    Length,
    Limit,
    Names,
    Numbers,
    Table,
    Uncertainty,
    at_least,
)
from cmm_uq.points import Points
from cmm_uq.writing import Owner, staged

Standard = Literal["ASME B89.4.1-1997", "ISO 10360-2:2009", "ISO 10360-5:2010", "VDI/VDE 2617"]

CHARACTERISTICS: Mapping[Standard, str] = {
    "ASME B89.4.1-1997": "volumetric performance", "ISO 10360-2:2009": "E0", "ISO 10360-5:2010": "P_FTU",
    "VDI/VDE 2617": "E0",
}  # fmt: skip
"""The characteristic that is decided of each standard, of all that it has."""

LENGTH_STANDARDS: tuple[Standard, ...] = ("ISO 10360-2:2009", "VDI/VDE 2617")
"""Standards that compare with calibrated lengths."""

FORM_STANDARD: Standard = "ISO 10360-5:2010"
"""Compares the form of a calibrated sphere."""

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


class Traceability(Table):
    """The artefact's own certificate."""

    number: str = ""
    laboratory: str = ""
    date: dt.date | None = None
    due: dt.date | None = None


class ArtefactFacts(Table):
    """``[artefact]``: what every kind of measurement has; a kind with more keys has a table of its own.

    Without ``length_mm`` the artefact is uncalibrated, unless its certified figures stand in the recording.

    Attributes
    ----------
    with_references : whether they do; its ``u_um`` may then stand without ``length_mm``.
    with_recording : whether there is one; otherwise what ``[machine]`` names is measured.
    with_earlier : whether two recordings of it at two dates can be compared.
    carries_probe : whether its recording itself says how far from the end of the ram each point was, as tip offsets do.
    form_key : key of the form deviation by its certificate, for a kind that has a form to be compared.
    """

    with_references: ClassVar[bool] = False
    with_recording: ClassVar[bool] = True
    with_earlier: ClassVar[bool] = False
    carries_probe: ClassVar[bool] = False
    form_key: ClassVar[str | None] = None

    kind: str
    name: str = ""
    serial: str = ""
    length_mm: Length | None = None
    u_um: Uncertainty | None = None
    cte_per_k: AnyFloat = 0.0
    certificate: Traceability | None = None

    @model_validator(mode="after")
    def _uncertainty_of_something(self) -> Self:
        if self.u_um is not None and self.length_mm is None and not self.with_references:
            raise ValueError("u_um is given without length_mm: give both, or neither for an uncalibrated artefact")
        if abs(self.cte_per_k) > 1e-3:
            raise ValueError(
                f"cte_per_k = {self.cte_per_k:g} is no expansion coefficient: steel has 11.5e-6 per kelvin"
            )
        return self

    @property
    def certified(self) -> bool:
        """Whether lengths can be compared with it."""
        return self.length_mm is not None


class ReferencedFacts(ArtefactFacts):
    """``[artefact]`` of a kind whose certified figures stand in the recording.

    ``nominal`` says that those figures are nominal only: their common scale then stays free.
    """

    with_references: ClassVar[bool] = True

    nominal: bool = False

    @model_validator(mode="after")
    def _nominal_or_certified(self) -> Self:
        if self.nominal and (self.u_um is not None or self.length_mm is not None):
            raise ValueError(
                "nominal = true says that the recording's references are not certified: leave out length_mm and u_um"
            )
        return self

    @property
    def certified(self) -> bool:
        """Whether lengths can be compared with it."""
        return not self.nominal


class RecordingFacts(Table):
    """``[recording]``. Measurements named in ``set_aside`` stay on the certificate but are not used for estimates.

    ``earlier`` names a recording of the same artefact in the same placings at an earlier date: what is estimated then is what
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
        if self.standard in LENGTH_STANDARDS:
            return "u_um" if artefact.certified and not artefact.u_um else None
        key = artefact.form_key if self.standard == FORM_STANDARD else None
        return key if key is not None and not getattr(artefact, key) else None


def needed(key: str, wish: ConformityFacts) -> tuple[str, str]:
    """That a rule needs an uncertainty which ``[artefact]`` does not state, and how to mend it."""
    rule = wish.rule if isinstance(wish.rule, str) else next(iter(wish.rule.model_dump()))
    return (
        f"the rule {rule} needs the uncertainty of what {wish.standard} compares with, and [artefact] states no {key} above 0",
        f'Give {key} in [artefact], or rule = "simple", which takes no account of it',
    )


class JobFile(Table):
    """All of job.toml. A job of a kind without a recording has no ``[recording]``."""

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
    def _without_recording(cls, data: Any) -> Any:
        table = cls.model_fields["artefact"].annotation
        if isinstance(data, dict) and not getattr(table, "with_recording", True):
            return {"recording": {"file": ""}, **data}
        return data


Tables = Callable[[str], type[ArtefactFacts] | None]
"""The table of ``[artefact]`` of a kind, by its name; ``None`` where there is no such kind."""


@cache
def job_file_of(table: type[ArtefactFacts]) -> type[JobFile]:
    """All of job.toml, with the table of one kind in it."""
    return create_model("JobFile", __base__=JobFile, artefact=(table, ...))


@dataclass(frozen=True, eq=False, repr=False)
class Job:
    """A job as read: its facts, its recording, and the bytes of every file it was read from.

    Parameters
    ----------
    folder : where it lies; the empty path for a job that lies in no folder yet.
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

    def write(self, folder: str | Path, *, force: bool = False) -> dict[str, Path]:
        """Write the job as a folder that reads back to it.

        Parameters
        ----------
        folder : to write to.
        force : keep what stands in the way as ``NAME.previous`` instead of refusing.

        Returns
        -------
        path of each file, by its name.

        Raises
        ------
        CmmUqError : something stands in the folder that was not written for this job.
        OutputError : the folder cannot be written to.
        """
        derived = self.facts.job.derived_from
        owner = Owner("job" if derived is None else derived.by, self.facts.job.id, self.origin)
        with staged(Path(folder), owner, inputs=self.paths, force=force, expected=self.inputs) as place:
            return place.write(self.inputs)

    def __repr__(self) -> str:
        facts = self.facts
        return f"<Job {facts.job.id}: {facts.artefact.kind} on {facts.machine.name}, {len(self.points)} points, {self.origin}>"

    def _repr_html_(self) -> str:
        rows = (
            ("Job", self.facts.job.id),
            ("Machine", self.facts.machine.name),
            ("Artefact", self.facts.artefact.kind),
            ("Points", len(self.points)),
            ("Recording", self.origin),
            ("Effects", ", ".join(self.facts.model.effects)),
        )
        cells = "".join(f"<tr><th>{escape(head)}</th><td>{escape(str(cell))}</td></tr>" for head, cell in rows)
        return f"<table>{cells}</table>"
