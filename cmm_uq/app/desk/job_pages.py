"""Jobs of the root folder: the list, one job with its files, a report under way, and its certificate with what to do next."""

from __future__ import annotations

import datetime as dt
import json
import tomllib
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from cmm_uq.app.desk.drafts import Draft
from cmm_uq.app.desk.export_pages import READ, check_blocks, steps
from cmm_uq.app.desk.place import sha256
from cmm_uq.app.desk.verify_page import VERIFY
from cmm_uq.app.desk.workers import ReportRun
from cmm_uq.app.serve import page as p
from cmm_uq.app.serve.page import (
    DECISIONS,
    Block,
    Cell,
    FormEntry,
    PageForm,
    PageNotice,
    PageParagraph,
    PageTable,
    WebPage,
    address,
)
from cmm_uq.app.serve.rendering import DESK
from cmm_uq.base.errors import CmmUqError
from cmm_uq.base.files.content import content_of
from cmm_uq.base.files.limits import JOB_BYTES, TABLE_BYTES
from cmm_uq.base.messages import NOTHING, Text, Verbatim, number, say

JOB, RUN, CANCEL, CERTIFICATE, FILE = (f"{DESK}/{name}" for name in ("job", "run", "cancel", "certificate", "file"))
PART, POINTS, DELETE = f"{DESK}/part", f"{DESK}/points", f"{DESK}/delete"
RESULTS, REPORTS = "results.json", "reports"
MOST_FILES = 100


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
    files: tuple[str, ...] = ()  # of the certificate, by path below the root

    @property
    def standing(self) -> Cell:
        if self.made is None:
            return Cell(say("No certificate yet"))
        when = say("of {day}", day=Verbatim(self.made.strftime("%Y-%m-%d %H:%M")))
        if not self.current:
            return Cell(say("Certificate, and changed since"), standing="open", note=when)
        word, standing = DECISIONS.get(self.decision or "none", (Verbatim(self.decision or ""), "open"))
        return Cell(word, standing=standing, note=when)

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
    if not own or "/" in own or own[0] == "." or not (report / RESULTS).is_file() or report.is_symlink():
        return JobState(name, own, of, part)
    try:
        results = json.loads(content_of(report / RESULTS, TABLE_BYTES, ""))
        inputs = results["job"]["inputs_sha256"]
        current = all(sha256(content_of(folder / one, TABLE_BYTES, "")) == digest for one, digest in inputs.items())
        decision = str((results.get("verdicts") or {}).get("overall", "none"))
    except (CmmUqError, ValueError, KeyError, TypeError, AttributeError):
        current, decision = False, "none"
    made = dt.datetime.fromtimestamp((report / RESULTS).stat().st_mtime)
    files = tuple(
        f"{REPORTS}/{own}/{path.name}" for path in sorted(report.iterdir()) if path.is_file() and path.name[0] != "."
    )
    return JobState(name, own, of, part, decision, made, current, files)


