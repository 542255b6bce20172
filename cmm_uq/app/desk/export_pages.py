"""From a dropped export to a job: how it was read, every column correctable; the artefact; the dozen things a job states.

Small drawings of artefacts, each in the frame of a machine's volume, by the kind of measurement.
"""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from difflib import unified_diff
from typing import Any, Literal

from cmm_uq.app.desk.place import Draft
from cmm_uq.app.serve import page as p
from cmm_uq.app.serve.exchange import DESK
from cmm_uq.base.messages import NOTHING, Text, Verbatim, number, say

_FRAME = (
    '<path class="rule" d="M14 62 60 76 106 60 60 47ZM14 62V22L60 8 106 20V60M60 47V8M14 22 60 35 106 20M60 35V76"/>'
)
_BALL = '<circle class="fill" cx="{}" cy="{}" r="{}"/>'


def _balls(*places: tuple[float, float], r: float = 4) -> str:
    return "".join(_BALL.format(x, y, r) for x, y in places)


def _line(*places: tuple[float, float]) -> str:
    return '<path class="bold" d="M' + " ".join(f"{x} {y}" for x, y in places) + '"/>'


_STEPS = _line((26, 62), (94, 40)) + "".join(
    _line((x, 62 - (x - 26) * 0.32), (x, 54 - (x - 26) * 0.32)) for x in range(30, 94, 9)
)
_PLATE = '<path class="wash" d="M30 58 62 68 92 52 60 43Z"/>'
_GRID = _balls((40, 57), (52, 60), (64, 63), (50, 52), (62, 55), (74, 58), (60, 47), (72, 50), (83, 53), r=2.6)
_BEAM = '<path class="beam" d="M10 50H104"/>'
_CIRCLE = '<ellipse class="bold" cx="60" cy="52" rx="30" ry="13"/>'
DRAWINGS: dict[str, str] = {
    "ballbar": _line((32, 60), (88, 30)) + _balls((32, 60), (88, 30), r=6),
    "bryan": _line((60, 54), (90, 34)) + _CIRCLE + _balls((60, 54), (90, 34), r=5),
    "step_gauge": _STEPS,
    "gauge_blocks": '<path class="wash" d="M30 60 80 42 88 46 88 54 38 72 30 68Z"/>' + _line((30, 60), (80, 42)),
    "plate": _PLATE + _GRID,
    "triangle": _line((34, 62), (88, 58), (58, 30), (34, 62)) + _balls((34, 62), (88, 58), (58, 30), r=5),
    "sphere": _line((60, 66), (60, 46)) + _balls((60, 38), r=15),
    "plane": '<path class="wash" d="M22 60 60 72 100 56 60 44Z"/>' + _GRID,
    "shift": _line((20, 58), (80, 42)) + _line((36, 66), (96, 50)) + _balls((20, 58), (50, 50), (80, 42), r=3),
    "shift_plate": _PLATE + '<path class="bold" d="M40 50 72 60 100 44 68 36Z"/>',
    "digitizer": _balls((60, 58), r=13) + '<path class="beam" d="M60 14 44 54M60 14 76 54"/>',
    "axis_runs": _BEAM + _line((60, 42), (60, 58)) + _line((82, 42), (82, 58)),
    "circular_test": _CIRCLE + _line((60, 52), (86, 46)) + _balls((60, 52), r=4),
    "multilateration": '<path class="beam" d="M18 60 66 30M102 58 66 30M60 74 66 30M24 24 66 30"/>'
    + _balls((66, 30), r=5),
    "tracked_points": '<path class="beam" d="M18 66 88 26"/>' + _balls((18, 66), (88, 26), (60, 24), r=5),
    "table_spheres": '<ellipse class="wash" cx="60" cy="60" rx="36" ry="12"/>'
    + _line((34, 60), (34, 50))
    + _line((86, 60), (86, 28))
    + _balls((34, 46), (86, 24), r=5),
    "scanned_planes": '<path class="wash" d="M28 60 60 70 60 48 28 38ZM60 70 94 58 94 36 60 48Z"/>'
    '<path class="beam" d="M60 12 46 52M60 12 78 54"/>',
}


