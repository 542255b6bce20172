"""A new job of a part from answers: tables that are held against the readers of a job one by one, and the machine's files.

A new job of a part: each line explained, figures of an example, or features and tolerances of another program's plan.
"""

from __future__ import annotations

import datetime as dt
import json
from collections.abc import Collection, Mapping, Sequence
from contextlib import suppress
from pathlib import Path
from types import MappingProxyType
from typing import Any

from pydantic import ValidationError

from cmm_uq.app.commands.forms import shipped
from cmm_uq.app.commands.reading import unwritten
from cmm_uq.base.errors import CmmUqError
from cmm_uq.base.files.limits import TABLE_BYTES, content_of
from cmm_uq.base.files.toml_file import as_toml, nested
from cmm_uq.base.values import dataclass, field
from cmm_uq.jobs.importing.cells.encodings import begins_with, head_text
from cmm_uq.jobs.importing.format import HEAD
from cmm_uq.jobs.part.checks import freedoms, members, unfit
from cmm_uq.jobs.part.dmis import STATEMENT, drawing_of_dmis
from cmm_uq.jobs.part.drawing import KEY, Drawing, NotUnderstood, probed_of, set_aside_unsound
from cmm_uq.jobs.part.feature import CharacteristicFacts
from cmm_uq.jobs.part.job import POSTERIOR, TABLES, part_of
from cmm_uq.jobs.part.probed import Probed
from cmm_uq.jobs.part.qif import drawing_of_qif
from cmm_uq.jobs.part.table import drawing_of_table
from cmm_uq.jobs.schema import commented, written, written_key
from cmm_uq.jobs.source import RESULTS
from cmm_uq.jobs.tables.identification import EXAMPLE, SIMULATED

Facts = dict[str, Any]
FOLDER = "machine"
_WHOLE = (".pdf", ".xml")
_FIX = "Name the certificate (PDF), or the folder that the machine's report wrote"


@dataclass
class Answers:
    """What was said so far; what is empty stays that of the example."""

    # part, stylus, alignment: keys of these tables
    part: Facts = field(default_factory=dict)
    stylus: Facts = field(default_factory=dict)
    alignment: Facts = field(default_factory=dict)
    # files that state the machine, by name inside the job's folder
    machine: Mapping[str, bytes] = field(default_factory=dict)
    # features, characteristics: tables, in order
    features: list[Facts] = field(default_factory=list)
    characteristics: list[Facts] = field(default_factory=list)
    probed: dict[str, Probed] = field(default_factory=dict)

    @property
    def certificate(self) -> str:
        """What ``[machine_state] certificate`` names: the certificate alone, or the folder of all files."""
        return next((name for name in self.machine if name.lower().endswith(_WHOLE)), FOLDER)

    def free_name(self, name: str, *, tolerance: bool = False) -> str:
        if name in ([one["name"] for one in self.characteristics] if tolerance else self.probed):
            raise CmmUqError(f"{name!r} is there already", fix="Give it another name")
        return name

    def add_feature(self, given: Facts) -> None:
        self.probed[given["name"]] = probed_of(given)
        self.features.append(given)

    def aligned(self, datums: Sequence[str]) -> Facts:
        """``[alignment]`` by datums in order, or by best fit where there are none."""
        if not datums:
            return {"best_fit": True}
        named = [tuple(self.probed[each] for each in members(name, self.probed)) for name in datums]
        if free := freedoms(named):
            raise CmmUqError(f"these datums leave free {', '.join(free)}", fix="Add a feature that fixes it")
        return {"datums": list(datums)}

    def add_characteristic(self, given: Facts) -> None:
        try:
            facts = CharacteristicFacts.model_validate(given)
        except ValidationError as error:
            raise CmmUqError(error.errors()[0]["msg"].removeprefix("Value error, ")) from None
        for name in (*facts.features, *facts.datums):
            members(name, self.probed)
        if found := unfit(facts, self.probed):
            raise CmmUqError(found[0], fix=found[2])
        self.characteristics.append(given)


def certificate_files(path: Path) -> dict[str, bytes]:
    """What states a machine, as it goes into the folder of a part's job."""
    if path.is_dir():
        whole = sorted(one for one in path.glob("certificate*.pdf") if one.is_file())
        chosen = whole[:1] or [path / RESULTS, path / POSTERIOR]
    else:
        chosen = [path] if path.suffix.lower() in _WHOLE else [path, path.parent / POSTERIOR]
    return {f"{FOLDER}/{one.name}": content_of(one, TABLE_BYTES, _FIX) for one in chosen}


Tables = Mapping[str, Mapping[str, Any]]
PART = "part"
SCHEMA, README = ".cmm-uq/part.schema.json", "README.md"
_NAMED = ("name", "kind", "what", "features", "datums", "not_measured", "drawing")  # keys whose values are no figures
_LISTS = ("stylus", "feature", "characteristic")


