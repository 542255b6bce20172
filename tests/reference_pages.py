"""The pages of docs/reference and the schemas in the package: ``python -m tests.reference_pages`` writes them anew."""

from __future__ import annotations

import inspect
import textwrap
from collections.abc import Callable, Iterable, Mapping, Sequence
from functools import partial
from pathlib import Path
from typing import Any

from typer.models import ArgumentInfo, CommandInfo

from cmm_uq.analysis.planning.setting import Planning
from cmm_uq.app.cli.commands import app
from cmm_uq.app.commands.forms import SCHEMAS, as_text, schema_named
from cmm_uq.app.commands.jobs.new import known
from cmm_uq.artefacts import kind_named
from cmm_uq.base.files.table import unit_of
from cmm_uq.jobs.columns import COLUMNS, REQUIRED
from cmm_uq.jobs.part import dmis as drawing_dmis, qif as drawing_qif
from cmm_uq.jobs.part.dmis import PROGRAM as DMIS
from cmm_uq.jobs.part.feature import ASKS, FEWEST, LIMITS, PATTERNS, Asks
from cmm_uq.jobs.part.qif import PROGRAM as QIF
from cmm_uq.jobs.schema import keys_of, without_place, written
from cmm_uq.laboratory.live.instruments import pt104
from cmm_uq.laboratory.live.instruments.library import profile_named, ready
from cmm_uq.laboratory.live.instruments.profile import ProfileFacts, ProfileFile
from cmm_uq.machine.model.kind import Beginning
from cmm_uq.machine.physics.catalogue import EVERY
from cmm_uq.maths.uncertainty.budgets.tables import TABLES
from cmm_uq.maths.uncertainty.models.input_keys import KINDS as DISTRIBUTIONS
from tests.conftest import ROOT
from tests.result_keys import PART_RESULTS, PROOF, QUANTITY, RATE, RESULTS

SHIPPED, PAGES = ROOT / "cmm_uq" / "schemas", ROOT / "docs" / "reference"
WRITTEN = "<!-- written by python -m tests.reference_pages from what the program reads: edit that instead -->"
EDITORS = (
    "The same as JSON Schema, for editors that complete and explain (Even Better TOML, taplo, Tombi): `cmm-uq schema {name}` "
    "prints it with the kinds, effects and standards of other packages that are installed; a first line "
    "`#:schema ./FILE` names it."
)
ALL = "all"


def files() -> dict[Path, Callable[[], str]]:
    """Every generated file with what says what it must say."""
    schemas: dict[Path, Callable[[], str]] = {
        SHIPPED / f"{name}.schema.json": partial(schema_text, name) for name in SCHEMAS
    }
    pages = {
        "job": job,
        "part": part,
        "plan": plan,
        "truth": truth,
        "budget": budget,
        "instrument": instrument,
        "schedule": schedule,
        "columns": columns,
        "commands": commands,
        "results": results,
        "part-results": part_results,
        "prove": prove,
    }
    schemas[PAGES.parent / "instruments" / "ready.md"] = ready_profiles
    return schemas | {PAGES / f"{name}.md": text for name, text in pages.items()}


def schema_text(name: str) -> str:
    """A schema as it is shipped."""
    return as_text(schema_named(name))


def page(title: str, *parts: str) -> str:
    """A page of parts."""
    return "\n\n".join([f"# {title}", WRITTEN, *parts]) + "\n"


def table(headings: Sequence[str], rows: Iterable[Sequence[str]]) -> str:
    """A table; a vertical line in a cell would end it."""
    lines = [headings, ["---"] * len(headings), *rows]
    return "\n".join("| " + " | ".join(cell.replace("|", "\\|") for cell in line) + " |" for line in lines)


def job() -> str:
    """Every key of job.toml but ``[plan]``."""
    schema = schema_named("job")
    parts = [
        "A job is a folder with a `job.toml` and the recording that it names. `cmm-uq new KIND` writes one that runs, with "
        "the lines that matter; `cmm-uq check JOB` says all that is wrong with it. Numbers in brackets such as 7.8.2.1 e are "
        "clauses of ISO/IEC 17025:2017.",
        EDITORS.format(name="job"),
        "Units stand at the end of a key's name. A standard uncertainty u has k = 1.",
    ]
    for name, one in schema["properties"].items():
        if name != "plan":
            parts += [
                f"## `{header(name, one)}`",
                one["description"],
                keys_table(one, asked="kinds" * (name == "artefact")),
            ]
    parts += ["`[plan]` has [a page of its own](plan.md)."]
    return page("job.toml, key by key", *parts)


