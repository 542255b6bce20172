"""The typed contents of a job: what job.toml may say, key by key, and the recording it names."""

from __future__ import annotations

import datetime as dt
import re
from collections.abc import Callable, Iterator, Mapping
from functools import cache
from pathlib import Path
from typing import Annotated, Any

import numpy as np
from pydantic import BeforeValidator, Field, ValidationInfo, create_model, field_validator, model_validator

from cmm_uq.base.errors import CmmUqError, suggestion
from cmm_uq.base.files.limits import COLUMNS, CONFORMITY, EFFECTS, LISTED, STATED
from cmm_uq.base.files.table import AnyFloat, Column, JobTable, Limit, Names, Number, at_least, key, required
from cmm_uq.base.messages import Text, html_table, say
from cmm_uq.base.output import Owner, staged
from cmm_uq.base.points import Points
from cmm_uq.base.values import dataclass, field, replace
from cmm_uq.jobs.acquired import Provenance
from cmm_uq.jobs.columns import AMBIENT
from cmm_uq.jobs.importing.format import ImportKeys, Recognition
from cmm_uq.jobs.recording.beside import ShortGauge, ShortGaugeFacts
from cmm_uq.jobs.recording.compared import Prediction, SimulationFacts
from cmm_uq.jobs.reports import AsFound
from cmm_uq.jobs.tables import conformity as rules
from cmm_uq.jobs.tables.artefact import ArtefactFacts, ThermometerFacts, Traceability
from cmm_uq.jobs.tables.conformity import Circumstances, ConformityFacts, RatedConditions, TestUncertainty
from cmm_uq.jobs.tables.identification import MEASURED, DerivedFrom, Identification, Laboratory, Origin
from cmm_uq.jobs.tables.machine import MachineFacts, ProbeFacts
from cmm_uq.jobs.tables.plan import AcquireFacts, EffectFacts, PlanFacts, ProveFacts

Tolerance = Annotated[float, Field(gt=0, le=1e9), at_least(1e-9)]  # A permissible size of an effect in its own unit


class JobFacts(Identification):
    """``[job]``: identification, and free text for the certificate."""

    diagnosis_on_certificate: bool = key(False, "Whether the whole diagnosis is printed in the certificate's annex.")
    recalibration_agreed: dt.date | None = None
    """Date of the next calibration, where the customer agreed to be told one (7.8.4.3); no other is printed."""
    adjusted_since: dt.date | None = None
    """Day on which the machine was last adjusted before this recording; trends in the records begin anew there."""
    interim: bool = key(False, "Whether this is an interim check between two calibrations, and no certificate.")
    as_found: str | None = None
    """`results.json`, or the folder with it inside the job's, of the machine before it was adjusted (7.8.4.1 d)."""
    origin: Origin = MEASURED
    """Where the recording comes from; all that is made from a recording that was not measured says so."""
    derived_from: DerivedFrom | None = None
    """Written by the commands that make a recording out of another: of what job, by what, and hashes."""

    def problems(self) -> Iterator[str]:
        yield from super().problems()
        if self.derived_from is not None and self.origin == MEASURED:
            yield 'derived_from says that the recording was made from another: origin must be "simulated" or "compensated"'
        if self.adjusted_since is not None and self.adjusted_since > self.date:
            yield (
                f"adjusted_since = {self.adjusted_since} is after the measurement of {self.date}: give the last day of an "
                "adjustment before it"
            )


CIRCULAR = say("traceability (artefact: a certificate from another machine)"), "[artefact.certificate] machine"


class SetAside(JobTable):
    """A measurement that the laboratory leaves out of the estimates."""

    measurement: Number = required("Its number.")
    reason: str = key("", "Why it is left out, as the certificate says it beside every decision.")


def _as_entry(given: Any) -> Any:
    """A number alone, as the table that says the same."""
    return {"measurement": given} if isinstance(given, int) and not isinstance(given, bool) else given


Aside = Annotated[SetAside, BeforeValidator(_as_entry, json_schema_input_type=SetAside | Number)]