def part_files(given: Tables, *, id: str) -> dict[str, bytes]:  # noqa: A002
    """Contents of every file of a new job of a part, by name; its figures are an example."""
    tables = _with({name: _copied(table) for name, table in TABLES.items()}, given, id)
    marked = {f"{name}.{key}" for name, table in TABLES.items() for key in _keys(table)}
    return _files(tables, marked - _given_keys(given), {})


def part_of_answers(answers: Answers, *, id: str) -> dict[str, bytes]:  # noqa: A002
    """Contents of every file of a new job of a part as its user described it; what was not said is that of the example."""
    tables = {name: _copied(table) for name, table in TABLES.items()}
    own: dict[str, Any] = {PART: answers.part, "machine_state": {"certificate": answers.certificate}}
    tables["stylus"] = [{**tables["stylus"][0], **answers.stylus}]
    if answers.features:
        own["alignment"] = answers.alignment
        tables |= {"feature": answers.features, "alignment": {}}
    if answers.characteristics:
        tables["characteristic"] = answers.characteristics
    elif answers.features:  # something has to be asked of them: where the first one is
        first = answers.features[0]["name"]
        tables["characteristic"] = [{"name": "1", "what": "position", "features": [first], "tolerance_mm": 0.1}]
    said = ("feature",) if answers.features else ()
    marked = {f"{name}.{key}" for name, table in TABLES.items() if name not in said for key in _keys(table)}
    marked -= _given_keys(own) | {f"stylus.{key}" for key in answers.stylus}
    marked -= {f"characteristic.{key}" for key in _keys(TABLES["characteristic"])} if answers.characteristics else set()
    return {**_files(_with(tables, own, id), marked, {}), **answers.machine}


def part_of_drawing(path: Path, given: Tables, *, id: str) -> dict[str, bytes]:  # noqa: A002
    """Contents of every file of a new job of a part whose plan another program wrote.

    ``given``: what job.toml is to say; ``part.not_measured`` names what may be left out.
    """
    content, where = content_of(path, TABLE_BYTES, "Check its name"), str(path)
    head = content[:HEAD]
    if begins_with(head, "QIFDocument"):
        drawing = drawing_of_qif(content, where)
    elif STATEMENT.search(head_text(head)):
        drawing = drawing_of_dmis(content, where)
    else:
        drawing = drawing_of_table(content, where)
    without = given.get(PART, {}).get("not_measured", [])
    if not (isinstance(without, list) and all(isinstance(name, str) for name in without)):
        raise CmmUqError("must be a list of names", where=KEY, fix='Write it as \'["NAME", "NAME"]\'')
    set_aside_unsound(drawing, where)
    left_out = drawing.settled(without, where)
    examples = ("machine_state", "stylus", "placing", "probing", "environment", "form")
    example = {name: _copied(TABLES[name]) for name in examples}
    holes = [one["diameter_mm"] for one in drawing.features if one.get("inner") and one.get("diameter_mm")]

    def tip(usual: float) -> float:
        """Diameter of the example's, or of half of the smallest hole where that does not go in."""
        return float(round(min([usual, *(hole / 2 for hole in holes)]), 3))

    whole: dict[str, Any] = example | {
        PART: {"name": path.stem[:100], **({"not_measured": left_out} if left_out else {})},
        "feature": drawing.features, "characteristic": drawing.characteristics, **_aligned(drawing),
        "stylus": drawing.styli or [{**one, "diameter_mm": tip(one["diameter_mm"])} for one in example["stylus"]],
    }  # fmt: skip
    said = {name: dict(keys) for name, keys in given.items()}
    said.get(PART, {}).pop("not_measured", None)
    marked = {f"{name}.{key}" for name in examples if name != "stylus" for key in whole[name]}
    marked |= set() if drawing.styli else {f"stylus.{key}" for key in whole["stylus"][0]}
    marked |= {"alignment.best_fit"}
    opened = {name: set(keys) for name, keys in drawing.open_keys.items()}
    tables, beside = _with_results(_with(whole, said, id), content, path)
    return {**_files(tables, marked - _given_keys(said), opened, drawing.unknown, beside), **beside}


def _with_results(tables: dict[str, Any], content: bytes, path: Path) -> tuple[dict[str, Any], dict[str, bytes]]:
    """With the values that a QIF document has beside its plan, of one part, and the file that has them."""
    named = f"report{path.suffix.lower()}"
    if b"CharacteristicMeasurement" in content and "recording" not in tables:
        whole = {**tables, "recording": {"values": named}}
        with suppress(CmmUqError):
            part_of({"job.toml": as_toml(whole, "job.toml"), named: content}, machine=False)
            return whole, {named: content}
    return tables, {}


def _aligned(drawing: Drawing) -> dict[str, Any]:
    """The first datums of the drawing that fix the part; else a best fit, which nobody has asked for."""
    features = {one["name"]: probed_of(one) for one in drawing.features}
    asked = [drawing.datums, *(one.get("datums", []) for one in drawing.characteristics)]
    for datums in asked:
        if datums and not freedoms([tuple(features[each] for each in members(name, features)) for name in datums]):
            return {"alignment": {"datums": datums}}
    return {"alignment": {"best_fit": True}}