def part() -> str:
    """Every key of a part's job.toml."""
    schema = schema_named("part")
    parts = [
        "The job of a part is a folder with a `job.toml` and the files that state the machine. `cmm-uq new part` writes one "
        "with each line explained, or with features and tolerances of a QIF plan, a DMIS program or a table (`--from FILE`); "
        "`cmm-uq check JOB` says all that is wrong with it.",
        EDITORS.format(name="part"),
        "Coordinates of features are those of the part in mm at 20 °C. Units stand at the end of a key's name. A standard "
        "uncertainty u has k = 1.",
    ]
    for name, one in schema["properties"].items():
        parts += [f"## `{header(name, one)}`", one["description"], keys_table(one)]
        if name == "feature":
            kinds = [
                (f"`{kind}`", str(least), ", ".join(f"`{pattern}`" for pattern in PATTERNS[kind]) or "–")
                for kind, least in FEWEST.items()
            ]
            parts.append(table(("kind", "points at least", "patterns"), kinds))
        if name == "characteristic":
            rows = [(f"`{what}`", *_asked(asks)) for what, asks in ASKS.items()]
            parts.append(table(("`what`", "of", "about datums", "limits"), rows))
    parts += [
        "## Plans of other programs",
        "`cmm-uq new part --from FILE` makes these tables of a QIF plan, a DMIS program or a table. What is not understood is "
        "refused "
        "by name; `--set part.not_measured='[\"NAME\"]'` leaves it out knowingly, `'[\"*\"]'` all of it, and the job says "
        "what was left out. What such a file leaves open stands in the job as an example.",
        *(
            f"{program}: {text[0].lower()}{text[1:]}"
            for program, reader in ((QIF, drawing_qif), (DMIS, drawing_dmis))
            for text in (" ".join(str(reader.__doc__).replace("``", "`").split("\n\n")[1].split()),)
        ),
    ]
    return page("job.toml of a part, key by key", *parts)


def _asked(asks: Asks) -> tuple[str, str, str]:
    """Of what a characteristic is, about what, and how it is limited."""
    of = f"{'two of ' if asks.features > 1 else ''}{', '.join(asks.kinds)}"
    if not asks.datum_kinds:
        about = "–"
    elif asks.datums:
        about = ", ".join(asks.datum_kinds)
    else:
        about = "any, else the alignment"
    return of, about, " and ".join(f"`{key}`" for key in LIMITS[asks.limits])


def plan() -> str:
    """Every key of ``[plan]``."""
    one = schema_named("job")["properties"]["plan"]
    ready = [
        (f"`{kind}`", ", ".join(f"`{plan}`" for plan in planning.ready))
        for kind in dict.fromkeys(known().values())
        if (found := kind_named(kind)) is not None and (planning := found.offers("plan", Planning)) is not None
    ]
    return page(
        "`[plan]` in job.toml, key by key",
        "A plan is a job whose recording may still be missing: its `job.toml` has all that [a job](job.md) has, and `[plan]`. "
        "`cmm-uq new plan` begins one. What a plan says and how it is made: [plans](../planning.md).",
        EDITORS.format(name="job"), keys_table(one), "## Ready plans",
        "The first of a kind is its usual one.", table(("kind", "`ready`"), ready),
    )  # fmt: skip


def truth() -> str:
    """Every key of truth.toml."""
    schema = schema_named("truth")
    return page(
        "truth.toml, key by key",
        "What `cmm-uq simulate JOB --truth FILE` draws a recording from. Parameters of every effect: "
        "[effects](../machine/effects.md).",
        EDITORS.format(name="truth"), keys_table(schema),
    )  # fmt: skip


