"""Entries and their chain, and what records are asked for: machines, artefacts, certificates with their values, series.

Each entry carries the hash of the one before, so that none can be altered, deleted or exchanged unseen. Whether entries are
missing at its end, or the whole was written anew, only a hash filed elsewhere can show (``cmm-uq records head``,
``cmm-uq records verify --head``).
"""

from __future__ import annotations

import datetime as dt
import json
import re
import unicodedata
from collections.abc import Mapping, Sequence
from hashlib import sha256
from typing import TYPE_CHECKING, Any

from cmm_uq.base.errors import CmmUqError
from cmm_uq.base.values import dataclass, field, replace

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

KINDS = (
    "machine", "artefact", "report", "part", "release", "withdrawal", "replacement", "adjustment", "check", "imported",
    "retained", "sent", "signed",
)  # fmt: skip
"""What an entry may be of."""

CERTIFIED = frozenset({"report", "part", "check", "imported"})
"""Kinds whose content is that of a certificate, of a part's report or of an interim check."""

BEGINNING = "0" * 64  # what the first entry carries in place of a hash before it


@dataclass(frozen=True, slots=True)
class Entry:
    number: int  # 1, 2, … without a gap
    at: str  # moment of recording, UTC, ISO 8601
    kind: str
    content: str  # canonical JSON
    previous: str  # hash of the entry before, hexadecimal
    hash: str

    @property
    def data(self) -> dict[str, Any]:
        try:
            return dict(json.loads(self.content))
        except (ValueError, TypeError, RecursionError):
            problem = f"entry {self.number} is not as it was recorded"
            raise CmmUqError(problem, fix="See cmm-uq records verify") from None

    @property
    def true(self) -> bool:
        """Whether the hash is that of the entry; SQLite lets somebody put bytes where a text is to be, which none has."""
        if not all(isinstance(part, str) for part in (self.previous, self.at, self.kind, self.content)):
            return False
        return self.hash == hash_of(self.previous, self.number, self.at, self.kind, self.content)


_NUL = re.compile(r"(?<!\\)(?:\\\\)*\\u0000")  # as JSON escapes it, and no backslash before the letters u0000


def canonical(content: Mapping[str, Any]) -> str:
    """The one way in which a content is written: keys sorted, no blanks, finite numbers in their shortest form."""
    try:
        text = json.dumps(content, sort_keys=True, separators=(",", ":"), ensure_ascii=False, allow_nan=False)
        text.encode()
    except (TypeError, ValueError) as error:
        raise CmmUqError(f"cannot be recorded: {error}", where="records") from error
    if _NUL.search(text):  # PostgreSQL has no such character
        raise CmmUqError("cannot be recorded: a text holds the character NUL", where="records")
    return text


OF_CERTIFICATE = ("certificate", "laboratory", "calibrated", "due")  # of an artefact, what entries say


def certificate_after(known: Mapping[str, Any], said: Mapping[str, Any]) -> dict[str, Any]:
    """What holds of an artefact's certificate after an entry: what that leaves unsaid stays, unless it names another one."""
    held = {} if another_certificate(known, said) else known
    return {name: said.get(name) or held.get(name) or None for name in OF_CERTIFICATE}


def another_certificate(known: Mapping[str, Any], said: Mapping[str, Any]) -> bool:
    """Whether both say which it is, and not the same."""
    both = ((known.get(name), said.get(name)) for name in ("certificate", "calibrated"))
    return any(one and other and one != other for one, other in both)


def hash_of(previous: str, number: int, at: str, kind: str, content: str) -> str:
    """SHA-256 of an entry, as the JSON list of its parts: no two entries have the same text."""
    parts = json.dumps([previous, number, at, kind, content], separators=(",", ":"), ensure_ascii=False)
    return sha256(parts.encode()).hexdigest()


def following(previous: str, number: int, at: dt.datetime, kind: str, content: Mapping[str, Any]) -> Entry:
    """The entry after one of the hash ``previous``."""
    if kind not in KINDS:
        raise CmmUqError(f"{kind!r} is no kind of entry", where="records", fix=f"Known: {', '.join(KINDS)}")
    text, moment = canonical(content), moment_of(at)
    return Entry(number, moment, kind, text, previous, hash_of(previous, number, moment, kind, text))


def instant(text: str) -> dt.datetime | None:
    """A moment of recording as it stands in an entry; ``None`` where the text is none, with its zone."""
    try:
        moment = dt.datetime.fromisoformat(text)
    except ValueError:
        return None
    return moment if moment.tzinfo else None


def moment_of(at: dt.datetime) -> str:
    """A moment as entries have it: UTC with microseconds and Z; one without a zone is UTC already."""
    utc = at.replace(tzinfo=dt.UTC) if at.tzinfo is None else at.astimezone(dt.UTC)
    return utc.replace(tzinfo=None).isoformat(timespec="microseconds") + "Z"


