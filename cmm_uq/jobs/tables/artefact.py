"""``[artefact]``: what every kind of measurement says of its artefact, and of the certificates that results rest on.

What follows from certificates is said in :mod:`cmm_uq.jobs.chain`.
"""

from __future__ import annotations

import datetime as dt
from calendar import monthrange
from collections.abc import Iterable, Iterator, Sequence
from typing import Annotated, Any, ClassVar, Literal, Self

import numpy as np
from pydantic import Field, PrivateAttr, model_validator

from cmm_uq.base.files.table import Column, Expansion, JobTable, Length, key, required
from cmm_uq.base.messages import Text, commas, day, names, say
from cmm_uq.base.points import Floats, Ints
from cmm_uq.base.values import dataclass
from cmm_uq.jobs.columns import in_words
from cmm_uq.jobs.importing.format import FileKeys
from cmm_uq.jobs.tables.identification import NO_DATE
from cmm_uq.jobs.tables.length_formula import Factor, Freedom, Growing, LengthUncertainty, with_standard_uncertainty


@dataclass(frozen=True)
class CertifiedValue:
    """A value of ``[artefact]`` that a digital certificate may state, and the key of its standard uncertainty, µm, if any.

    ``words``: parts of the names by which certificates call it, in small letters; ``count``: of values, of which the largest
    uncertainty is taken; ``needed``: whether a certificate without it is of no use; ``line``: of the test uncertainty, that
    its own is.
    """

    key: str
    u_key: str
    words: Sequence[str]
    count: int = 1
    needed: bool = True
    line: str = ""

    @property
    def micrometres(self) -> bool:
        """Whether it is in µm, and not in mm."""
        return self.key.endswith("_um")


LENGTH_WORDS = ("length", "distance", "länge", "abstand", "longueur", "長さ", "距離")
DIAMETER_WORDS = ("diameter", "durchmesser", "diamètre", "直径")
# in English, German, French and Japanese
FORM_WORDS = (
    "form dev", "form error", "formabweichung", "roundness", "sphericity", "rundheit", "circularité", "真球度",
)  # fmt: skip
LENGTH = CertifiedValue("length_mm", "u_um", LENGTH_WORDS)
DIAMETER = CertifiedValue("length_mm", "u_um", DIAMETER_WORDS)


NATIONAL, ACCREDITED, OTHER, IN_HOUSE = "national institute", "accredited", "not accredited", "in-house"
MATERIAL, CONSENSUS = "reference material", "consensus"
Issuer = Literal["national institute", "accredited", "not accredited", "in-house", "reference material", "consensus"]
Arrangement = Literal["CIPM MRA", "ILAC MRA", "AFRAC MRA", "APAC MRA", "ARAC MRA", "EA MLA", "IAAC MLA"]
CIPM: Arrangement = "CIPM MRA"
"""The arrangement of national institutes; the others are those of accreditation bodies, of ILAC or recognised by it."""


