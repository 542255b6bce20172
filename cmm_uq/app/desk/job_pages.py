"""The desk's pages: an export and what is asked of it, jobs of the root folder with their files, and certificates."""

from __future__ import annotations

import datetime as dt
import json
import re
import tomllib
from collections.abc import Iterable, Mapping, Sequence
from difflib import unified_diff
from pathlib import Path
from typing import Any

from cmm_uq.app.desk.place import Draft, sha256
from cmm_uq.app.serve import page as p
from cmm_uq.app.serve.exchange import DESK
from cmm_uq.base.errors import CmmUqError
from cmm_uq.base.files.limits import JOB_BYTES, TABLE_BYTES, content_of
from cmm_uq.base.messages import NOTHING, Text, Verbatim, number, say
from cmm_uq.base.output.manifest import plain_name
from cmm_uq.base.values import dataclass, field
from cmm_uq.jobs.verdicts import NO_VERDICTS, Verdict, Verdicts

READ, ARTEFACT, FIELDS = f"{DESK}/read", f"{DESK}/artefact", f"{DESK}/fields"
MEANINGS: Mapping[str, Text] = {
    "": say("not used"),
    "x_mm": say("x"),
    "y_mm": say("y"),
    "z_mm": say("z"),
    "length_mm": say("measured length"),
    "nominal_mm": say("nominal length"),
    "reference_mm": say("calibrated length"),
    "deviation_um": say("deviation, µm"),
    "deviation_mm": say("deviation, mm"),
    "line": say("line"),
    "repeat": say("repeat (run)"),
    "measurement": say("set-up"),
    "point": say("point"),
    "name": say("name"),
    "temp_artefact_c": say("temperature of the artefact"),
    "temp_air_c": say("temperature of the air"),
    "time_s": say("time"),
}
_CLASSES = {
    "x": "x_mm",
    "y": "y_mm",
    "z": "z_mm",
    "length": "length_mm deviation_um deviation_mm",
    "nominal": "nominal_mm reference_mm",
    "repeat": "repeat line measurement point name",
    "ignored": "ignored",
    "unknown": "unknown",
}
COLOURED = {meaning: name for name, meanings in _CLASSES.items() for meaning in meanings.split()}
"""Classes of the style sheet."""
_UNITS = ("mm", "um", "inch", "m", "cm", "mil")
_HERE = {
    r"^Say (which|by which column|it is|which column).*columns": say("Choose what it is in the table below"),
    r"^Say which column is which": say("Choose x, y and z, or the lengths, in the table below"),
    r"lines = ": say("Fill in below where the lines lie"),
    r"^Say (which: )?sheet": say("Choose the sheet below"),
    r"\bunit = ": say("Choose the unit below"),
    r"\bdecimal = ": say("Choose the decimal sign below"),
    r"points_per_measurement = ": say("Choose the column of the set-up, or say below how many rows in turn are one"),
}
"""What a remedy in words of job.toml is on this page."""
_OF_ITEM = (
    *("machine.", "artefact.", "job.customer", "job.address", "conformity.limit_um", "conformity.mpe"),
    *("rated_conditions.", "test_uncertainty.", "recording.constant."),
)  # facts of one thing, or one customer, which another must not get unseen


def here(fix: str) -> Text:
    """A remedy, in terms of the page where that can be said."""
    return next((text for pattern, text in _HERE.items() if re.search(pattern, fix)), Verbatim(fix))


def read_page(draft: Draft, found: Mapping[str, Any], plans: Sequence[str] = ()) -> p.WebPage:
    """The reading of an export, whole, and the form that corrects it; ``plans``: files that may say where lines lie."""
    problem, said = found["problem"], draft.keys
    where, _, fix = problem or ("", "", "")
    open_ = [name in said.get("lines", {}) or not place or "?" in place for name, place, *_ in found["lines"]]
    asked, placed = (
        [one for one, own in zip(found["lines"], open_, strict=True) if own is which] for which in (True, False)
    )
    sheets = [(one, one) for one in found["sheets"]] if len(found["sheets"]) > 1 or said.get("sheet") else []
    return p.page(
        "desk/read.html", DESK, draft=draft, found=found, columns=list(map(_column, found["columns"])), sheets=sheets,
        told=[one for one in (where if where != draft.name else "", here(fix) if fix else "") if one],
        said=lambda name, none="": said.get(name, none), corrected={*said} - {"lines"}, units=[(one, one) for one in _UNITS],
        plans=[(one, one) for one in plans] if found["lines"] and problem else [], asked=asked, placed=placed,
        nothing=NOTHING,
        rows_asked=said.get("points_per_measurement") or "points_per_measurement" in fix,
    )  # fmt: skip


