"""How a recording was taken live: ``NAME.acquired.json`` beside it says by which instruments, when, and what it lacks.

``cmm-uq acquire`` writes it with the recording. It names the recording's SHA-256, so that one that was changed afterwards is
told from one that was not.
"""

from __future__ import annotations

import hashlib
from collections.abc import Mapping
from math import hypot
from pathlib import PurePosixPath
from typing import Any

from pydantic import Field, ValidationError

from cmm_uq.base.errors import CmmUqError
from cmm_uq.base.messages import Text, Verbatim, commas, names, plural, say, sentences
from cmm_uq.base.values import dataclass
from cmm_uq.jobs.reports import ResultsPart
from cmm_uq.jobs.tables.conformity import TestUncertainty
from cmm_uq.jobs.tables.identification import MEASURED, SIMULATED

SCHEMA = "cmm-uq/acquired/1"
ARTEFACT, TIME = "temp_artefact_c", "time_s"
_NAMED = 5  # gaps and points that a certificate names one by one


class Instrument(ResultsPart):
    """One that readings came from: what it said itself, and what the job says of it."""

    name: str
    maker: str | None = None
    model: str | None = None
    serial: str | None = None
    firmware: str | None = None
    certificate: str | None = None
    columns: dict[str, str] = {}
    latency_ms: float = 0.0
    units: dict[str, str] = {}  # by quantity, those that it does not say itself
    units_stated: list[str] = []  # quantities whose units the job states
    unasked: int = 0  # answers that nobody had asked for, none of which was used

    @property
    def sentence(self) -> Text:
        """What it said itself, and in which units it is taken to send its quantities, by whose word."""
        parts: list[Text] = names(filter(None, (self.name, " ".join(filter(None, (self.maker, self.model))))))
        if self.serial:
            parts.append(say("serial number {serial}", serial=Verbatim(self.serial)))
        if self.firmware:
            parts.append(say("firmware {firmware}", firmware=Verbatim(self.firmware)))
        number = self.certificate
        parts.append(say("certificate {number}", number=Verbatim(number)) if number else say("no certificate stated"))
        for unit in dict.fromkeys(self.units.values()):
            of = [name for name, given in self.units.items() if given == unit]
            shown, stated = Verbatim(unit), [name for name in of if name in self.units_stated]
            if stated:
                parts.append(say("{names} in {unit} as stated", names=commas(names(stated)), unit=shown))
            if assumed := [name for name in of if name not in stated]:
                parts.append(say("{names} in {unit} as assumed", names=commas(names(assumed)), unit=shown))
        if self.unasked:
            many = say("{count} answers to no question, not used", count=self.unasked)
            parts.append(plural(self.unasked, one=say("1 answer to no question, not used"), many=many))
        return commas(parts)


class Silence(ResultsPart):
    """When an instrument gave nothing: since the start of the job, and for how long; to the end of its session without."""

    instrument: str
    since_s: float
    lasted_s: float | None = None
    why: str

    @property
    def sentence(self) -> Text:
        instrument, why = Verbatim(self.instrument), Verbatim(self.why)
        if self.lasted_s is None:
            return say("{instrument} from {since:.0f} s on: {why}", instrument=instrument, since=self.since_s, why=why)
        return say("{instrument} from {since:.0f} s for {lasted:.3g} s: {why}", instrument=instrument, since=self.since_s,
                   lasted=self.lasted_s, why=why)  # fmt: skip


class JoinedColumn(ResultsPart):
    """A column that was joined by time: rms and largest standard uncertainty of interpolation, and the points without it."""

    u: float
    u_largest: float
    missing: list[tuple[int, int, int]] = []

    def sentence(self, name: str) -> Text:
        """What the joining adds to the column's uncertainty, and what is missing of it."""
        joined = say("{name}: not known of every point", name=Verbatim(name)) if name == TIME else say(
            "{name}: u = {u:.2g} by interpolation in time, {largest:.2g} at most", name=Verbatim(name), u=self.u,
            largest=self.u_largest,
        )  # fmt: skip
        if not self.missing:
            return joined
        points: list[Text] = [say("{m}/{p}/{r}", m=m, p=p, r=r) for m, p, r in self.missing[:_NAMED]]
        if (more := len(self.missing) - _NAMED) > 0:
            points.append(say("{more} more", more=more))
        return say("{told}; without a value, and so not used: measurement/point/repeat {points}", told=joined,
                   points=commas(points))  # fmt: skip


class Withdrawal(ResultsPart):
    measurement: int
    point: int
    repeat: int
    reason: str


class AcquisitionSession(ResultsPart):
    """One run of the program, and its journal."""

    number: int
    begin_utc: str
    journal: str
    sha256: str


class AcquisitionRecord(ResultsPart):
    """All of ``NAME.acquired.json``."""

    schema_: str = Field(SCHEMA, alias="schema")
    program: str
    simulated: bool
    recording_sha256: list[str]
    sessions: list[AcquisitionSession]
    instruments: list[Instrument]
    typed: int
    files: dict[str, str] = {}
    columns: dict[str, JoinedColumn] = {}
    gaps: list[Silence] = []
    undone: list[Withdrawal] = []
    clock_jumps_s: list[float] = []
    damaged: list[str] = []
    left_out: int = 0