class Traceability(JobTable):
    """A certificate of the artefact, the short gauge or a thermometer."""

    number: str = key("", "Number of the certificate, for the statement of traceability.")
    laboratory: str = key("", "Who issued the certificate.")
    machine: str = ""
    """Measuring machine that the artefact was certified on, by its name or serial number: the machine that it tests
    is warned of."""
    date: dt.date | None = key(None, "Date of the certificate.")
    due: dt.date | None = None
    """Last day on which the calibration holds, by the laboratory that uses it; `interval_months` may stand for it."""
    interval_months: Annotated[int, Field(ge=1, le=600)] | None = None
    """How long the calibration holds from its date, in months, by the laboratory that uses it."""
    issuer: Issuer | None = None
    """What the issuer is: `national institute`, `accredited`, `not accredited`, `in-house` (the laboratory itself),
    `reference material` (its producer) or `consensus`."""
    accreditation: str = key("", "Number of the issuer's accreditation.")
    accredited_by: str = key("", "Body that accredited the issuer.")
    arrangement: Arrangement | None = None
    """What covers this calibration: `CIPM MRA` of a national institute; of an accredited laboratory the arrangement that its
    accreditation body has signed, as `ILAC MRA` or `EA MLA`."""
    evidence: str = ""
    """Evidence of the issuer's competence that the laboratory holds, where no arrangement covers the calibration."""

    def problems(self) -> Iterator[str]:
        if self.due is not None and self.interval_months is not None:
            yield "due and interval_months both say until when the calibration holds: give one of them"
        if self.arrangement is not None and (self.arrangement == CIPM) != (self.issuer == NATIONAL):
            yield (
                f'arrangement = "{self.arrangement}" does not fit issuer = "{self.issuer or ""}": the CIPM MRA covers '
                "national institutes, the others accredited laboratories"
            )

    @property
    def until(self) -> dt.date | None:
        """Last day on which the calibration holds; the last of the month where a month has no such day."""
        if self.interval_months is None or self.date is None:
            return self.due
        years, month = divmod(self.date.month - 1 + self.interval_months, 12)
        year = min(self.date.year + years, dt.MAXYEAR)
        return dt.date(year, month + 1, min(self.date.day, monthrange(year, month + 1)[1]))

    def denials(self, measured: dt.date, table: str) -> Iterator[tuple[Text, str]]:
        """What of its dates denies that the calibration held on the day of a measurement, and which key says so."""
        date, until, on = self.date, self.until, day(measured)
        if measured == NO_DATE:
            if date is not None or until is not None:
                yield say("the day of the measurement is not stated"), "[job] date"
        elif date is not None and date > measured:
            after = say("the certificate is dated {date}, after the measurement of {day}", date=day(date), day=on)
            yield after, f"{table} date"
        if until is not None and NO_DATE != measured > until:
            due = say("the calibration was due on {due}, before the measurement of {day}", due=day(until), day=on)
            yield due, f"{table} due"
        elif date is not None and until is not None and until < date:
            yield say("the calibration was due before the certificate was issued"), f"{table} due"


class ThermometerFacts(JobTable):
    """``[[thermometer]]``: a thermometer that recorded temperatures were read from."""

    columns: Annotated[list[Column], Field(min_length=1, max_length=50)] = ["temp_artefact_c"]
    """Columns of the recording that it gave."""
    name: str = key("", "Name of the thermometer on the certificate.")
    serial: str = key("", "Serial number of the thermometer.")
    certificate: Traceability = Traceability.left_out("The thermometer's own certificate.")

    def called(self, columns: Iterable[str]) -> Text:
        """By its name and serial number, or by the columns of a recording that it gave."""
        if named := commas(names(filter(None, (self.name, self.serial)))):
            return say("thermometer {named}", named=named)
        return nameless(columns)


def nameless(columns: Iterable[str]) -> Text:
    return say("thermometer of the {column}", column=commas(map(in_words, columns)))


class CertificateFile(FileKeys, Traceability):
    """The artefact's own certificate, and the file that its certified values are read from."""

    file: str | None = None
    """File of what is certified. A DCC (XML) gives number, laboratory, dates and certified values with their uncertainty, of
    every kind; a CSV or a workbook the distances or places of points by their number, which the recording then has not."""


