"""The dozen things that a new job states, as the worker asks and reads them: fields of a form, and the tables of job.toml.

What job.toml states as fields of a form, and changes of these in its text, with all else in it as it stands.
"""

from __future__ import annotations

import datetime as dt
import json
import os
import re
import shutil
import tempfile
import tomllib
from collections.abc import Collection, Iterator, Mapping
from contextlib import chdir
from pathlib import Path
from typing import Any

import tomlkit
from tomlkit.items import AbstractTable

from cmm_uq.analysis.conformity.standard import Characteristic
from cmm_uq.analysis.conformity.standards import names, standard_named
from cmm_uq.app.commands.forms import shipped
from cmm_uq.app.commands.jobs.check import JobCheck, Problem, check_job
from cmm_uq.app.commands.jobs.exchange import offered, write_job_of_export
from cmm_uq.app.commands.jobs.new import job_id, job_of_export, kind_or_refused, known, usual
from cmm_uq.app.desk.exports import keys_of
from cmm_uq.base.errors import CmmUqError, Gathered
from cmm_uq.base.files.limits import JOB_BYTES, TABLE_BYTES, content_of, value_of
from cmm_uq.jobs.tables.conformity import LINE_KEYS
from cmm_uq.machine.model.kind import FORMS, LENGTHS

_PAIR = re.compile(r"\s*([-+−]?\d+(?:[.,]\d+)?)\s*(?:to|…|\.\.\.?|;|/|\s)\s*([-+−]?\d+(?:[.,]\d+)?)\s*")
_COMMA = re.compile(r"[-+−]?\d+,\d+(?:[eE][-+]?\d+)?")
_LABELS = {
    "job.date": "Date of the measurement",
    "job.customer": "Customer",
    "machine.name": "Machine",
    "machine.serial": "Serial number of the machine",
    "artefact.name": "Artefact",
    "artefact.serial": "Serial number of the artefact",
    "artefact.U_um": "U (k = 2) by the artefact's certificate, µm",
    "artefact.cte_per_k": "Its coefficient of expansion, 1/K",
    "artefact.length_mm": "Certified length or diameter, mm",
    "conformity.standard": "Standard to decide by",
    "conformity.characteristic": "Which of its characteristics",
    "conformity.mpe": "Maximum permissible error, µm (L in mm)",
    "conformity.limit_um": "Limit, µm",
    "conformity.rule": "Decision rule",
    "rated_conditions.temperature_c": "Rated temperatures, °C",
    "rated_conditions.declared.by": "Or who declares that the rated conditions were met",
    "rated_conditions.declared.reason": "Why",
    "recording.constant.temp_air_c": "Temperature of the air while it was measured, °C",
    "recording.constant.temp_artefact_c": "Temperature of the artefact, °C, where its lengths are to be corrected by it",
}
_EXAMPLES = {"job.date": "2026-05-31", "job.customer": "", "machine.serial": "9.12.6", "artefact.serial": "SG-4711"}
_OF_CERTIFICATE = {
    "laboratory.name": "Laboratory",
    "laboratory.address": "Its address",
    "laboratory.signatory": "Who authorises certificates",
    "job.issued": "Issued on",
    "job.address": "Address of the customer",
    "job.place": "Where it was measured",
    "job.procedure": "Procedure",
    "job.conditions": "Conditions that influence the results",
    "artefact.certificate.number": "Number of the artefact's certificate",
    "artefact.certificate.laboratory": "Who issued that",
    "artefact.certificate.issuer": "What that is: national institute, accredited, in-house",
    "artefact.certificate.arrangement": "Under which arrangement: CIPM MRA, ILAC MRA",
    "artefact.certificate.date": "Date of that certificate",
    "artefact.certificate.due": "Last day on which it holds",
}
"""What ISO/IEC 17025:2017, 7.8 asks for besides; a certificate without it is a draft."""
_PAIRS = ("machine.travel_mm.x", "machine.travel_mm.y", "machine.travel_mm.z", "rated_conditions.temperature_c")