def budget() -> str:
    """Every key of a budget's file."""
    keys = schema_named("budget")["properties"]
    ready = [(f"`{name}`", str(one.meaning)) for name, one in TABLES.items()]
    own = [(f"`{name}`", ", ".join(f"`{key}`" for key in taken)) for name, (taken, _) in DISTRIBUTIONS.items()]
    return page(
        "Budgets, key by key",
        "`cmm-uq budget FILE` evaluates a [model of one's own](../uncertainty/model-file.md) (`[model]`, `[inputs.NAME]`, "
        "`[correlation]`) or a [ready budget](../uncertainty/budgets.md) (`[budget]`). `cmm-uq new budget` begins one.",
        EDITORS.format(name="budget"),
        "## `[model]`", keys["model"]["description"], keys_table(keys["model"]),
        "## `[inputs.NAME]`", keys["inputs"]["description"], keys_table(keys["inputs"]["additionalProperties"]),
        "Which keys a distribution takes:", table(("`distribution`", "keys"), own),
        "## `[correlation]`", keys["correlation"]["description"],
        "## `[budget]`", keys["budget"]["description"], table(("`method`", "what for"), ready),
        keys_table(keys["budget"], asked="methods"),
    )  # fmt: skip


def instrument() -> str:
    """Every key of an instrument's profile."""
    schema = schema_named("instrument")
    parts = [
        "How an instrument speaks: [profiles of instruments](../instruments/profiles.md). `cmm-uq instruments new FILE` "
        "writes one from an example line.",
        EDITORS.format(name="instrument"),
        "Bytes are written as manuals write them: `<ESC>A0200<CR>`, any byte as `<0x41>`.",
        keys_table({"properties": {name: one for name, one in schema["properties"].items() if not _is_table(one)},
                    "required": schema["required"]}),
    ]  # fmt: skip
    for name, one in schema["properties"].items():
        if _is_table(one):
            inside = one.get("additionalProperties")
            shown = inside if isinstance(inside, dict) else one
            title = f"[{name}.NAME]" if shown is inside else header(name, one)
            parts += [f"## `{title}`", one["description"], keys_table(shown)]
    return page("Profile of an instrument, key by key", *parts)


def schedule() -> str:
    """Every key of schedule.toml."""
    schema = schema_named("schedule")
    parts = [
        "What `cmm-uq report --scheduled` goes by, and whom it tells: [scheduled runs](../records/scheduled.md). `cmm-uq "
        "schedule new FILE` writes one; every table may be left out, and every key that is not said to be needed.",
        EDITORS.format(name="schedule"),
        "Paths are relative to the file. No secret stands in it: keys that end in `_variable` name a variable of the "
        "environment.",
    ]
    for name, one in schema["properties"].items():
        parts += [f"## `{header(name, one)}`", one["description"], keys_table(one)]
    return page("schedule.toml, key by key", *parts)


def ready_profiles() -> str:
    """Every ready profile with what it rests on."""
    found = [profile_named(name) for name in ready()]
    rows = [(f"[`{one.name}`](#{one.name})", one.title, _spoken(one)) for one in found]
    parts = [
        "Each by its manuals; what these do not say is assumed. None was tried on real hardware. `cmm-uq instruments list` "
        "lists them; a profile of your own may begin as a copy, from `cmm_uq/laboratory/live/instruments/profiles`.",
        table(("profile", "instrument", "line"), rows),
    ]  # fmt: skip
    for one in found:
        asked = ", ".join(f"`{poll.send}`" for poll in one.send.poll)
        how = f"polled by {asked} every {one.send.every_s:g} s" if asked else "listened to"
        said = [
            ("quantities", ", ".join(f"`{name}`" for name in sorted(one.named(), key=_numbered))),
            ("line", how if one.protocol == "messages" else "[I++ DME](ipp.md)"),
            *(("source", text) for text in one.facts.sources),
            *(("not found", text) for text in one.facts.not_found),
            *([("tried on", one.facts.tried)] if one.facts.tried != ProfileFacts().tried else []),
        ]
        parts += [f"## {one.name}", f"{one.title}.", table(("", ""), said)]
    return page("Ready profiles", *parts)


def _spoken(one: ProfileFile) -> str:
    if pt104.SCHEME in one.title:
        return "UDP"
    line = one.connection
    return (
        f"{line.baud} {line.data_bits}{line.parity[0].upper()}{line.stop_bits}"
        if one.protocol == "messages"
        else "TCP 1294"
    )


