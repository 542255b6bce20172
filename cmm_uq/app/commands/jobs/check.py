"""All that is wrong with a job, without computing: what its readers and its model refuse, and what an assessor would miss.

The rules are those of the commands: the same readers are asked, and go on behind a problem where they can.
"""

from __future__ import annotations

import contextlib
import re
import tomllib
from collections.abc import Sequence
from functools import partial
from pathlib import Path
from typing import Any

from cmm_uq.analysis.conformity.plans import Condition
from cmm_uq.analysis.conformity.standards import decidable
from cmm_uq.app.commands.estimation import decision
from cmm_uq.app.commands.model import recorded_model, refuse_unmeasured
from cmm_uq.app.commands.reading import read_job
from cmm_uq.artefacts import kind_of
from cmm_uq.base.errors import CmmUqError, Gathered
from cmm_uq.base.files.limits import JOB_BYTES, TABLE_BYTES, content_of
from cmm_uq.base.files.toml_file import line_of
from cmm_uq.base.messages import Text, html_table
from cmm_uq.base.plugins import naming_package
from cmm_uq.base.points import Machine
from cmm_uq.base.values import dataclass, replace
from cmm_uq.certificate.clauses import Requirement, certifies, clauses, contradictions, missing
from cmm_uq.jobs.importing.format import SAME_PLACE, ImportKeys
from cmm_uq.jobs.job import Job
from cmm_uq.jobs.reading import PART, is_part
from cmm_uq.jobs.recording.own import is_own, read_recording
from cmm_uq.jobs.source import inside
from cmm_uq.jobs.tables.identification import MEASURED
from cmm_uq.machine.physics.catalogue import effects
from cmm_uq.machine.physics.stated import with_own_physics

_PLACE = re.compile(
    r"(?P<file>.*?)(?: lines? (?P<line>\d+)(?: and \d+)?)?(?:: ?(?P<key>\[.*))?(?:, column (?P<column>.+))?", re.DOTALL
)
_KEY_BEHIND = re.compile(r"(?P<file>\S.*?\.toml) (?P<key>\[.*)", re.DOTALL)
"""Where a message names the key behind the file without a colon."""

_NOT_STATED, _LACKS = "not stated: ", " will be no complete test, for it lacks "
_ROWS = (".csv", ".txt", ".tsv")  # of a file whose lines are rows
_TABLE_KEY = re.compile(r"\[+([^\]]+)\]+ ?([\w.]*)")


@dataclass(frozen=True)
class Lack:
    """What a statement of conformity lacks of its standard's test, by which it cannot be a pass."""

    statement: str
    what: Text
    condition: Condition


@dataclass(frozen=True)
class Problem:
    """What is wrong with a job or should be known, where it stands, and how to mend it.

    ``line``: of the file, from 1; ``key``: of job.toml, as ``[artefact] u_um``, or column of a recording; ``unstated``:
    whether it is what a certificate asks for; ``lack``: what a statement of conformity lacks.
    """

    problem: str
    file: str = ""
    line: int | None = None
    key: str = ""
    fix: str = ""
    unstated: bool = False
    lack: Lack | None = None

    @classmethod
    def of(cls, error: CmmUqError) -> Problem:
        where = error.where or ""
        match = _KEY_BEHIND.fullmatch(where) or _PLACE.fullmatch(where)
        parts = {} if match is None else {name: value or "" for name, value in match.groupdict().items()}
        line, key = parts.get("line"), parts.get("key") or parts.get("column", "")
        return cls(error.problem, parts.get("file", where), int(line) if line else None, key, error.fix or "")

    def __str__(self) -> str:
        line = f" line {self.line}" if self.line else ""
        place = ": ".join(filter(None, (f"{self.file}{line}", self.key, self.problem)))
        return f"{place}. {self.fix}" if self.fix else place

    def as_data(self) -> dict[str, Any]:
        return {name: getattr(self, name) for name in ("file", "line", "key", "problem", "fix")}


def in_lines(problems: Sequence[Problem]) -> tuple[str, ...]:
    """Each in a line; in one those that say the same of several rows of a file, and what a certificate lacks."""
    together: dict[object, list[Problem]] = {}
    for one in problems:
        alike: object = one
        if one.unstated:
            alike = one.file
        elif one.lack:
            alike = (one.key, one.lack.statement)
        elif one.line and one.file.endswith(_ROWS):
            alike = (one.file, one.key, re.sub(r"'[^']*'|[\d.]+", "…", one.problem), one.fix)
        together.setdefault(alike, []).append(one)
    return tuple(
        str(replace(each[0], problem=_lacking_together(lacks)))
        if (lacks := [one.lack for one in each if one.lack])
        else str(each[0])
        if len(each) == 1
        else _not_stated(alike, each)
        if isinstance(alike, str)
        else _of_rows(each)
        for alike, each in together.items()
    )