def _wanted(name: str) -> Iterator[tuple[str, Any]]:
    """Dotted keys with the example of each."""
    begun = usual(name)
    artefact = {key: value for key, value in begun["artefact"].items() if key != "kind"}
    yield from ((key, _EXAMPLES[key]) for key in ("job.date", "job.customer"))
    yield "machine.name", begun["machine"]["name"]
    yield "machine.serial", _EXAMPLES["machine.serial"]
    yield from ((f"machine.travel_mm.{axis}", span) for axis, span in begun["machine"].get("travel_mm", {}).items())
    for key, value in artefact.items():
        if key == "u_um":
            yield "artefact.U_um", round(2 * value, 6) if isinstance(value, int | float) else "0.2 + 0.5·L/1000"
        else:
            yield f"artefact.{key}", value
        if key == "name":
            yield "artefact.serial", _EXAMPLES["artefact.serial"]
    kind = kind_or_refused(known()[name])
    decided = _decided_on(kind.tested)
    usually = (begun.get("conformity") or [{}])[0]
    if decided:
        limits = {"mpe": "2 + L/300"} if LENGTHS in kind.tested else {}
        yield from {
            "conformity.standard": "",
            "conformity.characteristic": "",
            **{
                f"conformity.{key}": value
                for key, value in (limits | {"limit_um": 4.0} | usually).items()
                if key not in ("standard", "characteristic")
            },
            "conformity.rule": "ISO 14253-1",
        }.items()
    lines = (
        {line for _, one in decided for line in one.lines} if LENGTHS in kind.tested or FORMS in kind.tested else {*()}
    )
    asked = {key: 1e-6 if line == "expansion" else 0.1 for line, key in LINE_KEYS.items() if line in lines} | begun.get(
        "test_uncertainty", {}
    )
    yield from ((f"test_uncertainty.{key}", value) for key, value in asked.items())
    if decided:
        yield "rated_conditions.temperature_c", [18.0, 22.0]
        yield from ((f"rated_conditions.declared.{key}", "") for key in ("by", "reason"))
    if kind.table.with_recording:
        yield from ((f"recording.constant.{column}", 20.1) for column in ("temp_air_c", "temp_artefact_c"))


def _decided_on(tested: Collection[str]) -> list[tuple[str, Characteristic]]:
    """Standards that can be decided on what a kind offers, with each of their characteristics that can."""
    each = ((name, one) for name in names() if (one := standard_named(name)) is not None)
    return [(name, own) for name, one in each for own in one.characteristics if own.observed in tested]


def _options(kind: str, dotted: str) -> list[list[str]]:
    """What a field is chosen from; nothing where it is written."""
    decided = _decided_on(kind_or_refused(known()[kind]).tested)
    if dotted == "conformity.standard":
        return [["", "none"], *([name, name] for name in dict.fromkeys(name for name, _ in decided))]
    if dotted == "conformity.characteristic":
        of: dict[str, list[str]] = {}
        for name, one in decided:
            of.setdefault(one.name, []).append(name)
        return [["", "the first of the standard"], *([one, f"{one}: {', '.join(those)}"] for one, those in of.items())]
    return []


def _schema_of(schema: Mapping[str, Any], dotted: str) -> Mapping[str, Any]:
    table, key, *_ = dotted.split(".")
    found = schema["properties"].get(table, {})
    found = found.get("items", found)
    return found.get("properties", {}).get(key, {}) or {}


_OF_TEST = (
    "conformity.characteristic",
    "test_uncertainty.",
    "rated_conditions.declared",
    "recording.constant.temp_artefact_c",
)
"""What a standard asks of its test besides; the statement of conformity is incomplete without it."""
_FIELD: dict[str, Any] = {"example": "", "options": [], "further": "", "said": "", "value": ""}


def fields(kind: str) -> list[dict[str, Any]]:
    """Fields of the form of a kind: key, label, example, sort, options, and what alone needs it."""
    schema, found = json.loads(shipped("job")), []
    for dotted, value in _wanted(kind):
        known = _schema_of(schema, dotted)
        said = str(known.get("description", "")).partition(". Unit:")[0].partition(":")[0].rstrip(".")
        unit = f", {known['x-unit']}" if "x-unit" in known and not said.endswith(str(known["x-unit"])) else ""
        label = _LABELS.get(dotted) or f"{said}{unit}" or dotted
        if dotted.startswith("machine.travel_mm."):
            label = f"Travel of {dotted[-1].upper()}, lowest to highest reading, mm"
        example = _as_toml(value) if isinstance(value, dict) else _shown(value, dotted)
        sort = "date" if dotted == "job.date" else "text"
        options, further = _options(kind, dotted), "test" if dotted.startswith(_OF_TEST) else ""
        found.append(
            _FIELD
            | {"key": dotted, "label": label, "example": example, "sort": sort, "options": options, "further": further}
        )
    for dotted, label in _OF_CERTIFICATE.items():
        sort = "date" if dotted.endswith((".issued", ".date", ".due")) else "text"
        found.append(_FIELD | {"key": dotted, "label": label, "sort": sort, "further": "yes"})
    return found


