"""``[job]`` and ``[laboratory]``: where the recording comes from, id and date, whose it is, and who answers for it.

The commands that derive a recording write its mark into job.toml. That it was taken away shows where a hash or a line still
tells: the first line of the recording, and the manifest beside it.
"""

from __future__ import annotations

import datetime as dt
import re
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Annotated, Final, Literal

from pydantic import Field

from cmm_uq.base.errors import CmmUqError, Gathered
from cmm_uq.base.files.table import Divisor, JobTable, Limit, key, required
from cmm_uq.base.languages.translation import ENGLISH, Code
from cmm_uq.base.output import MANIFEST, read_manifest
from cmm_uq.jobs.source import device_name, sha256

NO_DATE = dt.date(1970, 1, 1)  # of a job that says none: the clock is never read

Origin = Literal["measured", "simulated", "compensated"]
MEASURED: Final = "measured"
SIMULATED: Final = "simulated"
COMPENSATED: Final = "compensated"
# commands that write a recording, and what they make of it
DERIVING: Mapping[str, Origin] = {"simulate": SIMULATED, "compensate": COMPENSATED}
_WRITTEN = re.compile(rb"\A(?:\xef\xbb\xbf)?(?:#[^\n]*\n)*?# (simulated|compensated) by cmm-uq ")
# first line of the recording that a plan writes for the operator to fill in
PLANNED = "# planned, nothing is measured yet: nominal coordinates\n"
_PLANNED = re.compile(rb"\A(?:\xef\xbb\xbf)?(?:#[^\n]*\n)*?# planned, nothing is measured yet")
EXAMPLE = "EXAMPLE"  # first word behind a figure of a new job.toml that nobody has stated yet
_EXAMPLE = re.compile(r"[ \t]*([A-Za-z_]+)[ \t]*=.*# EXAMPLE\b")
Digest = Annotated[str, Field(pattern=r"^[0-9a-f]{64}$")]


class DerivedFrom(JobTable):
    """``derived_from``: the job that a recording was made from, by what, and SHA-256 of what went in and came out.

    ``inputs``: of the files of that job; ``files``: of the recording and of what else was written with it (the truth, the
    error maps), which belong to this job and are attached to its documents.
    """

    job: str = required("Id of the job that the recording was made from.")
    by: Literal["simulate", "compensate"] = required("Command that made it.")
    program: str = required("Program and version that made it.")
    inputs: dict[str, Digest] = required("SHA-256 of each file of that job.")
    files: dict[str, Digest] = required("SHA-256 of each file that was written with the recording.")


def first_line(by: str, program: str, how: str) -> str:
    """The line that a derived recording begins with."""
    return f"# {DERIVING[by]} by {program}{how}\n"


def check_mark(folder: Path, origin: str, recording: bytes, where: str) -> None:
    """That a recording which was derived says so."""
    if origin != MEASURED:
        return
    manifest = read_manifest(folder)
    if mark := _WRITTEN.match(recording):
        made, problem, place = mark[1].decode(), "was", f"{where} line 1"
    elif manifest is not None and manifest.owner.command in DERIVING:
        made, problem, place = DERIVING[manifest.owner.command], "the recording was", str(folder / MANIFEST)
    else:
        return
    fix = f'Write origin = "{made}" in [job]'
    raise CmmUqError(f"{problem} {made}, and job.toml says measured", where=place, fix=fix)


def check_examples(toml: bytes, origin: str, where: str) -> None:
    """That no figure of an example is taken for one of a machine or an artefact that was measured."""
    if origin != MEASURED:
        return
    wrong = Gathered()
    for number, line in enumerate(toml.decode("utf-8-sig").splitlines(), 1):
        if found := _EXAMPLE.match(line):
            wrong.tell(f"{found[1]} is still an example's", where=f"{where} line {number}",
                       fix=f"Put in your own, or leave it out, and take the word {EXAMPLE} away")  # fmt: skip
    wrong.refuse()


def is_planned(recording: bytes) -> bool:
    """Whether a recording is a plan's, with nominal coordinates."""
    return _PLANNED.match(recording) is not None