def drawing(kind: str) -> str:
    """The drawing of a kind, or the volume alone for one of another package."""
    return f'<svg viewBox="0 0 120 84" aria-hidden="true">{_FRAME}{DRAWINGS.get(kind, "")}</svg>'


DESK_CELL = p.Cell(say("Desk"), DESK)
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
    *("machine.", "artefact.", "job.customer", "job.address", "conformity.limit_um"),
    *("rated_conditions.", "test_uncertainty."),
)  # facts of one thing, or one customer, which another must not get unseen


def steps(done: int, draft: str = "") -> p.Links:
    """Where on the way to a certificate a page stands, with links to what is done already."""
    names = (say("1 Export"), say("2 Artefact"), say("3 Facts"), say("4 Certificate"))
    places = (p.address(READ, draft=draft), p.address(ARTEFACT, draft=draft), "", "")
    links = (place if draft and i < done else "" for i, place in enumerate(places))
    return p.Links(tuple(map(p.Cell, names, links)))


def here(fix: str) -> Text:
    """A remedy, in terms of the page where that can be said."""
    return next((text for pattern, text in _HERE.items() if re.search(pattern, fix)), Verbatim(fix))


def read_page(draft: Draft, found: Mapping[str, Any], plans: Sequence[str] = ()) -> p.WebPage:
    """The reading of an export, whole, and the form that corrects it; ``plans``: files that may say where lines lie."""
    problem, lines = found["problem"], found["lines"]
    first = (p.Cell(say("First: {example}", example=Verbatim(found["example"]))),)
    if problem is None:
        head = p.PageNotice(say("Read whole"), "good", first)
    elif lines:
        asked = say(
            "Only where the lines lie is open: what a machine does depends on it, and no table of lengths says it"
        )
        head = p.PageNotice(asked, "open", first)
    else:
        where, what, fix = problem
        told = (*p.lines_of({where} - {"", draft.name}), *((p.Cell(here(fix)),) if fix else ()))
        head = p.PageNotice(Verbatim(what), "bad", told)
    planned = (("", say("none")), *((one, Verbatim(one)) for one in plans))
    hint = say("A plan.csv in this folder: line 7 lies as its measurement 7")
    by_plan = p.FormEntry("plan", say("Where they were planned"), "", "select", planned, hint=hint)
    lying = (*((by_plan,) if plans and lines and problem else ()), *_lines(draft, lines))
    fields, buttons = (*lying, *_settings(draft, found)), _buttons(problem, {*draft.keys} - {"lines"})
    grid = _grid(found) if found["columns"] else None
    form = p.PageForm(READ, fields, buttons, (("draft", draft.id), ("seen", draft.seen)), grid)
    facts = tuple((Verbatim(label), p.Cell(Verbatim(text))) for label, text in found["facts"])
    delete = p.PageForm(f"{DESK}/delete", (), (("delete", say("Delete this export")),), (("draft", draft.id),))
    sections = (
        *p.section(say("What was recognised"), *((p.PageFacts(facts),) if facts else ())),
        *p.section(say("The same by a command"), p.SourceText(say("Command"), found["command"])),
        *p.section(say("Not wanted"), delete),
    )
    blocks = (steps(1, draft.id), head, form)
    return p.WebPage(say("How it was read"), DESK, Verbatim(draft.name), blocks, sections, (DESK_CELL,))


def _buttons(problem: Any, said: set[str]) -> tuple[tuple[str, Text], ...]:
    again = ("read", say("Read it so"))
    if problem:
        return (again,)
    remember = (("remember", say("Right, and the same for every export with this head")),) if said else ()
    return (("on", say("It is right: choose the artefact")), *remember, again)