def _numbered(name: str) -> tuple[str, int]:
    digits = "".join(c for c in name if c.isdigit())
    return name.translate({ord(c): None for c in "0123456789"}), int(digits or 0)


def _is_table(one: Mapping[str, Any]) -> bool:
    inside = one.get("additionalProperties")
    return "properties" in one or isinstance(inside, dict) or "properties" in one.get("items", {})


def columns() -> str:
    """Every column of a recording."""
    begun = {name: _beginning(name) for name in known()}
    needed = {name: (*one.columns, *one.further) for name, one in begun.items()}
    own = {name: told for one in begun.values() for name, told in {**one.columns, **one.further}.items() if told}
    effects: dict[str, list[str]] = {}
    for effect in EVERY.values():
        for column in effect.columns:
            effects.setdefault(column, []).append(effect.name)
    rows = [
        (
            f"`{name}`", unit_of(name) or "–", told,
            "all" if name in REQUIRED else ", ".join(f"`{k}`" for k, given in needed.items() if name in given) or "–",
            ", ".join(f"`{effect}`" for effect in effects.get(name, ())) or "–",
        )
        for name, told in {**COLUMNS, **own}.items()
    ]  # fmt: skip
    kinds = [
        (
            f"`{name}`", one.numbering,
            ", ".join(f"`{c}`" for c in one.columns) or "–", ", ".join(f"`{c}`" for c in one.further) or "–",
        )
        for name, one in begun.items()
    ]  # fmt: skip
    return page(
        "The columns of a recording",
        "A recording is a CSV in UTF-8 with one row a point; lines that begin with # are passed over. Any other numeric "
        "column is a covariate: not used by the model, but searched when a mismatch is located.",
        "## Kinds",
        f"Every recording has {', '.join(f'`{name}`' for name in REQUIRED)}.",
        table(("kind", "what the numbers mean", "needs besides", "may have"), kinds),
        "## Columns", table(("column", "unit", "meaning", "kinds", "effects that go by it"), rows),
    )  # fmt: skip


def results() -> str:
    """Every key of results.json that every kind with an artefact has."""
    rows = [(f"`{name}`", unit_of(name) or "–", told) for name, told in RESULTS.items()]
    return page(
        "results.json of `cmm-uq report`, key by key",
        "Schema `cmm-uq/results/1`. A part in capitals stands for any name, `[]` for each entry of a list. Numbers are "
        "finite; what has no value is `null`. Kinds add keys of their own beside these, and a kind with an analysis of its "
        "own (`shift`, `error_map`) has some of them only.",
        "A *quantity* is a table of", table(("key", "meaning"), [(f"`{name}`", told) for name, told in QUANTITY.items()]),
        "## Keys", table(("key", "unit", "meaning"), rows),
    )  # fmt: skip


def part_results() -> str:
    """Every key of results.json of a part."""
    rows = [(f"`{name}`", unit or "–", told) for name, (unit, told) in PART_RESULTS.items()]
    return page(
        "results.json of `cmm-uq part`, key by key",
        "Schema `cmm-uq/part/1`. A part in capitals stands for any name, `[]` for each entry of a list. Numbers are finite; "
        "what has no value is `null`. Shares and probabilities go from 0 to 1.",
        table(("key", "unit", "meaning"), rows),
    )  # fmt: skip


def prove() -> str:
    """Every key of results.json of a proof."""
    rows = [(f"`{name}`", told) for name, told in PROOF.items()]
    return page(
        "results.json of `cmm-uq prove`, key by key",
        "Schema `cmm-uq/prove/1`. A part in capitals stands for any name, `[]` for each entry of a list. Numbers are finite; "
        "what has no value is `null`. How it comes about: [proof on one's own set-ups](../proving.md).",
        "A *rate* is a table of", table(("key", "meaning"), [(f"`{name}`", told) for name, told in RATE.items()]),
        "## Keys", table(("key", "meaning"), rows),
    )  # fmt: skip