def _column(column: tuple[str, str]) -> tuple[str, str, str, list[tuple[str, Text]]]:
    """Heading, class of the style sheet, what a column is taken for, and what it may be."""
    heading, meaning = column
    value = "" if meaning in ("ignored", "unknown") else meaning
    options = dict(MEANINGS) if value in MEANINGS else {**MEANINGS, value: Verbatim(value)}
    if value != "name":
        options.pop("name")
    if meaning == "unknown":
        options[""] = say("not understood")
    return heading, COLOURED.get(meaning, "other"), value, list(options.items())


def said_in(form: Mapping[str, str]) -> tuple[dict[str, str], dict[str, Any]]:
    """Meanings of columns by index, and the other keys of an import, as a form has them."""
    chosen = {name[1:]: value for name, value in form.items() if re.fullmatch(r"c\d+", name)}
    names = ("unit", "decimal", "sheet", "points_per_measurement", "plan")
    others: dict[str, Any] = {name: form[name].strip() for name in names if form.get(name, "").strip()}
    lines = {name[5:]: value.strip() for name, value in form.items() if name.startswith("line:") and value.strip()}
    return chosen, others | {"lines": lines}


def fields_page(
    draft: Draft, kind: str, fields: list[dict[str, Any]], last: Mapping[str, str], found: Mapping[str, Any] | None
) -> p.WebPage:
    """What a job states, with what the export says and what was filled in last; ``found``: what a check of them says."""
    of_item = _OF_ITEM if last.get("kind") == kind else (*_OF_ITEM, "conformity.")
    again = {key: value for key, value in last.items() if key.startswith(of_item)}
    by_file = {one["key"]: one["value"] for one in fields if one.get("value")}
    filled = draft.values or {key: value for key, value in last.items() if key not in again} | by_file
    return p.page("desk/fields.html", DESK, draft=draft, kind=kind, fields=fields, filled=filled, again=again, last=last,
                  found=found)  # fmt: skip


def difference(theirs: bytes, mine: bytes) -> str:
    """What another tab, editor or command changed, against what was to be written."""
    before, after = (content.decode("utf-8", "replace").splitlines() for content in (theirs, mine))
    return "\n".join(list(unified_diff(before, after, "as it is now", "as it was to be", lineterm=""))[:400])


JOB, RUN, CANCEL, CERTIFICATE, FILE = (f"{DESK}/{name}" for name in ("job", "run", "cancel", "certificate", "file"))
PART, POINTS, CERTIFIED = (f"{DESK}/{name}" for name in ("part", "points", "certified"))
DELETE, EVENTS = f"{DESK}/delete", f"{DESK}/events"
PLAN, VERIFY, MACHINE = f"{DESK}/plan", f"{DESK}/verify", f"{DESK}/machine"
FIELD, FACTS = f"{DESK}/field.json", f"{DESK}/facts"
RESULTS, REPORTS = "results.json", "reports"
MOST_FILES, LISTED = 100, 200
_ID = re.compile(r"[A-Za-z0-9_-][A-Za-z0-9._-]{0,99}")


@dataclass(frozen=True)
class JobState:
    """A job's folder as it is; ``results``, ``verdicts``, ``made`` of its certificate, ``current``: whether its inputs are."""

    name: str  # path below the root
    id: str
    machine: str = ""
    part: bool = False
    results: Mapping[str, Any] = field(default_factory=dict)
    verdicts: Verdicts = NO_VERDICTS
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
        return p.cell_of(p.DECISIONS, self.verdicts.overall)._replace(note=when)

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
        verdicts = Verdicts.of_results(results)
    except (CmmUqError, ValueError, KeyError, TypeError, AttributeError, RecursionError):
        results, verdicts, current = {}, NO_VERDICTS, False
    made = dt.datetime.fromtimestamp((report / RESULTS).stat().st_mtime)
    files = tuple(
        f"{REPORTS}/{own}/{path.name}" for path in sorted(report.iterdir()) if path.is_file() and path.name[0] != "."
    )
    return JobState(name, own, of, part, results, verdicts, made, current, NOTHING, files)