def _with(tables: dict[str, Any], given: Tables, id: str) -> dict[str, Any]:  # noqa: A002
    """What job.toml says: an example or a drawing, and over it what is given."""
    for name, keys in given.items():
        if name == "machine":
            raise CmmUqError("the job of a part names its machine by a certificate", where="--machine",
                             fix="Leave it out, or give --set machine_state.certificate=machine")  # fmt: skip
        if name in _LISTS:
            raise CmmUqError(f"there may be several [[{name}]], which no option names", where="--set",
                             fix="Write them into job.toml")  # fmt: skip
        tables[name] = nested({**tables.get(name, {}), **keys})
    today = dt.datetime.now(tz=dt.UTC).date()
    return {**tables, "job": {"id": id, "date": today, "origin": SIMULATED, **tables.get("job", {})}}


def _files(
    tables: Mapping[str, Any], marked: Collection[str], opened: Mapping[str, Collection[str]],
    left_out: Collection[NotUnderstood] = (), beside: Mapping[str, bytes] = MappingProxyType({}),
) -> dict[str, bytes]:  # fmt: skip
    with unwritten():
        part_of({"job.toml": as_toml(tables, "job.toml"), **beside}, machine=False)
    return {
        "job.toml": _text(tables, marked, opened).encode(), README: _readme(left_out).encode(),
        SCHEMA: shipped(PART).encode(),
    }  # fmt: skip


def _text(tables: Mapping[str, Any], marked: Collection[str], opened: Mapping[str, Collection[str]]) -> str:
    """job.toml: of several tables of one name the first with its keys explained."""
    head = (
        f"#:schema ./{SCHEMA}\n# A part and its uncertainty. Whatever else may be said: docs/reference/part.md, cmm-uq schema "
        "part, or what an editor that knows TOML schemas completes.\n"
        f"# Figures marked {EXAMPLE} are nobody's: put in your own, then take the marks and origin below away.\n"
    )
    schema, parts = json.loads(shipped(PART)), [head]
    for name, one in schema["properties"].items():
        several = name in _LISTS
        for i, said in enumerate(tables[name] if several else [tables.get(name)]):
            marks = _marks(name, said, marked, opened)
            if i:
                parts.append(_short(name, said, marks))
            elif said:
                given = {name: [said] if several else said}
                parts.append(commented({"properties": {name: one}}, given, comment=False, examples=marks))
    return "\n".join(parts)


def _marks(name: str, said: Any, marked: Collection[str], opened: Mapping[str, Collection[str]]) -> set[str]:
    """Dotted keys of a table whose values are examples."""
    own = opened.get(str((said or {}).get("name", "")), ()) if name == "feature" else ()
    return {f"{name}.{key}" for key in said or {} if f"{name}.{key}" in marked or key in own}


def _short(name: str, said: Mapping[str, Any], marks: Collection[str]) -> str:
    mark = f"  # {EXAMPLE}, put in your own"
    ends = {key: mark if f"{name}.{key}" in marks else "" for key in said}
    return "\n".join(
        [f"[[{name}]]", *(f"{written_key(key)} = {written(said[key])}{end}" for key, end in ends.items()), ""]
    )


def _keys(table: Any) -> list[str]:
    found = [key for one in (table if isinstance(table, list) else [table]) for key in one]
    return [key for key in dict.fromkeys(found) if key not in _NAMED]


def _given_keys(given: Tables) -> set[str]:
    return {f"{table}.{key.partition('.')[0]}" for table, keys in given.items() for key in keys}


def _copied(table: Any) -> Any:
    return [dict(one) for one in table] if isinstance(table, list) else dict(table)


def _readme(left_out: Collection[NotUnderstood]) -> str:
    lines = [
        "# A part and its uncertainty", "",
        "- `job.toml`: features with the points at which they are probed, datums, tolerances, styli, temperatures. Editors "
        f"that know TOML schemas explain every key (`{SCHEMA}`).",
        "- Put what `cmm-uq report` wrote for the machine into the folder `machine`: its certificate, or `results.json` and "
        "`posterior.npz`.",
        f"- **The figures marked {EXAMPLE} are nobody's.** Put in your own, then take the marks away, and "
        '`origin = "simulated"`.',
        "- `cmm-uq check .` says what is missing or wrong; `cmm-uq part .` gives the uncertainties.",
        "- Points that were measured make values and decisions of them: name their file in `[recording]`, or the report of "
        "another program that has values.",
    ]  # fmt: skip
    if left_out:
        lines += ["", "What was not understood of the plan, and is not measured:", ""]
        lines += [f"- `{one.name}` {one.why}." for one in left_out]
    return "\n".join(lines) + "\n"