@dataclass(frozen=True)
class Provenance:
    """Of a job's recording: what stands in the file, and whether the recording was changed after it was taken."""

    said: AcquisitionRecord
    changed: bool

    @property
    def without(self) -> tuple[str, ...]:
        """Columns that some points have no value of."""
        return tuple(name for name, column in self.said.columns.items() if column.missing)

    @property
    def sentence(self) -> Text:
        """How it was taken, for a certificate."""
        said, program, sessions = self.said, Verbatim(self.said.program), len(self.said.sessions)
        parts: list[Text] = [plural(
            sessions, one=say("taken live by {program}", program=program),
            many=say("taken live by {program} in {count} sessions", program=program, count=sessions),
        )]  # fmt: skip
        if said.typed:
            parts.append(plural(said.typed, one=say("1 point was typed by the operator"),
                                many=say("{count} points were typed by the operator", count=said.typed)))  # fmt: skip
        if said.files:
            parts.append(say("points were read from {files}", files=commas(names(said.files.values()))))
        if said.undone:
            parts.append(plural(len(said.undone), one=say("1 point was taken back, with its reason in the journal"),
                                many=say("{count} points were taken back, with their reasons in the journal",
                                         count=len(said.undone))))  # fmt: skip
        if self.changed:
            parts.append(say("the recording was changed after it was taken"))
        if said.damaged:
            parts.append(say("damaged lines of the journal are not in it: {lines}", lines=commas(names(said.damaged))))
        return sentences([say("{part:capital}.", part=part) for part in parts])

    @property
    def warnings(self) -> list[Text]:
        """What a reader must know before the figures."""
        told: list[Text] = [say("The recording was changed after it was taken live.")] if self.changed else []
        if self.said.damaged:
            told.append(say("Damaged lines of the journal are not in the recording."))
        return told + [
            say("{name} is not used: {count} of the points have no value of it.", name=Verbatim(name),
                count=len(self.said.columns[name].missing))
            for name in self.without if name != TIME
        ]  # fmt: skip

    @property
    def instruments(self) -> list[Text]:
        return [instrument.sentence for instrument in self.said.instruments]

    @property
    def joins(self) -> list[Text]:
        return [column.sentence(name) for name, column in self.said.columns.items()]

    @property
    def gaps(self) -> list[Text]:
        """When instruments were silent, the first of them one by one; and jumps of the clock."""
        gaps = [gap.sentence for gap in self.said.gaps[:_NAMED]]
        if (more := len(self.said.gaps) - _NAMED) > 0:
            gaps.append(say("{more} further gaps are in the journal", more=more))
        return [*gaps, *(say("the computer's clock was moved by {s:.3g} s", s=s) for s in self.said.clock_jumps_s)]

    @property
    def data(self) -> dict[str, Any]:
        said = self.said.model_dump(mode="json")
        further = ("instruments", "typed", "files", "gaps", "columns", "undone", "clock_jumps_s", "damaged")
        return {
            "program": said["program"], "simulated": said["simulated"], "changed": self.changed,
            "sessions": len(said["sessions"]), **{name: said[name] for name in further},
        }  # fmt: skip

    def with_joined(self, stated: TestUncertainty) -> TestUncertainty:
        """The stated uncertainty of the artefact's temperature, and that of having interpolated it, in quadrature."""
        column = self.said.columns.get(ARTEFACT)
        if column is None or not column.u:
            return stated
        return stated.model_copy(update={"u_temperature_k": hypot(stated.u_temperature_k, column.u)})


def provenance_name(recording: str) -> str:
    """Name of the file beside a recording: ``ballbar.csv`` has ``ballbar.acquired.json``."""
    path = PurePosixPath(recording)
    return str(path.with_name(f"{path.stem}.acquired.json"))


def provenance_of(content: bytes, recording: bytes, origin: str, where: str) -> Provenance:
    fix = "Take it away, or have cmm-uq acquire write it anew"
    try:
        said = AcquisitionRecord.model_validate_json(content)
    except ValidationError as error:
        first = error.errors(include_url=False)[0]
        place = ".".join(str(part) for part in first["loc"])
        raise CmmUqError(f"does not say how the recording was taken: {first['msg']}", where=f"{where}: {place}",
                         fix=fix) from None  # fmt: skip
    if said.schema_ != SCHEMA:
        raise CmmUqError(f"has the layout {said.schema_!r}, and {SCHEMA!r} is read", where=where, fix=fix)
    if said.simulated and origin == MEASURED:
        raise CmmUqError("the recording was simulated, and job.toml says measured", where=where,
                         fix=f'Write origin = "{SIMULATED}" in [job]')  # fmt: skip
    return Provenance(said, hashlib.sha256(recording).hexdigest() not in said.recording_sha256)


def as_file(said: Mapping[str, Any]) -> bytes:
    return (AcquisitionRecord.model_validate(said).model_dump_json(indent=2, by_alias=True) + "\n").encode()