class Recorded(JobTable):
    """Which recording, and what is stated of it."""

    file: str = required("The recording, beside job.toml: a CSV with one row a point, or an export that is imported.")
    earlier: str | None = None
    """Recording of the same artefact in the same placings at an earlier date: what changed between is estimated."""
    earlier_date: dt.date | None = key(None, "Date of the earlier recording.")
    constant: Annotated[dict[Column, AnyFloat], Field(max_length=COLUMNS.most)] = {}
    """Columns that the file has not, each at one value for the whole recording, as the head of an export says a temperature:
    `{ temp_air_c = 20.4 }`."""
    u_coordinate_um: Limit | None = None
    """Stated standard uncertainty of one recorded coordinate; left out, it is estimated from repeats and residuals."""
    set_aside: Annotated[list[Aside], Field(max_length=LISTED.most)] = []
    """Measurements that stay on the certificate, and in every decision, but are not used for estimates: numbers, or with
    their reasons, `{ measurement = 3, reason = "…" }`."""

    @property
    def measurements_aside(self) -> tuple[int, ...]:
        return tuple(entry.measurement for entry in self.set_aside)

    def with_constant(self, points: Points, toml: Path) -> Points:
        """The points of the recording with what is stated of all of them."""
        where = f"{toml}: [recording] constant"
        for name in self.constant:
            if name in points.columns:
                raise CmmUqError(f"the recording has {name} itself", where=where, fix="Leave it out")
            if name not in AMBIENT:
                problem = f"{name} is no temperature, pressure or humidity"
                raise CmmUqError(problem, where=where, fix=suggestion(name, AMBIENT))
        given = {name: np.full(len(points), value) for name, value in self.constant.items()}
        return replace(points, columns={**points.columns, **given}) if given else points


class RecordingFacts(ImportKeys, Recorded):
    """``[recording]``. Measurements named in ``set_aside`` stay on the certificate but are not used for estimates."""


class ModelFacts(JobTable):
    """``[model]``: the physics that the simulation is told about."""

    effects: Names
    """The physics that the simulation is told about: names of effects; what is not named is left out of it."""
    tolerances: Annotated[dict[str, Tolerance], Field(max_length=EFFECTS.most)] = {}
    """Largest permissible size of an effect's first parameter, by the effect's name and in its unit."""

    def problems(self) -> Iterator[str]:
        for name in self.tolerances:
            if name not in self.effects:
                yield f"tolerances names {name!r}, which is not among the effects: {suggestion(name, self.effects)}"