def altered(derived: DerivedFrom | None, inputs: Mapping[str, bytes]) -> tuple[str, ...]:
    """Names of files that were changed after a command wrote them."""
    if derived is None:
        return ()
    hashes = sha256(inputs)
    return tuple(name for name, digest in derived.files.items() if hashes.get(name, digest) != digest)


RequiredText = Annotated[str, Field(min_length=1, pattern=r"\S")]  # words that must not be left out

# results of the certificate that is replaced, as the records have them: an input, so that anybody can compare again
REPLACED = "replaced-results.json"
_FIGURES = r"(?:figures?|values?|results?|numbers?|decisions?|outcomes?)"
_WERTE = r"(?:(?:mess|zahlen)?werte?n?|zahl(?:en)?|ergebnis(?:se)?n?|entscheidung(?:en)?)"
_VALEURS = r"(?:valeurs?|chiffres?|résultats?|décisions?)"
_NOTHING_CHANGED = (
    rf"\bno (?:other |measured |further )?{_FIGURES}\b|\bnone of the {_FIGURES}\b|\b{_FIGURES}: none\b"
    rf"|\bnothing (?:else )?(?:is |was |has |has been )?chang|\bno (?:other |further )?changes?\b"
    rf"|\bwithout (?:any )?changes?\b|\b{_FIGURES}\b[^.;]{{0,30}}\b(?:unchanged|unaltered|unaffected|the same|not (?:been )?"
    rf"(?:changed|affected|altered))|\bunchanged {_FIGURES}\b"
    rf"|\bkeine?n? (?:anderen? |weiteren? )?{_WERTE}\b|\bkeine änderung|\bohne änderung|\bnichts (?:hat sich )?geändert"
    rf"|\b{_WERTE}\b[^.;]{{0,30}}\b(?:unverändert|nicht (?:geändert|verändert|betroffen)|gleich geblieben|bleiben gleich)"
    rf"|\bunveränderte[nr]? {_WERTE}\b"
    rf"|\baucune? (?:autre )?{_VALEURS}\b|\baucun changement|\baucune modification|\bsans (?:changement|modification)"
    rf"|\brien n['’ ]?a changé|\b{_VALEURS}\b[^.;]{{0,30}}\b(?:inchangée?s?|ne changent pas|n['’]ont pas changé)"
    r"|変更(?:は|が)?(?:な[しい]|ありません|ございません)|(?:数値|結果|値|判定)[^。;]{0,12}"
    r"(?:不変|変わらない|変わりません|変わっていない|変わっていません|変わりな[しい]|変更な[しい]|同じ|変更されていない|変更していない)"
)
"""The usual ways, in the languages of certificates, of saying that figures or decisions did not change."""


class ReplacedCertificate(JobTable):
    """The certificate that this one replaces, why, and what changed."""

    number: RequiredText = required("Number of the certificate that is replaced.")
    date: dt.date = required("Its date of issue.")
    reason: RequiredText = required("Why it is replaced.")
    changed: RequiredText = required("What is changed in this certificate against it (7.8.8.1).")
    figures_changed: bool | None = None
    """Whether a figure or a decision is changed against it; `false` is refused where one is."""
    results: str | None = None
    """`results.json` of the certificate that is replaced, or the folder with it inside the job's, where no records have it."""

    def problems(self) -> Iterator[str]:
        if self.figures_changed and self.denies_in_words:
            yield f"figures_changed = true, and changed = {self.changed!r} says that none is: say in changed which are"

    @property
    def denies_in_words(self) -> bool:
        """Whether its words say that no figure is changed."""
        return denies_a_change(self.changed)

    @property
    def denies(self) -> bool:
        """Whether it says that no figure is changed."""
        return self.figures_changed is False or self.denies_in_words


def denies_a_change(words: str) -> bool:
    """Whether words say that no figure, or nothing, is changed."""
    return re.search(_NOTHING_CHANGED, " ".join(words.split()), re.IGNORECASE) is not None