def home_page(root: Path, jobs: Iterable[JobState], drafts: Iterable[Draft], count: int) -> p.WebPage:
    rows = tuple(
        (p.Cell(Verbatim(one.name), p.address(JOB, name=one.name)), p.Cell(p.shown(one.machine)), one.standing,
         p.Cell(say("Certificate"), p.address(CERTIFICATE, name=one.name)) if one.made else p.Cell(NOTHING))
        for one in jobs
    )  # fmt: skip
    headings = p.columns(say("Job"), say("Machine"), say("State"), say("Result"))
    more = (say("The newest {shown} of {count}.", shown=LISTED, count=count),) if count > LISTED else ()
    none = say("No job lies here yet: drop an export.")
    begun = [p.Cell(Verbatim(one.name), p.address(PART if one.part else READ, draft=one.id)) for one in drafts]
    table = p.PageTable(say("Jobs"), headings, rows, none, more, heard=True)
    return p.page("desk/home.html", DESK, root=root, jobs=table, begun=begun, most=number(TABLE_BYTES.most // 2**20))


def job_page(
    root: Path, one: JobState, check: Mapping[str, Any], text: str, seen: str, difference: str | None
) -> p.WebPage:
    """One job: what check says, its job.toml to be changed, its files; ``difference``: to what another wrote meanwhile."""
    rows: list[tuple[p.Cell, ...]] = []
    for path in sorted((root / one.name).rglob("*")):
        name = path.relative_to(root).as_posix()
        if path.is_file() and "/." not in f"/{name}" and len(rows) < MOST_FILES:
            size = say("{bytes} bytes", bytes=number(path.stat().st_size, ",d"))
            rows.append((p.Cell(Verbatim(name), p.address(FILE, at=name)), p.Cell(size)))
    files = p.PageTable(say("Files of the job"), p.columns(say("File"), say("Size")), tuple(rows), heard=True)
    return p.page("desk/job.html", DESK, one=one, check=check, text=text, seen=seen, difference=difference, files=files)


def differing(found: Mapping[str, Any], values: Mapping[str, str]) -> list[str]:
    """Fields that are another in the file by now than they were typed."""
    labels = {one["key"]: one["label"] for one in found["fields"]}
    return [
        f"{labels[key]}: {now or '(empty)'} in the file, {values.get(key, '') or '(empty)'} here"
        for key, now in found["values"].items()
        if now != values.get(key, "").strip()
    ]


def certificate_page(one: JobState, diagnosis: Any, field: bool, warnings: Iterable[str]) -> p.WebPage:
    """The certificate, its diagnosis, the residual field, and what to do next."""
    return p.page(
        "desk/certificate.html", DESK, one=one, outcome=p.cell_of(p.DECISIONS, one.verdicts.overall),
        decided=list(map(_decided, one.verdicts)), diagnosis=diagnosis, field=field, overall=one.verdicts.overall,
        not_stated=[text for text in warnings if "ISO/IEC 17025" in text],
        lacking=[(_by(each), each.missing) for each in one.verdicts if each.missing],
    )  # fmt: skip


def _by(one: Verdict) -> str:
    return f"{one.by} {one.name or one.title}".strip()


def _decided(one: Verdict) -> Text:
    word = p.DECISIONS.get(one.outcome, (Verbatim(one.outcome), None))[0]
    told = say("{by}: {word:small}", by=Verbatim(_by(one)), word=word)
    for lead, figure, digits in ((";", one.value, ".3g"), (" against", one.limit, ".3g"), (", U =", one.U, ".2g")):
        if not isinstance(figure, int | float):
            return told
        size = say("{figure} {unit}", figure=number(figure, digits), unit=one.unit)
        told = say("{told}{lead} {size}", told=told, lead=Verbatim(lead), size=size)
    return told