class JobFile(JobTable):
    """All of job.toml. A job of a kind without a recording has no ``[recording]``."""

    job: JobFacts = required("Identification, and free text for the certificate.")
    laboratory: Laboratory = Laboratory.left_out("Who answers for the certificate.")
    machine: MachineFacts = required("The machine that was measured.")
    artefact: ArtefactFacts = required("The artefact that it was measured with, or the kind of measurement.")
    recording: RecordingFacts = required("What was recorded, and in which file.")
    short_gauge: ShortGaugeFacts | None = None
    """A short gauge met from both sides, recorded beside lengths that are not bidirectional by themselves."""
    thermometer: Annotated[list[ThermometerFacts], Field(max_length=100)] = []
    """The thermometers that recorded temperatures were read from, each a table of its own with its certificate."""
    simulation: SimulationFacts | None = None
    """A prediction of another program, or an error map, that the recording is diagnosed against."""
    probe: ProbeFacts = ProbeFacts.left_out("With what the recording was made.")
    test_uncertainty: TestUncertainty = TestUncertainty.left_out()
    """What a test value is uncertain by beside the calibration of the artefact (ISO/TS 23165)."""
    rated_conditions: RatedConditions = RatedConditions.left_out()
    """Conditions under which the limits of the machine hold, by its data sheet."""
    model: ModelFacts = required("The physics that the simulation is told about.")
    effect: Annotated[list[EffectFacts], Field(max_length=STATED.most)] = []
    """Physics of your own, each a formula with its parameters: named in `[model] effects`, or a candidate of the diagnosis."""
    conformity: Annotated[list[ConformityFacts], Field(max_length=CONFORMITY.most)] = []
    """Statements of conformity: a standard, a limit and a rule each."""
    plan: PlanFacts = PlanFacts.left_out("What may be measured, where, and what it should tell; read by `cmm-uq plan`.")
    acquire: AcquireFacts = AcquireFacts.left_out("The instruments that the recording is taken from live.")
    prove: ProveFacts = ProveFacts.left_out()
    """By which figures the diagnosis is accepted on these set-ups; read by `cmm-uq prove`."""

    @field_validator("conformity")
    @classmethod
    def _rules_have_their_uncertainty(
        cls, wishes: list[ConformityFacts], info: ValidationInfo
    ) -> list[ConformityFacts]:
        artefact, uncertainty = info.data.get("artefact"), info.data.get("test_uncertainty")
        if artefact is None or uncertainty is None:
            return wishes  # what is wrong with these is said instead
        by_points = artefact.with_references and artefact.u_um is None  # which the recording may state of each
        whole = artefact.model_copy(update={"u_um": 1.0}) if by_points else artefact
        for wish in wishes:
            if missing := rules.uncertainty_missing(wish, whole, uncertainty, rules.standards_in(info)):
                raise ValueError(". ".join(rules.needed(missing, wish)))
        return wishes

    @field_validator("conformity")
    @classmethod
    def _standards_are_for_the_probe(cls, wishes: list[ConformityFacts], info: ValidationInfo) -> list[ConformityFacts]:
        if "probe" in info.data and "machine" in info.data:
            sensing = _sensing(info.data["probe"], info.data["machine"])
            for wish in wishes:
                if unfit := rules.probe_unfit(wish, sensing, rules.standards_in(info)):
                    raise ValueError(unfit)
        return wishes

    @property
    def circumstances(self) -> Circumstances:
        """Under which a standard's test was carried out."""
        probe = self.probe.model_copy(update={"sensing": _sensing(self.probe, self.machine)})
        stated = "cte_per_k" in self.artefact.model_fields_set
        return Circumstances(
            self.test_uncertainty, self.rated_conditions, probe, self.artefact.cte_per_k if stated else None,
            cmc=self.laboratory.cmc,
            set_aside={entry.measurement: entry.reason for entry in self.recording.set_aside},
        )  # fmt: skip

    @property
    def certified_on_this_machine(self) -> bool:
        """Whether the artefact's certificate comes from the machine that the artefact now tests."""
        chain, machine = self.artefact.certificate, self.machine
        stated, serial = "" if chain is None else chain.machine, machine.serial
        if not _words(stated):
            return False
        telling = len(_words(serial)) > 2 and any(letter.isdigit() for letter in serial)  # 1102, and not 7
        within = telling and f" {_words(serial)} " in f" {_words(stated)} "
        return within or _words(stated) in (_words(machine.name), _words(serial))

    @model_validator(mode="before")
    @classmethod
    def _without_recording(cls, data: Any) -> Any:
        table = cls.model_fields["artefact"].annotation
        if isinstance(data, dict) and not getattr(table, "with_recording", True):
            return {"recording": {"file": ""}, **data}
        return data


def _words(name: str) -> str:
    """Letters and digits of a name, its words a space apart, however it is written."""
    return " ".join(re.findall(r"[^\W_]+", name.casefold()))


def _sensing(probe: ProbeFacts, machine: MachineFacts) -> str | None:
    """How the probe senses; a digitizer on the ram is an optical one."""
    return probe.sensing or ("optical" if machine.digitizer is not None else None)


Tables = Callable[[str], type[ArtefactFacts] | None]
"""The table of ``[artefact]`` of a kind, by its name; ``None`` where there is no such kind."""


@cache
def job_file_of(table: type[ArtefactFacts]) -> type[JobFile]:
    """All of job.toml, with the table of one kind in it."""
    return create_model("JobFile", __base__=JobFile, artefact=(table, ...))