def home_page(root: Path, jobs: Iterable[JobState], drafts: Iterable[Draft]) -> WebPage:
    rows = tuple(
        (
            Cell(Verbatim(one.name), address(JOB, name=one.name)),
            Cell(p.shown(one.machine)),
            one.standing,
            Cell(say("Certificate"), address(CERTIFICATE, name=one.name)) if one.made else Cell(NOTHING),
        )
        for one in jobs
    )
    headings = p.columns(say("Job"), say("Machine"), say("State"), say("Result"))
    begun = tuple(Cell(Verbatim(one.name), address(PART if one.part else READ, draft=one.id)) for one in drafts)
    hint = say(
        "CSV, text, .xlsx, .ods, PC-DMIS, Calypso, DMIS, QIF, I++: as the measuring program wrote it; at most {most} MB.",
        most=number(TABLE_BYTES.most // 2**20),
    )
    return WebPage(
        say("Desk"),
        DESK,
        lead=Verbatim(str(root)),
        blocks=(
            p.Drop(f"{DESK}/drop", say("Drop an export here, or choose one"), hint, say("Read it")),
            *((PageNotice(say("Begun, and no job yet"), "open", begun),) if begun else ()),
        ),
        sections=(
            (
                say("Jobs in this folder"),
                (PageTable(say("Jobs"), headings, rows, say("No job lies here yet: drop an export."), heard=True),),
            ),
            (say("A part"), (p.Links((Cell(say("Its plan, the certificate of the machine, and its points"), PART),)),)),
            (
                say("A certificate that you received"),
                (p.Links((Cell(say("Verify it: who says what, what it rests on, and whether it holds"), VERIFY),)),),
            ),
        ),
    )


def job_page(
    root: Path, one: JobState, check: Mapping[str, Any], text: str, seen: str, above: tuple[Block, ...] = ()
) -> WebPage:
    """One job: what check says, its job.toml to be changed, its files."""
    folder = root / one.name
    names = [
        path.relative_to(root).as_posix()
        for path in sorted(folder.rglob("*"))
        if path.is_file() and not any(part[0] == "." for part in path.relative_to(root).parts)
    ][:MOST_FILES]
    rows = tuple(
        (
            Cell(Verbatim(name), address(FILE, at=name)),
            Cell(say("{bytes} bytes", bytes=number((root / name).stat().st_size, ",d"))),
        )
        for name in names
    )
    command = "part" if one.part else "report"
    make = PageForm(RUN, (), (("run", say("Make the certificate")),), (("name", one.name),))
    made = (
        (
            PageNotice(
                say("There is a certificate"),
                "good" if one.current else "open",
                (one.standing, Cell(say("Look at it"), address(CERTIFICATE, name=one.name))),
            ),
        )
        if one.made
        else ()
    )
    hint = say("CSV with feature, point, x_mm, y_mm, z_mm, in the frame of the part; job.toml then names it.")
    points = p.Drop(address(POINTS, name=one.name), say("Drop the measured points here"), hint, say("Take them"))
    edit = PageForm(
        JOB,
        (FormEntry("text", say("job.toml"), text, "area"),),
        (("save", say("Save")), ("check", say("Check"))),
        (("name", one.name), ("seen", seen)),
        check=f"{DESK}/check",
    )
    return WebPage(
        Verbatim(one.id or one.name),
        DESK,
        lead=p.shown(one.machine),
        above=(Cell(say("Desk"), DESK),),
        blocks=(
            *above,
            *made,
            *check_blocks(check),
            *((make,) if check.get("sound") else ()),
            *((points,) if one.part else ()),
        ),
        sections=(
            (say("What it states"), (edit,)),
            (
                say("Its files"),
                (PageTable(say("Files of the job"), p.columns(say("File"), say("Size")), rows, heard=True),),
            ),
            (
                say("The same by commands"),
                (p.SourceText(say("Commands"), f"cmm-uq check {one.name}\ncmm-uq {command} {one.name}"),),
            ),
        ),
    )


def run_page(run: ReportRun) -> WebPage:
    above, name = (Cell(say("Desk"), DESK), Cell(Verbatim(run.job), address(JOB, name=run.job))), (("name", run.job),)
    again = PageForm(RUN, (), (("run", say("Begin again")),), name)
    blocks: tuple[Block, ...]
    if run.cancelled:
        blocks = (PageNotice(say("Cancelled: nothing was written"), "open"), again)
    elif run.problem is not None:
        where, problem, fix = run.problem
        lines = tuple(Cell(Verbatim(one)) for one in (where, fix) if one)
        blocks = (PageNotice(Verbatim(problem), "bad", lines), again)
    else:
        stop = PageForm(CANCEL, (), (("cancel", say("Cancel")),), name)
        blocks = (
            steps(4),
            p.Running(address(f"{DESK}/events", name=run.job), Verbatim(run.what), round(100 * run.part)),
            stop,
        )
    return WebPage(say("Certificate under way"), DESK, lead=Verbatim(run.job), above=above, blocks=blocks)


def certificate_page(one: JobState, said: Mapping[str, Any], field: bool, warnings: Iterable[str]) -> WebPage:
    """The certificate, its diagnosis, the residual field, and what to do next."""
    word, standing = DECISIONS.get(said["overall"], (Verbatim(said["overall"]), "open"))
    lines = tuple(Cell(_decided(*each[:-1])) for each in said["decided"])
    lacking = tuple(
        PageNotice(Verbatim(each[0]), "open", tuple(Cell(Verbatim(str(what))) for what in each[-1]))
        for each in said["decided"]
        if each[-1]
    )
    head = PageNotice(word if said["decided"] else say("It states no conformity"), standing or "good", lines)
    changed = () if one.current else (PageNotice(say("The job was changed since: make the certificate again"), "open"),)
    names = (
        ("PDF", one.file(".pdf")),
        ("HTML", one.file(".html")),
        (RESULTS, one.file(RESULTS)),
        ("DCC", one.file(".xml")),
    )
    kept = tuple(
        Cell(say("{name} to keep", name=Verbatim(label)), address(FILE, at=path, keep="yes"), download=True)
        for label, path in names
        if path
    )
    look = (Cell(say("Open the PDF"), address(FILE, at=one.file(".pdf"))),) if one.file(".pdf") else ()
    diagnosis = tuple(_said(each) for each in said["diagnosis"])
    turning = (
        (
            p.Turnable(
                address(f"{DESK}/field.json", name=one.name),
                say("Residuals as vectors in the volume; the certificate has them as pictures."),
            ),
        )
        if field
        else ()
    )
    page = one.file(".html")
    return WebPage(
        say("Certificate {number}", number=Verbatim(one.id)),
        DESK,
        lead=p.shown(one.machine),
        above=(Cell(say("Desk"), DESK), Cell(Verbatim(one.name), address(JOB, name=one.name))),
        blocks=(*changed, head, p.Links((*look, *kept))),
        sections=(
            (say("What to do next"), next_steps(one, said, warnings)),
            *(((say("What a complete test lacks"), lacking),) if lacking else ()),
            *(((say("Diagnosis"), (*diagnosis, *turning)),) if diagnosis or turning else ()),
            *(
                ((say("The certificate"), (p.SandboxFrame(say("Certificate"), address(FILE, at=page)),)),)
                if page
                else ()
            ),
        ),
    )


def _decided(by: str, outcome: str, value: Any, expanded: Any, limit: Any, unit: str) -> Text:
    word = DECISIONS.get(outcome, (Verbatim(outcome), None))[0]
    if not isinstance(value, int | float) or not isinstance(limit, int | float):
        told = say("{by}: {word:small}", by=Verbatim(by), word=word)
    else:
        told = say(
            "{by}: {word:small}; {value} {unit} against {limit} {unit}",
            by=Verbatim(by),
            word=word,
            value=number(value, ".3g"),
            limit=number(limit, ".3g"),
            unit=Verbatim(unit),
        )
        if isinstance(expanded, int | float):
            told = say(
                "{told}, U = {expanded} {unit}", told=told, expanded=number(expanded, ".2g"), unit=Verbatim(unit)
            )
    return told


def _said(block: list[Any]) -> Block:
    """A block of a diagnosis as the worker gives it."""
    if block[0] == "fact":
        return p.PageFacts(((Verbatim(block[1]), Cell(Verbatim(block[2]), standing=block[3])),))
    if block[0] == "table":
        rows = tuple(tuple(Cell(Verbatim(text)) for text in row) for row in block[3])
        return PageTable(Verbatim(block[1]), p.columns(*map(Verbatim, block[2])), rows)
    return PageParagraph(Verbatim(block[1]))


def next_steps(one: JobState, said: Mapping[str, Any], warnings: Iterable[str]) -> tuple[Block, ...]:
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
    shown: list[Block] = [PageParagraph(text) for text in steps]
    release = f"cmm-uq release {one.id} --by 'NAME' --reason 'checked against the recording'"
    shown.append(p.SourceText(say("Command"), release))
    shown.append(
        p.Links((Cell(say("This machine and its history"), "/"), Cell(say("All certificates"), "/certificates")))
    )
    return tuple(shown)