def now() -> dt.datetime:
    return dt.datetime.now(dt.UTC)


_HASH = re.compile("[0-9a-f]{64}")
KEY = "records"  # of results.json, with the head at which a document was made


@dataclass(frozen=True, slots=True)
class ChainHead:
    """The newest entry of records; a document that states it shows that the chain up to it stood before the document did."""

    entries: int  # its number; 0 where there was none
    head: str  # its hash, hexadecimal
    at: str | None  # its moment, UTC, ISO 8601; ``None`` where there was none

    @property
    def data(self) -> dict[str, Any]:
        return {name: getattr(self, name) for name in self.__slots__}

    @property
    def moment(self) -> dt.datetime | None:
        return None if self.at is None else instant(self.at)

    @classmethod
    def of_results(cls, results: Mapping[str, Any]) -> ChainHead | None:
        """As a results.json states it; ``None`` where it was kept in no records, or is of a version that stated none."""
        if (said := results.get(KEY)) is None:
            return None
        match said:
            case {"entries": 0, "head": str() as head, "at": None} if head == BEGINNING and len(said) == len(
                cls.__slots__
            ):
                return cls(0, BEGINNING, None)
            case {"entries": int(number), "head": str(head), "at": str(at)} if len(said) == len(cls.__slots__):
                if number > 0 and _HASH.fullmatch(head) and instant(at) is not None:
                    return cls(int(number), head, at)
        raise CmmUqError("is no head of records: a number, a hash and a moment", where=f"results.json: {KEY}")


@dataclass(frozen=True)
class Witness:
    """A document in other hands, with the head that it states, and the SHA-256 of its results.json, as records know it."""

    name: str  # of its file
    head: ChainHead
    results_sha256: str
    what: str = "certificate"  # or a report of a part


@dataclass(frozen=True)
class Heads:
    """Where a document may say that the records stood: now, or, where the very same was recorded ``before``, as it says.

    ``before``: by SHA-256 of results.json, so that a report that is made again has the same bytes, and no second entry.
    """

    now: ChainHead | None = None
    before: Mapping[str, ChainHead] = field(default_factory=dict)


STATES = ("draft", "released", "withdrawn", "replaced")  # states of a certificate
STANDING = ("draft", "released")  # states of a certificate that counts: neither withdrawn nor replaced
PERFORMANCE = "performance:"  # with which the name of a value begins that a standard decided on


@dataclass(frozen=True, slots=True)
class RecordedMachine:
    """A machine; the second of one serial number has its manufacturer behind it, one without has its name."""

    serial: str
    name: str  # and manufacturer, model, place: as its newest certificate has them
    manufacturer: str
    model: str
    place: str
    adjusted: tuple[dt.date, ...] = ()  # days on which it was adjusted, sorted
    by_name: bool = False  # whether it has no serial number and is recognised by its name
    calibrate: Mapping[str, Any] | None = None


@dataclass(frozen=True, slots=True)
class ArtefactRow:
    """An artefact, with its newest certificate."""

    serial: str  # its serial number, or the number of its certificate, or its name
    kind: str  # of the measurement it was last used in
    certificate: str
    laboratory: str
    calibrated: dt.date | None  # and due: days of that
    due: dt.date | None


@dataclass(frozen=True, slots=True)
class RecordedValue:
    """One error factor, size or figure of performance of one certificate."""

    name: str  # ``scale_x.ppm``, ``artefact.length_mm``, ``accuracy.b89_range_um``, ``performance:E0``
    quantity: str  # how it is called in the field, as printed
    unit: str
    value: float
    u: float
    lower: float  # and upper: the stated 95 % interval
    upper: float
    u_artefact: float = 0.0
    limit: float | None = None  # the value conforms while its amount is no larger; ``None`` where none is set


@dataclass(frozen=True, slots=True)
class RecordedCertificate:
    """One certificate, interim check or diagnosis as recorded; the decision is the gravest, or ``none``."""

    entry: int
    job: str
    machine: str
    artefact: str  # serial of the artefact; empty where the job says nothing of it
    kind: str
    origin: str
    day: dt.date
    recorded: dt.datetime
    adjusted_since: dt.date | None  # last adjustment of the machine before the recording, as the job or an entry says
    state: str
    decision: str
    diagnosis: str  # verdict of the diagnosis; empty where there is none
    interim: bool  # whether it is an interim check and no certificate
    folder: str  # where its files are
    version: str  # of the package that made it
    results_sha256: str
    number: str
    command: str  # that made it: report or diagnose
    artefact_due: dt.date | None = None  # day by which the artefact was to be calibrated again, as the job said
    values: tuple[RecordedValue, ...] = ()
    covariance: tuple[tuple[str, ...], tuple[float, ...]] | None = None

    @property
    def artefact_overdue(self) -> bool:
        """Whether the artefact was due for calibration before the day of the measurement: it must not be released."""
        return self.artefact_due is not None and self.artefact_due < self.day