def fields_for(kind: str, export: str, keys: Mapping[str, Any]) -> list[dict[str, Any]]:
    """The same with what the export says of each in its head or foot: the words, and the value to begin with."""
    said = {one.key: one for one in offered(Path(export), keys_of(keys))}
    found = fields(kind)
    for one in found:
        if (own := said.get(one["key"])) is not None:
            one |= {"said": str(own), "value": own.value if own.taken else ""}
    return found


def tables_of(values: Mapping[str, str]) -> dict[str, dict[str, Any]]:
    """Tables of job.toml from fields as they were filled in; what is empty is not stated."""
    schema, tables = json.loads(shipped("job")), dict[str, dict[str, Any]]()
    for dotted, text in values.items():
        table, _, key = dotted.partition(".")
        if not (text := text.strip()):
            continue
        known = _schema_of(schema, dotted)
        known = known.get("properties", {}).get(dotted.rpartition(".")[2], known)
        plain = known.get("type") == "string" and known.get("format") != "date"
        value = text if plain else value_of(plain_number(text))
        if dotted in _PAIRS:
            if (pair := _PAIR.fullmatch(text)) is None:
                raise CmmUqError(
                    f"{text!r} is no lowest and highest value", where=f"[{table}] {key}", fix='Write it as "0 to 700"'
                )
            value = [float(plain_number(one)) for one in pair.groups()]
        key, dot, axis = key.partition(".")
        tables.setdefault(table, {})
        if dot:
            tables[table].setdefault(key, {})[axis] = value
        else:
            tables[table][key] = value
    if "U_um" in tables.get("artefact", {}):
        tables["artefact"]["k"] = 2.0
    if not tables.get("conformity", {}).get("standard"):
        tables.pop("conformity", None)
    return tables


def plain_number(text: str) -> str:
    """A number with a decimal point, where it is one with a comma."""
    text = text.replace("−", "-")
    return text.replace(",", ".") if _COMMA.fullmatch(text) else text


def check_answers(kind: str, export: str, keys: Mapping[str, Any], values: Mapping[str, str]) -> dict[str, Any]:
    """What would be wrong with the job that a form begins, as ``cmm-uq check`` says it."""
    said = _said(job_begun(kind, export, keys, values))
    return said | {"problems": [_for_form(text, kind) for text in said["problems"]]}


def job_begun(kind: str, export: str, keys: Mapping[str, Any], values: Mapping[str, str]) -> JobCheck:
    """The job that a form begins, as ``cmm-uq check`` finds it."""
    wrong, path = Gathered(), Path(export)
    content = content_of(path, TABLE_BYTES, "Drop it again")
    with wrong.going_on():
        given = tables_of(values)
        if not given.get("machine", {}).get("name"):
            wrong.add(CmmUqError("the machine that was measured has no name", where="[machine] name", fix="Fill it in"))
        said = {key: value for key, value in keys_of(keys).model_dump().items() if value not in (None, {})}
        tables = {
            **given,
            "machine": {"name": "?", **given.get("machine", {})},
            "recording": {"file": path.name, **said, **given.get("recording", {})},
        }
        files = job_of_export(kind, tables, {path.name: content}, id="job")
        if not wrong.problems:
            return _checked("job", files)
    return JobCheck("job", tuple(map(Problem.of, wrong.problems)), ())


def _for_form(text: str, kind: str) -> str:
    """A problem with where on the desk it is mended: the step after this, or the fields whose keys it names."""
    if "[artefact.certificate] file" in text:
        return f"{text}. Here: make the job, then drop the certificate on its page"
    named = [one["label"] for one in fields(kind) if re.search(rf"\b{one['key'].rpartition('.')[2]}\b", text)]
    unsaid = [f"“{label}”" for label in named if "_" in text and label.lower() not in text.lower()]
    return f"{text}. Here: {', '.join(unsaid)}" if unsaid else text


def _checked(name: str, files: Mapping[str, bytes], beside: Path | None = None) -> JobCheck:
    """What check says of a job of these files, and of those ``beside``, laid out in a folder of that name."""
    with tempfile.TemporaryDirectory(prefix="cmm-uq-") as place:
        if beside is not None:
            shutil.copytree(beside, Path(place, name), ignore=_hidden, symlinks=True, copy_function=_linked)
        with chdir(place):
            for file, content in files.items():
                target = Path(name, file)
                target.parent.mkdir(parents=True, exist_ok=True)
                target.unlink(missing_ok=True)  # what is linked is another's
                target.write_bytes(content)
            return check_job(Path(name))


def _hidden(folder: str, names: list[str]) -> list[str]:
    return [name for name in names if name[0] == "."]


def _linked(source: str, target: str) -> None:
    """The same file under another name, or a copy where that cannot be."""
    try:
        os.link(source, target)
    except OSError:
        shutil.copyfile(source, target)