@dataclass(frozen=True, eq=False, repr=False)
class Job:
    """A job as read: its facts, its recording, and the bytes of every file it was read from.

    folder : where it lies; the empty path for a job that lies in no folder yet.
    facts : job.toml.
    points : the recording.
    inputs : contents of each input by its path inside the folder, for hashes and attachments.
    altered : names of files that were changed after a command derived them.
    planned : whether the recording holds the nominal coordinates of a plan.
    as_found : what the machine showed before it was adjusted, where the job names it.
    short_gauge : recorded beside the artefact, where the job names one.
    prediction : of a simulation, where the job names a file of it.
    clauses : forms of standards' clauses that the laboratory filled in, by their file.
    beside : files that it was read from and that lie outside its folder.
    imported : how files in another format than the project's own were read.
    acquired : how the recording was taken live, where it was.
    further : names of those of the inputs that are further certificates of the machine.
    certified : keys of ``[artefact]`` that its digital certificate says, and job.toml does not.
    """

    folder: Path
    facts: JobFile
    points: Points
    inputs: Mapping[str, bytes]
    altered: tuple[str, ...] = ()
    planned: bool = False
    as_found: AsFound | None = None
    short_gauge: ShortGauge | None = None
    prediction: Prediction | None = None
    beside: tuple[Path, ...] = ()
    imported: tuple[Recognition, ...] = ()
    acquired: Provenance | None = None
    certified: Mapping[str, Any] = field(default_factory=dict)
    clauses: Mapping[str, rules.ClausesForm] = field(default_factory=dict)
    further: tuple[str, ...] = ()

    @property
    def circumstances(self) -> Circumstances:
        """Under which a standard's test was carried out, with the short gauge recorded beside it.

        Of an artefact's temperature that was joined by time, what the interpolation adds is in its uncertainty.
        """
        stated = self.facts.circumstances
        uncertainty = stated.uncertainty if self.acquired is None else self.acquired.with_joined(stated.uncertainty)
        lapsed = tuple(
            (say("traceability ({what}: {lack})", what=what, lack=lack), key) for what, lack, key in self.denials()
        )
        if self.facts.artefact.traced and self.facts.certified_on_this_machine:
            lapsed += (CIRCULAR,)
        if beyond := int(sum(self.points.columns.get("extrapolated", ()))):
            what = say("error maps that reach all points ({count} were corrected beyond them)", count=beyond)
            lapsed += ((what, "[machine] error_map"),)
        if n := self.points.read_as_certified:
            what = say(
                "certified lengths that are not the readings themselves ({count} are equal to the last digit)", count=n
            )
            lapsed += ((what, "reference_mm"),)
        return replace(
            stated, short_gauge=self.short_gauge, clauses=self.clauses, uncertainty=uncertainty, lapsed=lapsed
        )

    def denials(self) -> Iterator[tuple[Text, Text, str]]:
        """Certificates that the results rest on and that did not hold on the day: of what, why, and the key that says so."""
        facts, recorded = self.facts, {*self.points.columns}
        stated: list[tuple[Text, Traceability | None, str]] = [
            (say("artefact"), facts.artefact.certificate if facts.artefact.traced else None, "[artefact.certificate]")
        ]
        if facts.short_gauge is not None:
            stated.append((say("short gauge"), facts.short_gauge.certificate, "[short_gauge.certificate]"))
            recorded |= set() if self.short_gauge is None else {*self.short_gauge.points.columns}
        for number, one in enumerate(facts.thermometer, 1):
            if own := sorted(recorded & {*one.columns}):
                stated.append((one.called(own), one.certificate, f"[[thermometer]] {number} certificate"))
        for what, certificate, table in stated:
            for lack, at in () if certificate is None else certificate.denials(facts.job.date, table):
                yield what, lack, at

    @property
    def origin(self) -> Origin:
        return self.facts.job.origin

    @property
    def paths(self) -> tuple[Path, ...]:
        """Every file that it was read from."""
        return (*(self.folder / name for name in self.inputs), *self.beside)

    @property
    def recording_path(self) -> str:
        return str(self.folder / self.facts.recording.file)

    def write(self, folder: str | Path, *, force: bool = False) -> dict[str, Path]:
        """Write the job as a folder that reads back to it; the path of each file is given back, by its name.

        Parameters
        ----------
        folder : to write to.
        force : keep what stands in the way as ``NAME.previous`` instead of refusing.

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
        facts, count, effects = self.facts, len(self.points), ", ".join(self.facts.model.effects)
        texts = (facts.job.id, facts.machine.name, facts.artefact.kind, count, self.origin, effects)
        heads = ("Id", "Machine", "Artefact", "Points", "Recording", "Effects")
        return html_table("Job", (), tuple(zip(heads, texts, strict=True)))
