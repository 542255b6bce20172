"""Jobs of the root folder: the list, one job with its files, a report under way, and its certificate with what to do next."""

from __future__ import annotations

import datetime as dt
import json
import re
import tomllib
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from cmm_uq.app.desk.export_pages import DESK_CELL, READ, check_blocks, facts_form, steps
from cmm_uq.app.desk.place import Draft, sha256
from cmm_uq.app.desk.workers import ReportRun
from cmm_uq.app.serve import page as p
from cmm_uq.app.serve.exchange import DESK
from cmm_uq.base.errors import CmmUqError
from cmm_uq.base.files.limits import JOB_BYTES, TABLE_BYTES, content_of
from cmm_uq.base.messages import NOTHING, Text, Verbatim, number, say
from cmm_uq.base.output.manifest import plain_name

JOB, RUN, CANCEL, CERTIFICATE, FILE = (f"{DESK}/{name}" for name in ("job", "run", "cancel", "certificate", "file"))
PART, POINTS, DELETE, EVENTS = (f"{DESK}/{name}" for name in ("part", "points", "delete", "events"))
PLAN, VERIFY = f"{DESK}/plan", f"{DESK}/verify"
FIELD, FACTS = f"{DESK}/field.json", f"{DESK}/facts"
RESULTS, REPORTS = "results.json", "reports"
MOST_FILES, LISTED = 100, 200
_ID = re.compile(r"[A-Za-z0-9_-][A-Za-z0-9._-]{0,99}")


@dataclass(frozen=True)
class JobState:
    """A job's folder as it is; ``decision`` and ``made`` of its certificate, ``current``: whether its inputs are the same."""

    name: str  # path below the root
    id: str
    machine: str = ""
    part: bool = False
    decision: str | None = None
    made: dt.datetime | None = None
    current: bool = False
    checked: Text = NOTHING  # what check said of it as it is
    files: tuple[str, ...] = ()  # of the certificate, by path below the root

    @property
    def standing(self) -> p.Cell:
        if self.made is None:
            return p.Cell(say("No certificate yet"), note=self.checked)
        when = say("of {day}", day=Verbatim(self.made.strftime("%Y-%m-%d %H:%M")))
        if not self.current:
            return p.Cell(say("Certificate, and changed since"), standing="open", note=when)
        word, standing = p.DECISIONS.get(self.decision or "none", (Verbatim(self.decision or ""), "open"))
        return p.Cell(word, standing=standing, note=when)

    def file(self, ending: str) -> str:
        """The certificate's file of an ending; empty where there is none."""
        return next((one for one in self.files if one.endswith(ending) and "manifest" not in one), "")


def state_of(root: Path, folder: Path) -> JobState:
    name = folder.relative_to(root).as_posix()
    content, data = b"", dict[str, Any]()
    try:
        content = content_of(folder / "job.toml", JOB_BYTES, "")
        data = tomllib.loads(content.decode("utf-8-sig"))
    except (CmmUqError, ValueError, RecursionError):
        return JobState(name, "")
    named = {}
    for table, key in (("job", "id"), ("machine", "name")):
        keys = data.get(table)
        named[table] = str(keys.get(key, "")) if isinstance(keys, dict) else ""
    own, of = named["job"], named["machine"]
    part = isinstance(data.get("part"), dict)
    of = of or (str(data["part"].get("name", "")) if part else "")
    report = root / REPORTS / own
    if not _ID.fullmatch(own) or not (report / RESULTS).is_file() or report.is_symlink():
        return JobState(name, own, of, part)
    try:
        results = json.loads(content_of(report / RESULTS, TABLE_BYTES, ""))
        inputs = {name: one for name, one in results["job"]["inputs_sha256"].items() if plain_name(name)}
        current = all(sha256(content_of(folder / one, TABLE_BYTES, "")) == same for one, same in inputs.items())
        decision = str((results.get("verdicts") or {}).get("overall", "none"))
    except (CmmUqError, ValueError, KeyError, TypeError, AttributeError, RecursionError):
        current, decision = False, "none"
    made = dt.datetime.fromtimestamp((report / RESULTS).stat().st_mtime)
    files = tuple(
        f"{REPORTS}/{own}/{path.name}" for path in sorted(report.iterdir()) if path.is_file() and path.name[0] != "."
    )
    return JobState(name, own, of, part, decision, made, current, NOTHING, files)