@dataclass(frozen=True, slots=True)
class MeasuredPart:
    """A part's report: which part, when it was measured, by which certificate of the machine, and what came of it."""

    day: dt.date
    calibrated: dt.date
    folder: str
    number: str
    part: str
    serial: str
    certificate: str
    outcome: str
    entry: int = 0  # of the records that have it; 0 where none does

    @classmethod
    def of(
        cls,
        part: Mapping[str, Any],
        calibrated: str,
        certificate: object,
        *,
        day: str,
        folder: str,
        number: object,
        outcome: object,
        entry: int = 0,
    ) -> MeasuredPart:
        """As files and entries state it, with ``None`` for what they leave open."""
        days = dt.date.fromisoformat(day), dt.date.fromisoformat(calibrated)
        name, serial, by, found = (str(one or "") for one in (part["name"], part["serial"], certificate, outcome))
        return cls(*days, folder, str(number), name, serial, by, found, entry)


@dataclass(frozen=True, slots=True)
class ReleaseSignature:
    entry: int
    certificate: int
    what: str
    by: str
    reason: str
    at: dt.datetime
    replaced_by: int | None = None


@dataclass(frozen=True, slots=True)
class Series:
    """One value of one machine over its certificates and interim checks, by day; each array is (n,)."""

    name: str
    quantity: str
    unit: str
    limit: float | None  # that the newest certificate with one sets
    day: NDArray[np.int64]  # of the measurement, proleptic Gregorian ordinal
    value: NDArray[np.float64]
    u: NDArray[np.float64]
    u_artefact: NDArray[np.float64]
    artefact: NDArray[np.str_]
    entry: NDArray[np.int64]
    adjusted_since: NDArray[np.int64]  # day of the last adjustment before, ordinal; 0 where none is known
    interim: NDArray[np.bool_]  # whether it is of an interim check

    @classmethod
    def of(cls, name: str, quantity: str, unit: str, limits: Sequence[float | None], rows: Sequence[Any]) -> Series:
        """Of rows by day: day, value, u, u_artefact, artefact, entry, last adjustment or ``None``, whether a check."""
        import numpy as np

        day, value, u, u_artefact, artefact, entry, adjusted, interim = zip(*rows, strict=True)
        since = np.array([0 if one is None else one.toordinal() for one in adjusted])
        return cls(
            name, quantity, unit, next((limit for limit in reversed(limits) if limit is not None), None),
            np.array([one.toordinal() for one in day]), np.array(value, dtype=float), np.array(u, dtype=float),
            np.array(u_artefact, dtype=float), np.array(artefact), np.array(entry), since, np.array(interim, dtype=bool),
        )  # fmt: skip

    def where(self, chosen: NDArray[np.bool_]) -> Series:
        """Of some of the certificates alone."""
        names = ("day", "value", "u", "u_artefact", "artefact", "entry", "adjusted_since", "interim")
        return replace(self, **{name: getattr(self, name)[chosen] for name in names})


@dataclass(frozen=True, slots=True)
class ChainFinding:
    """Something that is not as it was recorded."""

    kind: str  # chain, index, file or missing: a file that is not there any more may only have been moved
    problem: str
    entry: int | None = None  # number of the entry that it is about


BY_NAME = "name:"  # what begins the key of something without a serial number
BY_PART = "part:"  # of a machine that only reports of parts name: none of the records until anything else does
PART = "part"  # command that makes these


def spelled(serial: str) -> str:
    """A serial number for comparing: NFKC, without case and blanks."""
    return "".join(unicodedata.normalize("NFKC", serial).casefold().split())


def machine_key(facts: Mapping[str, Any]) -> str:
    """By manufacturer and serial number, or by name where it has none."""
    if serial := spelled(str(facts.get("serial") or "")):
        return f"{spelled(str(facts.get('manufacturer') or ''))}/{serial}"
    return BY_NAME + spelled(str(facts.get("name") or ""))


def artefact_key(facts: Mapping[str, Any]) -> str:
    """By serial number, else by the number of its certificate, else by name; empty where none of them is given."""
    if serial := spelled(str(facts.get("serial") or "")):
        return serial
    if number := spelled(str(facts.get("certificate") or "")):
        return f"certificate:{number}"
    name = spelled(str(facts.get("name") or ""))
    return BY_NAME + name if name else ""


def called(facts: Mapping[str, Any], *names: str) -> str:
    """The first of the names under which the facts say something, as it is printed."""
    return next((text for name in names if (text := " ".join(str(facts.get(name) or "").split()))), "")
