"""What records are asked for: machines, artefacts, certificates with their values, series; and by what they are recognised."""

from __future__ import annotations

import datetime as dt
import unicodedata
from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

STATES = ("draft", "released", "withdrawn", "replaced")  # states of a certificate
STANDING = ("draft", "released")  # states of a certificate that counts: neither withdrawn nor replaced
PERFORMANCE = "performance:"  # with which the name of a value begins that a standard decided on


@dataclass(frozen=True, slots=True)
class RecordedMachine:
    """A machine.

    ``serial``: by which it is asked for; its name where it has no serial number. Of two machines with one serial
    number the second has its manufacturer behind it; ``name, manufacturer, model, place``: as its newest certificate
    has them; ``adjusted``: days on which it was adjusted, sorted; ``by_name``: whether it has no serial number and is
    recognised by its name; ``calibrate``: ``[machine] calibrate`` of its newest certificate; ``None`` where the job
    has none.
    """

    serial: str
    name: str
    manufacturer: str
    model: str
    place: str
    adjusted: tuple[dt.date, ...] = ()
    by_name: bool = False
    calibrate: Mapping[str, Any] | None = None


@dataclass(frozen=True, slots=True)
class ArtefactRow:
    """An artefact, with its newest certificate.

    ``serial``: its serial number, or the number of its certificate, or its name; ``kind``: of the measurement it was
    last used in; ``calibrated, due``: days of that.
    """

    serial: str
    kind: str
    certificate: str
    laboratory: str
    calibrated: dt.date | None
    due: dt.date | None


@dataclass(frozen=True, slots=True)
class RecordedValue:
    """One error factor, size or figure of performance of one certificate.

    ``name``: ``scale_x.ppm``, ``artefact.length_mm``, ``accuracy.b89_range_um``, ``performance:E0``; ``quantity``:
    how it is called in the field, as printed; ``lower, upper``: the stated 95 % interval; ``u_artefact``: part of
    ``u`` that comes from what is certified of the artefact, common to certificates made with the same artefact; 0
    where it is unknown; ``limit``: the value conforms while its amount is no larger; ``None`` where none is set.
    """

    name: str
    quantity: str
    unit: str
    value: float
    u: float
    lower: float
    upper: float
    u_artefact: float = 0.0
    limit: float | None = None


@dataclass(frozen=True, slots=True)
class RecordedCertificate:
    """One certificate, interim check or diagnosis as recorded.

    ``artefact``: serial of the artefact; empty where the job says nothing of it; ``adjusted_since``: last adjustment
    of the machine before the recording, as the job or an entry says; ``decision``: the worst of its statements of
    conformity, in the words of results.json; ``none`` where it states none; ``diagnosis``: verdict of the diagnosis;
    empty where there is none; ``interim``: whether it is an interim check and no certificate; ``folder``: where its
    files are; ``version``: of the package that made it; ``command``: that made it: report or diagnose;
    ``artefact_due``: day by which the artefact was to be calibrated again, as the job said; ``covariance``: names,
    and lower triangle row by row, of what is stated with one.
    """

    entry: int
    job: str
    machine: str
    artefact: str
    kind: str
    origin: str
    day: dt.date
    recorded: dt.datetime
    adjusted_since: dt.date | None
    state: str
    decision: str
    diagnosis: str
    interim: bool
    folder: str
    version: str
    results_sha256: str
    number: str
    command: str
    artefact_due: dt.date | None = None
    values: tuple[RecordedValue, ...] = ()
    covariance: tuple[tuple[str, ...], tuple[float, ...]] | None = None

    @property
    def artefact_overdue(self) -> bool:
        """Whether the artefact was due for calibration before the day of the measurement: it must not be released."""
        return self.artefact_due is not None and self.artefact_due < self.day


@dataclass(frozen=True, slots=True)
class ReleaseSignature:
    """Who released, withdrew or replaced a certificate."""

    entry: int
    certificate: int
    what: str
    by: str
    reason: str
    at: dt.datetime
    replaced_by: int | None = None


@dataclass(frozen=True, slots=True)
class Series:
    """One value of one machine over its certificates and interim checks, by day; each array is (n,).

    ``limit``: that the newest certificate with one sets; ``day``: of the measurement, proleptic Gregorian ordinal;
    ``adjusted_since``: day of the last adjustment before, ordinal; 0 where none is known; ``interim``: whether it is
    of an interim check.
    """

    name: str
    quantity: str
    unit: str
    limit: float | None
    day: NDArray[np.int64]
    value: NDArray[np.float64]
    u: NDArray[np.float64]
    u_artefact: NDArray[np.float64]
    artefact: NDArray[np.str_]
    entry: NDArray[np.int64]
    adjusted_since: NDArray[np.int64]
    interim: NDArray[np.bool_]


@dataclass(frozen=True, slots=True)
class ChainFinding:
    """Something that is not as it was recorded.

    ``kind``: chain, index, file or missing: a file that is not there any more may only have been moved; ``entry``:
    number of the entry that it is about.
    """

    kind: str
    problem: str
    entry: int | None = None


BY_NAME = "name:"  # what begins the key of something without a serial number


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