def commands() -> str:
    """Every command with its arguments and options, from the help that it prints."""
    parts = [f"{app.info.help}", *ended(str(app.info.epilog)), "`cmm-uq COMMAND --help` prints what stands here."]
    groups = [(group.name, group.typer_instance) for group in app.registered_groups]
    inside = [(f"{name} ", one) for name, group in groups if group for one in group.registered_commands]
    for prefix, command in [*(("", one) for one in app.registered_commands), *inside]:
        rows = list(_parameters(command))
        arguments = " ".join(name for name, _, _ in rows if not name.startswith("`-"))
        usage = f"cmm-uq {prefix}{command.name} {arguments.replace('`', '')}".strip()
        told = " ".join((inspect.getdoc(command.callback) or "").split())
        parts += [f"## `{usage}`", told, table(("argument or option", "meaning", "default"), rows)]
        parts += ended(str(command.epilog))
    return page("Commands", *parts)


def ended(epilog: str) -> list[str]:
    """What stands at the end of a help: text, and calls as they are typed."""
    told, _, calls = epilog.partition("\b\nExamples:\n")
    return [*filter(None, [told.strip()]), f"```text\n{textwrap.dedent(calls)}\n```"]


def header(name: str, one: Mapping[str, Any]) -> str:
    """Of a table, or of several of one name."""
    return f"[[{name}]]" if one.get("type") == "array" else f"[{name}]"


def keys_table(one: Mapping[str, Any], asked: str = "") -> str:
    """Every key of a table, also of tables in it."""
    whole = one["items"] if one.get("type") == "array" else one
    given = {name: key["x-for"] for name, key in whole["properties"].items() if "x-for" in key}
    rows = []
    for name, key in keys_of(whole):
        top = name.partition(".")[0].removesuffix("[]")
        kinds = ", ".join(f"`{kind}`" for kind in given[top]) if top in given else ALL
        told = without_place(key["description"])
        choices = key.get("enum") or next((part["enum"] for part in key.get("anyOf", ()) if "enum" in part), ())
        choices = [choice for choice in choices if choice != "" and len(choices) > 1]
        told += f" One of {', '.join(f'`{choice}`' for choice in choices)}." if choices else ""
        cells = [f"`{name}`", key.get("x-unit", "–"), _default(whole, name, key), told]
        rows.append([*cells[:3], kinds, cells[3]] if asked else cells)
    headings = ["key", "unit", "default", "meaning"]
    return table([*headings[:3], asked, headings[3]] if asked else headings, rows)


def _default(whole: Mapping[str, Any], name: str, key: Mapping[str, Any]) -> str:
    if "default" in key:
        return f"`{written(key['default'])}`" if key["default"] not in ("", [], {}) else "–"
    inside: Any = whole
    *parents, last = name.split(".")
    for parent in parents:
        found = inside.get("properties", {}).get(parent.removesuffix("[]"), {})
        tables = (found, found.get("items", {}), *found.get("anyOf", ()), found.get("additionalProperties") or {})
        inside = next((part for part in tables if isinstance(part, dict) and "properties" in part), {})
    needed = set(inside.get("required", ())) or set()
    return "needed" if last in needed else "–"


def _beginning(name: str) -> Beginning:
    kind = kind_named(known()[name])
    assert kind is not None
    return kind.beginning(name)


def _parameters(command: CommandInfo) -> Iterable[tuple[str, str, str]]:
    """Name, meaning and default of each argument and option."""
    assert command.callback is not None
    for name, parameter in inspect.signature(command.callback, eval_str=True).parameters.items():
        info, switch = parameter.default, parameter.annotation
        declared = [one for one in info.param_decls or () if one.startswith("-")]
        names = declared or [f"--{name.replace('_', '-')}", *([f"--no-{name}"] if info.default is True else [])]
        shown = f"`{name.upper()}`" if isinstance(info, ArgumentInfo) else ", ".join(f"`{one}`" for one in names)
        plain, told = isinstance(info.default, (int, float)) and switch is not bool, " ".join((info.help or "").split())
        if isinstance(info.show_default, str):
            yield shown, told, f"`{info.show_default}`" if "<" in info.show_default else info.show_default
        else:
            yield shown, told, f"`{info.default}`" if plain else "–"


def main() -> None:
    """Write them."""
    for path, made in files().items():
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(made(), encoding="utf-8")


if __name__ == "__main__":
    main()