class Identification(JobTable):
    """Identification, and free text for the certificate."""

    id: Annotated[str, Field(pattern=r"^[A-Za-z0-9._-]+$", max_length=100)]
    """Name of the job and of the folder its reports go to: letters, digits, `.`, `_` and `-`."""
    date: dt.date = required("Date of the measurement.")
    number: str = key("", "Number of the certificate; the id where it is left out.")
    replaces: ReplacedCertificate | None = None
    """The certificate that this one replaces (7.8.8), in a table of its own."""
    issued: dt.date | None = key(None, "Date on which the certificate is issued (ISO/IEC 17025:2017, 7.8.2.1 j).")
    customer: str = key("", "Name of the customer (7.8.2.1 e).")
    address: str = key("", "How to reach the customer (7.8.2.1 e).")
    place: str = key("", "Where the measurement was made (7.8.2.1 c).")
    operator: str = key("", "Who measured.")
    procedure: str = key("", "The method of the measurement (7.8.2.1 f).")
    order: str = key("", "Number of the customer's order.")
    conditions: str = key("", "Conditions that influence the results, in words (7.8.4.1 b).")
    received: dt.date | None = None
    """Day on which the item was received, where that matters for the results (7.8.2.1 h)."""
    deviations: str = key("", "Additions to, deviations from and exclusions from the method (7.8.2.1 n).")
    external: str = key("", "Results that external providers gave, and who they are (7.8.2.1 p).")
    from_customer: str = ""
    """Data that the customer gave and the results may rest on; the certificate says that they are the customer's (7.8.2.2)."""
    remarks: str = key("", "Free text of the certificate.")
    language: Code = ENGLISH
    """Language of the documents: `en`, `de`, `fr` or `ja`; files for programs stay English."""

    def problems(self) -> Iterator[str]:
        if self.replaces is not None and self.replaces.number == (self.number or self.id):
            yield (
                f"replaces.number = {self.replaces.number!r} is the number of this certificate itself: give the new one "
                "a number of its own"
            )
        if set(self.id) == {"."}:
            yield "must name a folder of its own, so it cannot consist of dots"
        if device_name(self.id):
            yield "must name a folder of its own, and Windows takes this name for a device"


_LENGTHS = {"mm": 1e-3, "µm": 1.0}  # units of lengths, and how many of each a micrometre is
_RATIOS, _ANGLES = ("ppm", "µm/m"), ("″",)


class LengthCapability(JobTable):
    """U = A + L/K of a length, L in mm and U in µm; without ``k`` the same for every length."""

    a_um: Limit = required("A of U = A + L/K.")
    k: Divisor | None = None
    """K of U = A + L/K, with L in mm and U in µm; without it U is the same for every length."""


class Capability(JobTable):
    """``[laboratory.cmc]``: calibration and measurement capability, the least U (95 %, k = 2) that a certificate may state."""

    length: LengthCapability | None = key(None, "Least U of what is stated in mm or µm.")
    scale_ppm: Limit | None = key(None, "Least U of what is stated in ppm or µm/m.")
    angle_arcsec: Limit | None = key(None, "Least U of what is stated in ″.")

    def least(self, unit: str, length_mm: float) -> float:
        """The least U of a quantity in its own unit; 0 where none is given for it."""
        if unit in _LENGTHS and self.length is not None:
            per_length = length_mm / self.length.k if self.length.k else 0.0
            return (self.length.a_um + per_length) * _LENGTHS[unit]
        if unit in _RATIOS:
            return self.scale_ppm or 0.0
        return (self.angle_arcsec or 0.0) if unit in _ANGLES else 0.0


class Laboratory(JobTable):
    """``[laboratory]``: who answers for the certificate."""

    name: str = key("", "Name of the laboratory (7.8.2.1 b).")
    address: str = key("", "Address of the laboratory (7.8.2.1 b).")
    country: Annotated[str, Field(pattern=r"^([A-Z]{2})?$")] = ""
    """Country of the laboratory, two capital letters of ISO 3166-1; the digital certificate asks for it."""
    accreditation: str = key("", "Accreditation as it is printed, with its number.")
    signatory: str = key("", "Who authorises the certificate (7.8.2.1 o).")
    signatory_role: str = key("", "Function of who authorises it.")
    logo: str = key("", "File of its logo, SVG or PNG, beside job.toml: it stands at the head of certificates.")
    four_eyes: bool = False
    """Whether two persons, neither of them the operator, must release a certificate before it is released."""
    cmc: Capability | None = None
    """Calibration and measurement capability: the least U (95 %, k = 2) that a certificate may state."""