def home_page(root: Path, jobs: Iterable[JobState], drafts: Iterable[Draft], count: int) -> p.WebPage:
    rows = []
    for one in jobs:
        result = p.Cell(say("Certificate"), p.address(CERTIFICATE, name=one.name)) if one.made else p.Cell(NOTHING)
        rows.append(
            (
                p.Cell(Verbatim(one.name), p.address(JOB, name=one.name)),
                p.Cell(p.shown(one.machine)),
                one.standing,
                result,
            )
        )
    headings = p.columns(say("Job"), say("Machine"), say("State"), say("Result"))
    more = (say("The newest {shown} of {count}.", shown=LISTED, count=count),) if count > LISTED else ()
    none = say("No job lies here yet: drop an export.")
    table = p.PageTable(say("Jobs"), headings, tuple(rows), none, more, heard=True)
    begun = tuple(p.Cell(Verbatim(one.name), p.address(PART if one.part else READ, draft=one.id)) for one in drafts)
    formats = say("CSV, text, .xlsx, .ods, PC-DMIS, Calypso, DMIS, QIF, I++: as the measuring program wrote it")
    hint = say("{formats}; at most {most} MB.", formats=formats, most=number(TABLE_BYTES.most // 2**20))
    drop = p.Drop(f"{DESK}/drop", say("Drop an export here, or choose one"), hint, say("Read it"))
    notices = (p.PageNotice(say("Begun, and no job yet"), "open", begun),) if begun else ()
    part = p.Cell(say("Its plan, the certificate of the machine, and its points"), PART)
    received = p.Cell(say("Verify it: who says what, what it rests on, and whether it holds"), VERIFY)
    sections = (
        *p.section(say("Jobs in this folder"), table),
        *p.section(say("A part"), p.Links((part,))),
        *p.section(say("A certificate that you received"), p.Links((received,))),
    )
    return p.WebPage(say("Desk"), DESK, Verbatim(str(root)), (drop, *notices), sections)


def job_page(
    root: Path, one: JobState, check: Mapping[str, Any], text: str, seen: str, above: tuple[p.Block, ...] = ()
) -> p.WebPage:
    """One job: what check says, its job.toml to be changed, its files."""
    rows: list[tuple[p.Cell, ...]] = []
    for path in sorted((root / one.name).rglob("*")):
        name = path.relative_to(root).as_posix()
        if path.is_file() and "/." not in f"/{name}" and len(rows) < MOST_FILES:
            size = say("{bytes} bytes", bytes=number(path.stat().st_size, ",d"))
            rows.append((p.Cell(Verbatim(name), p.address(FILE, at=name)), p.Cell(size)))
    files = p.PageTable(say("Files of the job"), p.columns(say("File"), say("Size")), tuple(rows), heard=True)
    name_field = (("name", one.name),)
    blocks = [*above]
    if one.made:
        look = p.Cell(say("Look at it"), p.address(CERTIFICATE, name=one.name))
        blocks.append(
            p.PageNotice(say("There is a certificate"), "good" if one.current else "open", (one.standing, look))
        )
    blocks += check_blocks(check)
    if check.get("sound"):
        blocks.append(p.PageForm(RUN, (), (("run", say("Make the certificate")),), name_field))
    if one.part:
        hint = say("CSV with feature, point, x_mm, y_mm, z_mm, in the frame of the part; job.toml then names it.")
        blocks.append(
            p.Drop(p.address(POINTS, name=one.name), say("Drop the measured points here"), hint, say("Take them"))
        )
    buttons = (("save", say("Save")), ("check", say("Check")))
    entry = p.FormEntry("text", say("job.toml"), text, "area")
    edit = p.PageForm(JOB, (entry,), buttons, (*name_field, ("seen", seen)), check=f"{DESK}/check")
    commands = f"cmm-uq check {one.name}\ncmm-uq {'part' if one.part else 'report'} {one.name}"
    change = () if one.part else (p.Links((p.Cell(say("Change it by fields"), p.address(FACTS, name=one.name)),)),)
    sections = (
        *p.section(say("What it states"), *change, edit),
        *p.section(say("Its files"), files),
        *p.section(say("The same by commands"), p.SourceText(say("Commands"), commands)),
    )
    title, lead = Verbatim(one.id or one.name), p.shown(one.machine)
    return p.WebPage(title, DESK, lead, tuple(blocks), sections, (DESK_CELL,))


def facts_page(
    name: str, found: Mapping[str, Any], values: Mapping[str, str], seen: str, above: tuple[p.Block, ...]
) -> p.WebPage:
    """What a job states, by fields; what else stands in its job.toml stays as it is."""
    buttons = (("save", say("Save")), ("check", say("Check")))
    form = facts_form(FACTS, found["fields"], values, buttons, (("name", name), ("seen", seen)))
    lead = say("What is left empty is not stated. All else in job.toml stays as it is.")
    places = (DESK_CELL, p.Cell(Verbatim(name), p.address(JOB, name=name)))
    return p.WebPage(say("What the job states"), DESK, lead, (*above, form), above=places)


def differing(found: Mapping[str, Any], values: Mapping[str, str]) -> p.PageNotice:
    """Fields that are another in the file by now than they were typed."""
    labels = {one["key"]: one["label"] for one in found["fields"]}
    lines = [
        f"{labels[key]}: {now or '(empty)'} in the file, {values.get(key, '') or '(empty)'} here"
        for key, now in found["values"].items()
        if now != values.get(key, "").strip()
    ]
    head = say("Not written: it was changed meanwhile, by another tab, an editor or a command")
    return p.PageNotice(head, "bad", p.lines_of(lines))


def run_page(run: ReportRun) -> p.WebPage:
    name = (("name", run.job),)
    again = p.PageForm(RUN, (), (("run", say("Begin again")),), name)
    blocks: tuple[p.Block, ...]
    if run.cancelled:
        blocks = (p.PageNotice(say("Cancelled: nothing was written"), "open"), again)
    elif run.problem is not None:
        where, problem, fix = run.problem
        blocks = (p.PageNotice(Verbatim(problem), "bad", p.lines_of(filter(None, (where, fix)))), again)
    else:
        under_way = p.Running(p.address(EVENTS, name=run.job), Verbatim(run.what), round(100 * run.part))
        blocks = (steps(4), under_way, p.PageForm(CANCEL, (), (("cancel", say("Cancel")),), name))
    above = (DESK_CELL, p.Cell(Verbatim(run.job), p.address(JOB, name=run.job)))
    return p.WebPage(say("Certificate under way"), DESK, Verbatim(run.job), blocks, above=above)


def certificate_page(one: JobState, said: Mapping[str, Any], field: bool, warnings: Iterable[str]) -> p.WebPage:
    """The certificate, its diagnosis, the residual field, and what to do next."""
    word, standing = p.DECISIONS.get(said["overall"], (Verbatim(said["overall"]), "open"))
    lines = tuple(p.Cell(_decided(*each[:-1])) for each in said["decided"])
    lacking = [p.PageNotice(Verbatim(each[0]), "open", p.lines_of(each[-1])) for each in said["decided"] if each[-1]]
    blocks = [p.PageNotice(word if lines else say("It states no conformity"), standing or "good", lines)]
    if not one.current:
        blocks.insert(0, p.PageNotice(say("The job was changed since: make the certificate again"), "open"))
    pdf, page = one.file(".pdf"), one.file(".html")
    links = [p.Cell(say("Open the PDF"), p.address(FILE, at=pdf))] if pdf else []
    for label, path in (("PDF", pdf), ("HTML", page), (RESULTS, one.file(RESULTS)), ("DCC", one.file(".xml"))):
        if path:
            keep = say("{name} to keep", name=Verbatim(label))
            links.append(p.Cell(keep, p.address(FILE, at=path, keep="yes"), download=True))
    diagnosis = [_said(each) for each in said["diagnosis"]]
    if field:
        told = say("Residuals as vectors in the volume; the certificate has them as pictures.")
        diagnosis.append(p.Turnable(p.address(FIELD, name=one.name), told))
    frame = (p.SandboxFrame(say("Certificate"), p.address(FILE, at=page)),) if page else ()
    sections = (
        *p.section(say("What to do next"), *next_steps(one, said, warnings)),
        *p.section(say("What a complete test lacks"), *lacking),
        *p.section(say("Diagnosis"), *diagnosis),
        *p.section(say("The certificate"), *frame),
    )
    title, above = (
        say("Certificate {number}", number=Verbatim(one.id)),
        p.Cell(Verbatim(one.name), p.address(JOB, name=one.name)),
    )
    return p.WebPage(title, DESK, p.shown(one.machine), (*blocks, p.Links(tuple(links))), sections, (DESK_CELL, above))


def _decided(by: str, outcome: str, value: Any, expanded: Any, limit: Any, unit: str) -> Text:
    told = say("{by}: {word:small}", by=Verbatim(by), word=p.DECISIONS.get(outcome, (Verbatim(outcome), None))[0])
    for text, figure, digits in (("", value, ".3g"), (" against", limit, ".3g"), (", U =", expanded, ".2g")):
        if not isinstance(figure, int | float):
            return told
        lead = Verbatim(text or ";")
        told = say(
            "{told}{lead} {figure} {unit}", told=told, lead=lead, figure=number(figure, digits), unit=Verbatim(unit)
        )
    return told


def _said(block: list[Any]) -> p.Block:
    """A block of a diagnosis as the worker gives it."""
    if block[0] == "fact":
        return p.PageFacts(((Verbatim(block[1]), p.Cell(Verbatim(block[2]), standing=block[3])),))
    if block[0] == "table":
        rows = tuple(tuple(p.Cell(Verbatim(text)) for text in row) for row in block[3])
        return p.PageTable(Verbatim(block[1]), p.columns(*map(Verbatim, block[2])), rows)
    return p.PageParagraph(Verbatim(block[1]))


def next_steps(one: JobState, said: Mapping[str, Any], warnings: Iterable[str]) -> tuple[p.Block, ...]:
    steps: list[Text] = []
    lacking = [text for text in warnings if "not stated" in text]
    if "simulated" in Path(one.file(".html")).name:
        steps.append(say("The readings are simulated: put in your own recording before anybody relies on it."))
    if said["overall"] in ("fail", "conditional fail"):
        steps.append(
            say("The machine does not conform: what the diagnosis names is to be looked at first, then measured again.")
        )
    if said["overall"] in ("incomplete", "undecided"):
        steps.append(say("The test is not complete or not decided: what is missing stands below."))
    steps += [Verbatim(text) for text in lacking]
    steps.append(
        say(
            "Release it, after somebody else has looked at it, with the command below; then the customer gets PDF and DCC."
        )
    )
    shown: list[p.Block] = [p.PageParagraph(text) for text in steps]
    release = f"cmm-uq release {one.id} --by 'NAME' --reason 'checked against the recording'"
    shown.append(p.SourceText(say("Command"), release))
    shown.append(
        p.Links((p.Cell(say("This machine and its history"), "/"), p.Cell(say("All certificates"), "/certificates")))
    )
    return tuple(shown)
