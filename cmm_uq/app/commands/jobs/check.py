"""All that is wrong with a job, without computing.

All that is wrong with a job, without computing.

All that is wrong with a job, without computing: what its readers and its model refuse, and what an assessor would miss.

The rules are those of the commands: the same readers are asked, and go on behind a problem where they can.
"""

from __future__ import annotations

import re
import tomllib
from collections.abc import Iterable
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

from cmm_uq.analysis.conformity.standards import decidable
from cmm_uq.app.commands.model import recorded_model, refuse_unmeasured
from cmm_uq.app.commands.reading import read_job
from cmm_uq.artefacts import kind_of
from cmm_uq.base.errors import CmmUqError, Gathered
from cmm_uq.base.files.content import content_of
from cmm_uq.base.files.limits import JOB_BYTES, TABLE_BYTES
from cmm_uq.base.messages import html_table
from cmm_uq.base.plugins import naming_package
from cmm_uq.base.points import Machine
from cmm_uq.certificate.clauses import Requirement, certifies, clauses, contradictions, missing
from cmm_uq.jobs.importing.recording import read_recording
from cmm_uq.jobs.job import Job
from cmm_uq.jobs.part.job import is_part, read_part
from cmm_uq.jobs.reading import PART
from cmm_uq.jobs.source import inside
from cmm_uq.jobs.tables.origin import MEASURED
from cmm_uq.machine.physics.catalogue import effects

_PLACE = re.compile(
    r"(?P<file>.*?)(?: lines? (?P<line>\d+)(?: and \d+)?)?(?:: ?(?P<key>\[.*))?(?:, column (?P<column>.+))?", re.DOTALL
)
_KEY_BEHIND = re.compile(r"(?P<file>\S.*?\.toml) (?P<key>\[.*)", re.DOTALL)
"""Where a message names the key behind the file without a colon."""

_TABLE_KEY = re.compile(r"\[+([^\]]+)\]+ ?([\w.]*)")


@dataclass(frozen=True)
class Problem:
    """Something that is wrong with a job, or that should be known.

    problem : what it is.
    file : where it stands, if in a file.
    line : of the file, from 1.
    key : of job.toml, as ``[artefact] u_um``, or column of a recording.
    fix : how to mend it.
    """

    problem: str
    file: str = ""
    line: int | None = None
    key: str = ""
    fix: str = ""

    @classmethod
    def of(cls, error: CmmUqError) -> Problem:
        """What an error says."""
        where = error.where or ""
        found = _KEY_BEHIND.fullmatch(where) or _PLACE.fullmatch(where)
        told = {} if found is None else {name: value or "" for name, value in found.groupdict().items()}
        line = told.get("line", "")
        key = told.get("key", "") or told.get("column", "")
        return cls(error.problem, told.get("file", where), int(line) if line else None, key, error.fix or "")

    def __str__(self) -> str:
        line = f" line {self.line}" if self.line else ""
        place = ": ".join(filter(None, (f"{self.file}{line}", self.key, self.problem)))
        return f"{place}. {self.fix}" if self.fix else place

    def as_data(self) -> dict[str, Any]:
        """For results in JSON."""
        return {"file": self.file, "line": self.line, "key": self.key, "problem": self.problem, "fix": self.fix}


@dataclass(frozen=True)
class JobCheck:
    """What there is to say of a job before it is computed.

    job : its folder, or its job.toml.
    problems : that would stop the command.
    warnings : that the certificate would state, or that what stands there is not a measurement.
    clauses : of ISO/IEC 17025:2017, 7.8, with what of each the certificate will state; none where there will be none.
    command : that the job is for.
    """

    job: str
    problems: tuple[Problem, ...]
    warnings: tuple[Problem, ...]
    clauses: tuple[Requirement, ...] = ()
    command: str = "report"

    @property
    def sound(self) -> bool:
        """Whether nothing would stop the command."""
        return not self.problems

    def as_data(self) -> dict[str, Any]:
        """For results in JSON."""
        return {
            "job": self.job, "sound": self.sound, "problems": [one.as_data() for one in self.problems],
            "warnings": [one.as_data() for one in self.warnings], "iso17025": [one.data for one in self.clauses],
        }  # fmt: skip

    def __repr__(self) -> str:
        return f"<Checked {self.job}: {len(self.problems)} problems, {len(self.warnings)} warnings>"

    def _repr_html_(self) -> str:
        rows = [
            (what, str(one)) for what, each in (("problem", self.problems), ("warning", self.warnings)) for one in each
        ]
        return html_table("Check", (), rows or [("", "nothing is wrong")])