def _grid(found: Mapping[str, Any]) -> p.CellGrid:
    columns = []
    for i, (heading, meaning) in enumerate(found["columns"]):
        value = "" if meaning in ("ignored", "unknown") else meaning
        options = dict(MEANINGS) if value in MEANINGS else {**MEANINGS, value: Verbatim(value)}
        if value != "name":
            options.pop("name")
        if meaning == "unknown":
            options[""] = say("not understood")
        label = say("What {heading} is", heading=Verbatim(heading or "—"))
        field = p.FormEntry(f"c{i}", label, value, "select", tuple(options.items()))
        columns.append(p.GridColumn(Verbatim(heading), COLOURED.get(meaning, "other"), field))
    more = say("{count} rows more", count=number(found["more"], ",d")) if found["more"] > 0 else say("All rows")
    rows = tuple((line, tuple(cells), head) for line, cells, head in found["rows"])
    return p.CellGrid(more, tuple(columns), rows)


def _settings(draft: Draft, found: Mapping[str, Any]) -> tuple[p.FormEntry, ...]:
    recognised = ("", say("as recognised"))
    units = tuple((one, Verbatim(one)) for one in _UNITS)
    signs = ((".", say("point: 120.0012")), (",", say("comma: 120,0012")))
    said = draft.keys
    fields = [
        p.FormEntry("unit", say("Unit of lengths"), str(said.get("unit", "")), "select", (recognised, *units)),
        p.FormEntry("decimal", say("Decimal sign"), str(said.get("decimal", "")), "select", (recognised, *signs)),
    ]
    if len(found["sheets"]) > 1 or said.get("sheet"):
        sheets = tuple((one, Verbatim(one)) for one in found["sheets"])
        fields.append(p.FormEntry("sheet", say("Sheet"), str(said.get("sheet", "")), "select", (recognised, *sheets)))
    rows = str(said.get("points_per_measurement", ""))
    if rows or (found["problem"] and "points_per_measurement" in found["problem"][2]):
        hint = say("A number, or all")
        fields.append(p.FormEntry("points_per_measurement", say("Rows of one measurement"), rows, hint=hint))
    return tuple(fields)


def _lines(draft: Draft, names: Any) -> tuple[p.FormEntry, ...]:
    places, hint = draft.keys.get("lines", {}), say("Direction and start in mm, or: from 0,0,0 to 300,400,0")
    return tuple(
        p.FormEntry(
            f"line:{name}",
            say("Where line {name} lies", name=Verbatim(name)),
            places.get(name, ""),
            hint=hint,
            example=f"along {name if name in ('X', 'Y', 'Z') else 'X'} from 100,200,300",
        )
        for name in names
    )


def said_in(form: Mapping[str, str]) -> tuple[dict[str, str], dict[str, Any]]:
    """Meanings of columns by index, and the other keys of an import, as a form has them."""
    chosen = {name[1:]: value for name, value in form.items() if re.fullmatch(r"c\d+", name)}
    names = ("unit", "decimal", "sheet", "points_per_measurement", "plan")
    others: dict[str, Any] = {name: form[name].strip() for name in names if form.get(name, "").strip()}
    lines = {name[5:]: value.strip() for name, value in form.items() if name.startswith("line:") and value.strip()}
    return chosen, others | {"lines": lines}


def artefact_page(draft: Draft, kinds: list[list[str]]) -> p.WebPage:
    """What was measured, to be chosen by a picture."""
    choices = tuple(
        (p.address(FIELDS, draft=draft.id, kind=name), Verbatim(title), drawing(name)) for name, title in kinds
    )
    blocks = (steps(2, draft.id), p.Choices(say("Kinds of measurement"), choices))
    lead = say("Choose the artefact, or the kind of measurement.")
    return p.WebPage(say("What was measured"), DESK, lead, blocks, above=_above(draft))


def _above(draft: Draft) -> tuple[p.Cell, ...]:
    return DESK_CELL, p.Cell(Verbatim(draft.name), p.address(READ, draft=draft.id))