def check_text(job: str, text: str | None) -> dict[str, Any]:
    """What check says of a job's folder, or of what it would be with another job.toml."""
    if text is not None:
        if len(text.encode()) > JOB_BYTES.most:
            raise CmmUqError("is longer than any job", where="job.toml", fix="Shorten it")
        return _said(_checked(job, {"job.toml": text.encode()}, Path(job)))
    return _said(check_job(Path(job)))


def _said(found: JobCheck) -> dict[str, Any]:
    problems, warnings = found.lines
    return {"problems": list(problems), "warnings": list(warnings), "sound": found.sound, "command": found.command}


def create(kind: str, export: str, keys: Mapping[str, Any], values: Mapping[str, str], folder: str) -> dict[str, Any]:
    """Write the new job around its export; see :func:`~cmm_uq.app.commands.jobs.exchange.write_job_of_export`."""
    given = tables_of(values)
    files = write_job_of_export(kind, Path(export), Path(folder), given, keys_of(keys))
    return {"files": sorted(files), "id": job_id(Path(folder), given)}


def facts(text: str) -> dict[str, Any]:
    """Fields of the kind that job.toml names, and what it says of each; what it does not is empty."""
    try:
        data = tomllib.loads(text)
        asked = fields(str(data["artefact"]["kind"]))
    except (tomllib.TOMLDecodeError, KeyError, TypeError, RecursionError):
        raise CmmUqError("names no kind of measurement", where="job.toml", fix="Mend it in its text") from None
    return {"fields": asked, "values": {one["key"]: _shown(_stated(data, one["key"]), one["key"]) for one in asked}}


def _stated(data: Any, dotted: str) -> Any:
    """A value by its dotted key, of the first of several tables; ``None`` where it is not stated."""
    for key in dotted.split("."):
        data = data[0] if isinstance(data, list) and data else data
        data = data.get(key) if isinstance(data, dict) else None
    return data


def _shown(value: Any, dotted: str) -> str:
    """A value as a field has it, and as it is read there; a table is none."""
    if isinstance(value, list):
        return " to ".join(f"{one:.12g}" for one in value) if dotted in _PAIRS else _as_toml(value)
    if isinstance(value, float):
        return f"{value:.12g}"
    if isinstance(value, dict):
        return ""
    return "" if value is None else value.isoformat() if isinstance(value, dt.date) else str(value)


def _as_toml(value: Any) -> str:
    if isinstance(value, Mapping):
        return "{ " + ", ".join(f"{key} = {_as_toml(one)}" for key, one in value.items()) + " }"
    return f"[{', '.join(map(_as_toml, value))}]" if isinstance(value, list) else json.dumps(value, ensure_ascii=False)


def with_facts(text: str, values: Mapping[str, str]) -> str:
    """The text of job.toml with those of the fields that say something else than it does."""
    before = facts(text)["values"]
    changed = {key: value.strip() for key, value in values.items() if key in before and value.strip() != before[key]}
    if not changed:
        return text
    document = tomlkit.parse(text)
    standard = {"conformity.standard": values.get("conformity.standard", "")}
    tables = tables_of({**standard, **{key: value for key, value in changed.items() if value}})
    for dotted, value in changed.items():
        table, _, key = dotted.rpartition(".")
        place = _place(document, table)
        if value:
            place[key] = _stated(tables, dotted)
        elif isinstance(place, AbstractTable | tomlkit.items.InlineTable):
            place.remove(key)
    if "artefact.U_um" in changed and changed["artefact.U_um"] and "k" not in document["artefact"]:
        document["artefact"]["k"] = 2.0
    return tomlkit.dumps(document)


def _place(document: tomlkit.TOMLDocument, table: str) -> Any:
    """A table by its dotted name, the first of several; one that is not there is begun."""
    place: Any = document
    for name in table.split("."):
        if name not in place:
            begun = tomlkit.table() if place is document else tomlkit.inline_table()
            place[name] = tomlkit.aot() if name == "conformity" else begun
        place = place[name]
        if isinstance(place, list):
            if not place:
                place.append(tomlkit.table())
            place = place[0]
    return place


def with_file(text: str, table: str, name: str) -> str:
    """The text of job.toml with the file that a table names; all else in it as it stands."""
    try:
        document = tomlkit.parse(text)
        _place(document, table)["file"] = name
    except (tomlkit.exceptions.TOMLKitError, TypeError, RecursionError):
        raise CmmUqError(
            f"has no table that [{table}] file could stand in", where="job.toml", fix="Mend its text"
        ) from None
    return tomlkit.dumps(document)