@naming_package()
def check_job(folder: Path) -> JobCheck:
    """Check a job."""
    wrong, path = Gathered(), folder if folder.suffix == ".toml" else folder / "job.toml"
    job: Job | None = None
    warnings: list[Problem] = []
    if _of_a_part(path):
        return _check_part(folder, path)
    with wrong.going_on():
        job = read_job(folder)
    if job is None:
        _parts_by_themselves(path, wrong)
    else:
        warnings = _of_a_job(job, path, wrong)
    problems = _once(Problem.of(_placed(error, path)) for error in wrong.problems)
    return JobCheck(str(folder), problems, _once(warnings), _clauses(job))


def _of_a_part(path: Path) -> bool:
    try:
        return is_part(content_of(path, JOB_BYTES, ""))
    except CmmUqError:
        return False


def _check_part(folder: Path, path: Path) -> JobCheck:
    """The job of a part: what its readers refuse, and that its figures are an example's."""
    from cmm_uq.analysis.parts.methods.of_job import lacking
    from cmm_uq.analysis.parts.setup import refuse_out_of_reach, refuse_unfit
    from cmm_uq.app.commands.parts.machine import refuse_machine

    wrong, warnings, job = Gathered(), list[Problem](), None
    with wrong.going_on():
        job = read_part(folder, machine=False)
        refuse_unfit(job)
        warnings += [
            Problem(str.__str__(said), str(path), key=f"[{table}]", fix=fix) for table, said, fix in lacking(job)
        ]
    if job is not None:
        with wrong.going_on():
            whole = read_part(folder)  # with the files that state the machine
            refuse_machine(whole, partial(refuse_out_of_reach, whole))
        if (origin := job.facts.job.origin) != MEASURED:
            said = f"the figures are {origin}, and all that is made of them says so"
            warnings.append(Problem(said, str(path), key="[job] origin", fix="Put in your own, and take origin away"))
    return JobCheck(str(folder), _once(Problem.of(error) for error in wrong.problems), tuple(warnings), command=PART)


@naming_package()
def check_read(job: Job) -> JobCheck:
    """Check a job that was read."""
    wrong, path = Gathered(), job.folder / "job.toml"
    warnings = _of_a_job(job, path, wrong)
    problems = _once(Problem.of(_placed(error, path)) for error in wrong.problems)
    return JobCheck(job.facts.job.id, problems, _once(warnings), _clauses(job))


def _clauses(job: Job | None) -> tuple[Requirement, ...]:
    return clauses(job) if job is not None and certifies(job) else ()


def _of_a_job(job: Job, path: Path, wrong: Gathered) -> list[Problem]:
    """Gather what is wrong with a job that was read; what should be known of it."""
    found: list[Problem] = []
    with wrong.going_on():
        found += _unfit(job, wrong)
    return found + _to_be_known(job, path)


