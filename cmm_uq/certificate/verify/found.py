"""What a verification found: what stands wrong and where, what could not be checked and why, and the verdict of all."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from typing import Any, Literal

from cmm_uq.base.errors import CmmUqError

Word = Literal["VERIFIED", "NOT VERIFIED", "NOT WHOLLY CHECKED"]
LONGEST = 160  # characters of what stands somewhere, as it is shown


@dataclass(frozen=True)
class VerificationFinding:
    """Something that is not as it must be.

    ``check`` that found it, one of :data:`CHECKS`; ``file`` that it is in; ``place`` in the file: page, JSON path,
    XPath, attachment, byte; empty where it is the file as a whole; ``problem`` in words; ``stands``, ``should`` what
    stands there, and what should; empty where the words say it.
    """

    check: str
    file: str
    place: str
    problem: str
    stands: str = ""
    should: str = ""

    def as_data(self) -> dict[str, Any]:
        """For JSON."""
        return {
            "check": self.check, "file": self.file, "place": self.place or None, "problem": self.problem,
            "stands": self.stands or None, "should": self.should or None,
        }  # fmt: skip

    def __str__(self) -> str:
        where = ": ".join(filter(None, (self.file, self.place)))
        against = f": “{self.stands}” instead of “{self.should}”" if self.stands or self.should else ""
        return f"{where}: {self.problem}{against}"


@dataclass(frozen=True)
class Unchecked:
    """Something that was not checked.

    ``what`` it is; ``why`` not.
    """

    what: str
    why: str

    def __str__(self) -> str:
        return f"{self.what}: {self.why}"


AGAIN, NOT_ASKED = "computing again", "not asked for (--no-rerun)"
"""What is left where the inputs are not computed again, and why where nobody wished it."""

CHECKS = {
    "files": "the files are what cmm-uq writes, with nothing active, hidden or further in them",
    "signatures": "signatures are intact and cover the whole file; whom one must trust for them is trusted, or named above",
    "forms": "PDF, XML, HTML and results.json say the same",
    "figures": "the documents state the figures of results.json, and these agree with each other",
    "decisions": "decisions follow from figures, uncertainties, limits and rules",
    "inputs": "inputs are those whose hashes results.json has",
    "dates": "artefacts were in date, and dates are in order",
    "again": "computed again from the inputs, everything is the same",
}
"""What each check makes sure of."""


@dataclass
class Inquiry:
    """A verification under way: what it has found so far.

    ``findings`` what is wrong; ``unchecked`` what could not be looked at; ``notes`` what the reader must know besides;
    ``done`` how many things each check compared.
    """

    findings: list[VerificationFinding] = field(default_factory=list)
    unchecked: list[Unchecked] = field(default_factory=list)
    notes: list[str] = field(default_factory=list)
    done: dict[str, int] = field(default_factory=dict)

    def wrong(self, check: str, file: str, place: str, problem: str, stands: object = "", should: object = "") -> None:
        """Keep a finding; what stands there is shortened."""
        self.findings.append(VerificationFinding(check, file, place, problem, shown(stands), shown(should)))

    def looked(self, check: str, count: int = 1) -> None:
        """Something was compared, and whatever was wrong with it is kept."""
        self.done[check] = self.done.get(check, 0) + count

    def left(self, what: str, why: str) -> None:
        """Keep what was not checked, each thing once."""
        one = Unchecked(what, why)
        if one not in self.unchecked:
            self.unchecked.append(one)

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
            "findings": [one.as_data() for one in self.findings],
            "not_checked": [{"what": one.what, "why": one.why} for one in self.unchecked],
            "notes": self.notes,
            "checked": {name: self.done.get(name, 0) for name in CHECKS},
        }


def shown(value: object) -> str:
    """What stands somewhere, short enough for a line."""
    text = value if isinstance(value, str) else "" if value is None else repr(value)
    return text if len(text) <= LONGEST else f"{text[: LONGEST - 1]}…"