def facts_form(
    path: str,
    fields: list[dict[str, str]],
    filled: Mapping[str, str],
    buttons: tuple[tuple[str, Text], ...],
    hidden: tuple[tuple[str, str], ...],
    first: tuple[p.FormEntry, ...] = (),
    last: Mapping[str, str] = {},
) -> p.PageForm:
    """The dozen fields, and folded away those that only a whole certificate needs; ``last``: offered, and not filled in."""
    entries, further = list(first), list[p.FormEntry]()
    for one in fields:
        sort: Literal["date", "text"] = "date" if one["sort"] == "date" else "text"
        value, again = filled.get(one["key"], ""), last.get(one["key"], "")
        hint = say("The last time: {value}", value=Verbatim(again)) if again and not value else NOTHING
        entry = p.FormEntry(
            one["key"], Verbatim(one["label"]), value, sort, hint=hint, example=one["example"], again=again
        )
        (further if one["further"] else entries).append(entry)
    legend = say("What ISO/IEC 17025 asks for besides: without it the certificate is a draft")
    return p.PageForm(path, tuple(entries), buttons, hidden, None, f"{DESK}/check", legend, tuple(further))


def fields_page(
    draft: Draft, kind: str, fields: list[dict[str, str]], last: Mapping[str, str], found: Mapping[str, Any] | None
) -> p.WebPage:
    """The dozen things that a job states, with what was filled in last; ``found``: what a check of them says."""
    again = {key: value for key, value in last.items() if key.startswith(_OF_ITEM)}
    filled = draft.values if draft.values else {key: value for key, value in last.items() if key not in again}
    folder = draft.values.get("folder", "")
    named, hint = say("Name of the job, and of its folder"), say("Its certificate has this name too")
    name = p.FormEntry("folder", named, folder, hint=hint, example="K-2026-115")
    buttons = (("create", say("Make the job")), ("check", say("Check")))
    form = facts_form(
        FIELDS, fields, filled, buttons, (("draft", draft.id), ("kind", kind), ("seen", draft.seen)), (name,), again
    )
    blocks: list[p.Block] = [steps(3, draft.id)]
    if last and not draft.values:
        told = say(
            "Filled in as last time: look at each. What is of one machine, artefact or customer is offered, and not filled in."
        )
        blocks.append(p.PageParagraph(told, "note"))
    blocks += [*(check_blocks(found) if found else ()), form]
    above = (*_above(draft), p.Cell(say("Artefact"), p.address(ARTEFACT, draft=draft.id)))
    lead = say("What is left empty is not stated. In grey stands an example.")
    return p.WebPage(say("What the job states"), DESK, lead, tuple(blocks), above=above)


def check_blocks(found: Mapping[str, Any]) -> tuple[p.Block, ...]:
    """What ``cmm-uq check`` says."""
    problems, warnings = (tuple(p.Cell(Verbatim(one)) for one in found[name]) for name in ("problems", "warnings"))
    if problems:
        return (p.PageNotice(say("This would stop a certificate"), "bad", problems),)
    if warnings:
        return (p.PageNotice(say("Nothing would stop a certificate; to be known"), "open", warnings),)
    return (p.PageNotice(say("Sound: nothing would stop a certificate"), "good"),)


def difference(theirs: bytes, mine: bytes) -> tuple[p.Block, ...]:
    """What another tab, editor or command changed, against what was to be written."""
    before, after = (content.decode("utf-8", "replace").splitlines() for content in (theirs, mine))
    lines = list(unified_diff(before, after, "as it is now", "as it was to be", lineterm=""))[:400]
    head = p.PageNotice(say("Not written: it was changed meanwhile, by another tab, an editor or a command"), "bad")
    return (
        (head, p.SourceText(say("Difference"), "\n".join(lines) or "(none)"), p.PageParagraph(NOTHING))
        if lines
        else (head,)
    )