class ArtefactFacts(JobTable):
    """``[artefact]``: what every kind of measurement has; a kind with more keys has a table of its own.

    ``U_um`` with ``k`` or ``degrees_of_freedom`` may stand for ``u_um``, which is then filled in.
    Without ``length_mm`` the artefact is uncalibrated, unless its certified figures stand in the recording.
    """

    with_references: ClassVar[bool] = False
    with_recording: ClassVar[bool] = True
    with_earlier: ClassVar[bool] = False
    carries_probe: ClassVar[bool] = False
    form_key: ClassVar[str | None] = None
    certified_values: ClassVar[tuple[CertifiedValue, ...]] = (LENGTH,)

    kind: str = required("What kind of measurement it is; the further keys of the table depend on it.")
    name: str = key("", "Name of the artefact on the certificate.")
    serial: str = key("", "Serial number of the artefact.")
    length_mm: Length | None = None
    """Certified length at 20 °C, of a sphere its diameter; left out for an artefact that is not calibrated."""
    u_um: LengthUncertainty | None = None
    """Standard uncertainty (k = 1) of every certified length of the artefact, a number or a formula of the length as
    `"0.1 + 0.25·L/1000"`; `U_um` with `k` may stand for it."""
    U_um: LengthUncertainty | None = None
    """Expanded uncertainty as the artefact's certificate states it, in place of `u_um`: a number, or a formula of the length
    as `"0.2 + 0.5·L/1000"` or `"Q[0.2; 0.5·L/1000]"`, L in mm; needs `k` or `degrees_of_freedom`."""
    k: Factor | None = None
    """Coverage factor of `U_um`, or of a column `reference_U_um`. Above 2 and without `degrees_of_freedom` it is taken as
    Student's t for 95 %, but 2.58 and 3, which are of a normal distribution."""
    degrees_of_freedom: Freedom | None = None
    """Effective degrees of freedom by the certificate; without `k` the factor is Student's t for 95 % by them. Figures and
    decisions take u of the normal distribution with the same 95 % interval."""
    cte_per_k: Expansion = 0.0
    """Coefficient of thermal expansion of the artefact, 1/K; its recorded temperature `temp_artefact_c` is corrected
    by it."""
    certificate: CertificateFile | None = None
    """The artefact's own certificate, that the results are traceable by."""

    @model_validator(mode="before")
    @classmethod
    def _expanded(cls, data: Any) -> Any:
        return with_standard_uncertainty(data, columns=cls.with_references)

    def problems(self) -> Iterator[str]:
        if self.degrees_of_freedom is not None and self.u_um is None and not self.with_references:
            yield "degrees_of_freedom is given without an uncertainty: give U_um or u_um too, or leave it out"
        if self.u_um is not None and self.length_mm is None and not self.with_references:
            yield "u_um is given without length_mm: give both, or neither for an uncalibrated artefact"

    def u_of(self, lengths_mm: Floats | float) -> Floats:
        """Standard uncertainty of certified lengths, µm, as stated for them; 0 where nothing is."""
        if isinstance(self.u_um, Growing):
            return self.u_um.at(lengths_mm)
        return np.full(np.shape(lengths_mm), self.u_um or 0.0)

    @property
    def certified(self) -> bool:
        """Whether lengths can be compared with it."""
        return self.length_mm is not None

    @property
    def nominal_only(self) -> bool:
        """Whether the job says that nothing of it is certified."""
        return False

    @property
    def traced(self) -> bool:
        """Whether what is found rests on something of it that is certified, and so on its certificate."""
        return self.certified


class UncertifiedFacts(ArtefactFacts):
    """Nothing of what is measured is certified."""

    certified_values: ClassVar[tuple[CertifiedValue, ...]] = ()

    @property
    def traced(self) -> bool:
        return False


class ReferencedFacts(ArtefactFacts):
    """``[artefact]`` of a kind whose certified figures stand in the recording.

    ``nominal`` says that those figures are nominal only: their common scale then stays free.
    """

    with_references: ClassVar[bool] = True

    nominal: bool = False
    """Whether the references in the recording are nominal only: their common scale then stays free."""

    _largest_um: float | None = PrivateAttr(default=None)
    _covariances: tuple[tuple[int, ...], tuple[Floats, ...]] = PrivateAttr(default=((), ()))

    def with_largest(self, u_um: float) -> Self:
        """The same, of whose points by themselves at most this is stated: it holds for points of which nothing is."""
        copy = self.model_copy()
        copy._largest_um = u_um
        return copy

    @property
    def of_other_points(self) -> Self:
        """What is stated of points of which nothing is stated by themselves, as those of a plan."""
        by_points = self.u_um is None and self._largest_um is not None
        return self.model_copy(update={"u_um": self._largest_um}) if by_points else self

    def with_covariances(self, numbers: Sequence[int], covariances: Sequence[Floats]) -> Self:
        """The same with covariances (f, f) µm² of its points, for the distances, or for each coordinate."""
        copy = self.model_copy()
        copy._covariances = tuple(numbers), tuple(covariances)
        return copy

    def covariances_at(self, numbers: Ints) -> tuple[Ints, tuple[Floats, ...]]:
        """Which certified points those of some numbers (n,) are, and covariances (f, f) µm²; none where one is another."""
        places = {number: i for i, number in enumerate(self._covariances[0])}
        if not places or not set(numbers.tolist()) <= places.keys():
            return np.zeros(0, dtype=np.int64), ()
        index = np.array([places[number] for number in numbers.tolist()], dtype=np.int64)
        return index, self._covariances[1]

    def problems(self) -> Iterator[str]:
        yield from super().problems()
        if self.nominal and (self.u_um is not None or self.length_mm is not None):
            yield "nominal = true says that the recording's references are not certified: leave out length_mm and u_um"

    @property
    def certified(self) -> bool:
        """Whether lengths can be compared with it."""
        return not self.nominal

    @property
    def nominal_only(self) -> bool:
        return self.nominal