def _unfit(job: Job, wrong: Gathered) -> list[Problem]:
    """Gather what the model and the standards refuse of a job that was read; what the screening found."""
    kind, facts = kind_of(job), job.facts
    refuse_unmeasured(job)
    acting = None
    with wrong.going_on():
        acting = effects(facts.model.effects, where="job.toml [model] effects")
    for i, wish in enumerate(facts.conformity, 1):
        with wrong.going_on():
            decidable(wish, kind.name, f"[[conformity]] {i}", kind.tested, job.circumstances)
    if kind.own is not None:
        kind.refuse_unfit(job)
        return []
    kind.observing("reported")
    for effect in acting or ():
        if missing := [column for column in effect.columns if column not in job.points.columns]:
            wrong.add(CmmUqError(
                f"{effect.name} needs {'the columns' if len(missing) > 1 else 'the column'} {', '.join(missing)}, which "
                f"{facts.recording.file} has not", where="job.toml [model] effects", fix="Record it, or leave out the effect",
            ))  # fmt: skip
    if wrong.problems:
        return []
    model, findings = recorded_model(job)
    with wrong.going_on():
        model.estimate()
    return [
        Problem(str(one.why), job.recording_path, one.lines[0] if one.lines else None, one.column or "")
        for one in findings
    ]


def _to_be_known(job: Job, path: Path) -> list[Problem]:
    """What the certificate would warn of, whatever was measured."""
    if job.origin != MEASURED:
        said = f"the recording is {job.origin}, and all that is made of it says so"
        return [Problem(said, str(path), key="[job] origin", fix="Put in your own readings for a certificate")]
    content = job.inputs["job.toml"].decode("utf-8-sig")
    unstated = [
        Problem(
            f"not stated: {one.asks} ({one.clause}), which ISO/IEC 17025:2017 asks for",
            str(path),
            _line_of(one.key, content),
            one.key,
            f"Give {one.key}",
        )
        for one in (missing(job) if certifies(job) else ())
    ]
    return [*(Problem(str(text), str(path)) for text in contradictions(job)), *unstated]


def _parts_by_themselves(path: Path, wrong: Gathered) -> None:
    """Gather what is wrong with recording and effects of a job whose job.toml, or another of its files, was refused."""
    try:
        data = tomllib.loads(content_of(path, JOB_BYTES, "").decode("utf-8-sig"))
    except (CmmUqError, UnicodeDecodeError, tomllib.TOMLDecodeError, RecursionError):
        return
    named, name = _value(data, "model", "effects"), _value(data, "recording", "file")
    if isinstance(named, list):
        with wrong.going_on():
            effects([name for name in named if isinstance(name, str)], where="job.toml [model] effects")
    if isinstance(name, str) and name:
        with wrong.going_on():
            found = inside(path.parent, name, str(path))
            content = content_of(found, TABLE_BYTES, f"Put it beside job.toml, or mend its name in {path}")
            read_recording(content, str(path.parent / name), Machine())


def _value(data: dict[str, Any], table: str, key: str) -> object:
    found = data.get(table)
    return found.get(key) if isinstance(found, dict) else None


def _placed(error: CmmUqError, path: Path) -> CmmUqError:
    """With the job's own path and the key's line, where a message says ``job.toml`` alone."""
    where = error.where or ""
    if not where.startswith("job.toml"):
        return error
    rest = where.removeprefix("job.toml").lstrip(": ")
    try:
        line = _line_of(rest, path.read_text(encoding="utf-8-sig"))
    except (OSError, ValueError):
        line = None
    return CmmUqError(error.problem, where=f"{path}{f' line {line}' if line else ''}: {rest}" if rest else str(path),
                      fix=error.fix)  # fmt: skip


def _line_of(key: str, text: str) -> int | None:
    """Line of a key such as ``[artefact] u_um``, or of its table."""
    from cmm_uq.base.files.toml_file import line_of

    found = _TABLE_KEY.match(key)
    if found is None:
        return None
    number = re.match(r"\[\[\w+\]\] (\d+) ?(\w*)", key)
    if number:
        return line_of([found[1], str(int(number[1]) - 1), number[2]], text)
    return line_of([*found[1].split("."), *found[2].split(".")], text)


def _once(problems: Iterable[Problem]) -> tuple[Problem, ...]:
    return tuple(dict.fromkeys(problems))