def _not_stated(file: str, every: Sequence[Problem]) -> str:
    tables: dict[str, list[str]] = {}
    for one in every:
        table, _, key = one.key.partition(" ")
        tables.setdefault(table, []).append(key)
    keys = "; ".join(f"{table} {', '.join(dict.fromkeys(keys))}" for table, keys in tables.items())
    fix = "Give them for a certificate; cmm-uq check JOB --clauses says what each is"
    return str(Problem(f"{_NOT_STATED}what ISO/IEC 17025:2017, 7.8 asks for: {keys}", file, fix=fix))


def _lacking_together(every: Sequence[Lack]) -> str:
    """What one statement lacks, the lines of its uncertainty with their keys as one."""
    whole = [str.__str__(one.what) for one in every if not one.condition.key]
    if unstated := [one.condition for one in every if one.condition.key]:
        named, keys = ", ".join(str.__str__(one.line) for one in unstated), ", ".join(one.key for one in unstated)
        place = "in [test_uncertainty], or declared in [test_uncertainty.negligible]"
        whole.append(f"uncertainty of {named} ({keys} {place})")
    return f"{every[0].statement}{_LACKS}{'; '.join(whole)}"


def _of_rows(every: Sequence[Problem]) -> str:
    first = every[0]
    lines = sorted({one.line or 0 for one in every})
    starts = [line for line in lines if line - 1 not in lines]
    ends = [line for line in lines if line + 1 not in lines]
    spans = (f"{a}" if a == b else f"{a}–{b}" for a, b in zip(starts, ends, strict=True))
    where = f"{first.file} lines {', '.join(spans)}"
    others = "" if len({one.problem for one in every}) == 1 else f", and {len(every) - 1} more alike"
    return str(replace(first, file=where, line=None, problem=f"{first.problem}{others}"))


@dataclass(frozen=True)
class JobCheck:
    """What there is to say of a job before it is computed.

    ``problems``: that would stop the command that it is for; ``warnings``: that the certificate would state; ``clauses``: of
    ISO/IEC 17025:2017, 7.8, with what of each the certificate will state; none where there will be none.
    """

    job: str
    problems: tuple[Problem, ...]
    warnings: tuple[Problem, ...]
    clauses: tuple[Requirement, ...] = ()
    command: str = "report"

    @property
    def sound(self) -> bool:
        return not self.problems

    @property
    def lines(self) -> tuple[tuple[str, ...], tuple[str, ...]]:
        """Problems and warnings for a person."""
        return in_lines(self.problems), in_lines(self.warnings)

    def as_data(self) -> dict[str, Any]:
        return {
            "job": self.job, "sound": self.sound, "problems": [one.as_data() for one in self.problems],
            "warnings": [one.as_data() for one in self.warnings], "iso17025": [one.data for one in self.clauses],
        }  # fmt: skip

    def __repr__(self) -> str:
        return f"<Checked {self.job}: {len(self.problems)} problems, {len(self.warnings)} warnings>"

    def _repr_html_(self) -> str:
        each = (*(("problem", str(one)) for one in self.problems), *(("warning", str(one)) for one in self.warnings))
        return html_table("Check", (), each or [("", "nothing is wrong")])


@naming_package()
def check_job(folder: Path) -> JobCheck:
    wrong, path = Gathered(), folder if folder.suffix == ".toml" else folder / "job.toml"
    job, of_part = None, False
    with contextlib.suppress(CmmUqError):
        of_part = is_part(content_of(path, JOB_BYTES, ""))
    if of_part:
        return _check_part(folder, path)
    with wrong.going_on():
        job = read_job(folder)
    if job is None:
        _parts_by_themselves(path, wrong)
    return _checked(str(folder), job, path, wrong)


@naming_package()
def check_read(job: Job) -> JobCheck:
    return _checked(job.facts.job.id, job, job.folder / "job.toml", Gathered())


def _checked(name: str, job: Job | None, path: Path, wrong: Gathered) -> JobCheck:
    warnings: list[Problem] = []
    if job is not None:
        with wrong.going_on():
            warnings += _unfit(job, wrong)
        warnings += _to_be_known(job, path)
    requirements = clauses(job) if job is not None and certifies(job) else ()
    problems = dict.fromkeys(Problem.of(_placed(error, path)) for error in wrong.problems)
    return JobCheck(name, tuple(problems), tuple(dict.fromkeys(warnings)), requirements)


def _check_part(folder: Path, path: Path) -> JobCheck:
    """The job of a part: what its readers refuse, and that its figures are an example's."""
    from cmm_uq.analysis.parts.methods.of_job import lacking
    from cmm_uq.analysis.parts.reported import measured_of
    from cmm_uq.analysis.parts.setup import refuse_out_of_reach, refuse_unfit
    from cmm_uq.app.commands.parts.machine import refuse_machine
    from cmm_uq.jobs.part.job import read_part

    wrong, warnings, job = Gathered(), list[Problem](), None
    with wrong.going_on():
        job = read_part(folder, machine=False)
        refuse_unfit(job)
        told_of_values = measured_of(job).warnings
        told = ((str.__str__(text), f"[{table}]", fix) for table, text, fix in lacking(job))
        warnings += [Problem(text, str(path), key=key, fix=fix) for text, key, fix in told]
        warnings += [Problem(str.__str__(text), str(path), key="[recording] values") for text in told_of_values]
    if job is not None:
        with wrong.going_on():
            whole = read_part(folder)  # with the files that state the machine
            refuse_machine(whole, partial(refuse_out_of_reach, whole))
        if (origin := job.facts.job.origin) != MEASURED:
            text = f"the figures are {origin}, and all that is made of them says so"
            warnings.append(Problem(text, str(path), key="[job] origin", fix="Put in your own, and take origin away"))
    problems = dict.fromkeys(map(Problem.of, wrong.problems))
    return JobCheck(str(folder), tuple(problems), tuple(warnings), command=PART)


