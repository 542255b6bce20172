"""What a verification found: what stands wrong and where, what could not be checked and why, and the verdict of all."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import asdict, dataclass, field
from typing import Any, Literal

from cmm_uq.base.errors import CmmUqError

Word = Literal["VERIFIED", "NOT VERIFIED", "NOT WHOLLY CHECKED"]
LONGEST = 160  # characters of what stands somewhere, as it is shown


@dataclass(frozen=True)
class VerificationFinding:
    """Something that is not as it must be."""

    check: str  # of CHECKS
    file: str
    place: str  # page, JSON path, XPath, attachment, byte; empty for the file as a whole
    problem: str
    stands: str = ""
    should: str = ""

    def __str__(self) -> str:
        where = ": ".join(filter(None, (self.file, self.place)))
        against = f": “{self.stands}” instead of “{self.should}”" if self.stands or self.should else ""
        return f"{where}: {self.problem}{against}"


@dataclass(frozen=True)
class Unchecked:
    """Something that was not checked, and why."""

    what: str
    why: str

    def __str__(self) -> str:
        return f"{self.what}: {self.why}"


AGAIN = "computing again"
NOT_ASKED = "not asked for (--no-rerun)"
CHECKS = {  # what each check makes sure of
    "files": "the files are what cmm-uq writes, with nothing active, hidden or further in them",
    "signatures": "signatures are intact and cover the whole file; whom one must trust for them is trusted, or named above",
    "forms": "results.json, the digital certificate and its page are those of the PDF and the HTML",
    "figures": "the figures of results.json agree with each other",
    "decisions": "decisions follow from figures, uncertainties, limits and rules",
    "inputs": "inputs are those whose hashes results.json has",
    "dates": "artefacts were in date, and dates are in order",
    "records": "the records have the entry that the certificate states, and the certificate",
    "again": "computed again from the inputs, everything is the same",
}


@dataclass
class Inquiry:
    """A verification under way; ``done`` how many things each check compared."""

    findings: list[VerificationFinding] = field(default_factory=list)
    unchecked: list[Unchecked] = field(default_factory=list)
    notes: list[str] = field(default_factory=list)
    done: dict[str, int] = field(default_factory=dict)

    def wrong(self, check: str, file: str, place: str, problem: str, stands: object = "", should: object = "") -> None:
        """Keep a finding; what stands there is shortened."""
        self.findings.append(VerificationFinding(check, file, place, problem, _shown(stands), _shown(should)))

    def looked(self, check: str, count: int = 1) -> None:
        """Something was compared, and whatever was wrong with it is kept."""
        self.done[check] = self.done.get(check, 0) + count

    def compare(self, check: str, file: str, place: str, problem: str, stands: object, should: object) -> None:
        """Look at a thing, and keep it where it is not what it should be."""
        self.looked(check)
        if stands != should:
            self.wrong(check, file, place, problem, stands, should)

    def left(self, what: str, why: str) -> None:
        """Keep what was not checked, each thing once."""
        if (thing := Unchecked(what, why)) not in self.unchecked:
            self.unchecked.append(thing)

    @contextmanager
    def reading(self, check: str, file: str) -> Iterator[None]:
        """Parts of a file that may be missing, or be of another form: then that is what is wrong."""
        try:
            yield
        except (KeyError, TypeError, ValueError, AttributeError, IndexError, CmmUqError) as error:
            self.wrong(check, file, "", f"has not the parts that cmm-uq writes ({type(error).__name__}: {error})")

    @property
    def word(self) -> Word:
        """The verdict."""
        if self.findings:
            return "NOT VERIFIED"
        return "NOT WHOLLY CHECKED" if self.unchecked else "VERIFIED"

    def as_data(self) -> dict[str, Any]:
        """For JSON."""
        return {
            "verdict": self.word,
            "findings": [{key: text or None for key, text in asdict(finding).items()} for finding in self.findings],
            "not_checked": [asdict(thing) for thing in self.unchecked],
            "notes": self.notes,
            "checked": {name: self.done.get(name, 0) for name in CHECKS},
        }


def _shown(value: object) -> str:
    """What stands somewhere, short enough for a line."""
    text = value if isinstance(value, str) else "" if value is None else repr(value)
    return text if len(text) <= LONGEST else f"{text[: LONGEST - 1]}…"