@with_own_physics
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
    undecided = list[Problem]()
    for i, wish in enumerate(facts.conformity, 1):
        with wrong.going_on():
            found = decision(job, model, findings, i)
            by, file = f"{wish.standard} {found.characteristic}", str(job.folder / "job.toml")
            for what, condition in zip(found.missing_with_remedies, found.conditions, strict=True):
                text = f"{by}{_LACKS}{str.__str__(what)}"
                undecided.append(Problem(text, file, key=f"[[conformity]] {i}", lack=Lack(by, what, condition)))
    if job.further:
        from cmm_uq.app.commands.certificates.further import further_certificates, verify_further

        with wrong.going_on():
            further_certificates(job, job, verify_further(job))
    lines = ((one, one.lines[0] if one.lines else None) for one in findings)
    return undecided + [Problem(str(one.why), job.recording_path, line, one.column or "") for one, line in lines]


def _to_be_known(job: Job, path: Path) -> list[Problem]:
    if job.origin != MEASURED:
        said = f"the recording is {job.origin}, and all that is made of it says so"
        return [Problem(said, str(path), key="[job] origin", fix="Put in your own readings for a certificate")]
    content = job.inputs["job.toml"].decode("utf-8-sig")
    problems = [Problem(str(text), str(path)) for text in contradictions(job)]
    for fact in (fact for read in job.imported for fact in read.facts if fact.key == SAME_PLACE):
        said = f"{str.__str__(fact.label)[0].lower()}{str.__str__(fact.label)[1:]}: {str.__str__(fact.value)}"
        problems.append(Problem(said, str(path), key="[recording] lines", fix="Say where each lies, if they differ"))
    if kind_of(job).tested and not job.facts.conformity:
        said = "nothing will be decided: no standard and no limit is stated"
        fix = "Give both, where more is wanted than a calibration"
        problems.append(Problem(said, str(path), key="[[conformity]] standard", fix=fix))
    for one in missing(job) if certifies(job) else ():
        text = f"{_NOT_STATED}{one.asks} ({one.clause}), which ISO/IEC 17025:2017 asks for"
        problems.append(Problem(text, str(path), _line_of(one.key, content), one.key, f"Give {one.key}", unstated=True))
    return problems


def _parts_by_themselves(path: Path, wrong: Gathered) -> None:
    """Gather what is wrong with recording and effects of a job whose job.toml, or another of its files, was refused."""
    try:
        data = tomllib.loads(content_of(path, JOB_BYTES, "").decode("utf-8-sig"))
    except (CmmUqError, UnicodeDecodeError, tomllib.TOMLDecodeError, RecursionError):
        return
    tables = [table if isinstance(table := data.get(title), dict) else {} for title in ("model", "recording")]
    entries = data.get("effect")
    stated = [one.get("name") for one in entries if isinstance(one, dict)] if isinstance(entries, list) else []
    if isinstance(named := tables[0].get("effects"), list):
        with wrong.going_on():
            others = [name for name in named if isinstance(name, str) and name not in stated]
            effects(others, where="job.toml [model] effects")
    if isinstance(name := tables[1].get("file"), str) and name:
        with wrong.going_on():
            found = inside(path.parent, name, str(path))
            content = content_of(found, TABLE_BYTES, f"Put it beside job.toml, or mend its name in {path}")
            if (
                is_own(content) and not tables[1].keys() & ImportKeys.model_fields.keys()
            ):  # an export needs what was refused
                read_recording(content, str(path.parent / name), Machine())


def _placed(error: CmmUqError, path: Path) -> CmmUqError:
    """With the job's own path and the key's line, where a message says ``job.toml`` alone."""
    where = error.where or ""
    if not where.startswith("job.toml"):
        return error
    rest, line = where.removeprefix("job.toml").lstrip(": "), None
    with contextlib.suppress(OSError, ValueError):
        line = _line_of(rest, path.read_text(encoding="utf-8-sig"))
    return CmmUqError(error.problem, where=f"{path}{f' line {line}' if line else ''}: {rest}" if rest else str(path),
                      fix=error.fix)  # fmt: skip


def _line_of(key: str, text: str) -> int | None:
    """Line of a key such as ``[artefact] u_um``, or of its table."""
    found, entry = _TABLE_KEY.match(key), re.match(r"\[\[\w+\]\] (\d+) ?(\w*)", key)
    if found is None:
        return None
    if entry:
        return line_of([found[1], str(int(entry[1]) - 1), entry[2]], text)
    return line_of([*found[1].split("."), *found[2].split(".")], text)
