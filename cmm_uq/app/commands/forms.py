"""What a laboratory fills in: JSON Schema of every file that is read, and the form of a standard, clause by clause.

Kinds, effects and standards of other packages are in them; the form is held against the laboratory's own copy.
"""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping, Sequence
from functools import partial
from importlib import import_module
from importlib.resources import files
from pathlib import Path
from types import MappingProxyType
from typing import Any

from cmm_uq import __version__
from cmm_uq.analysis.conformity import standards
from cmm_uq.analysis.conformity.statement import Clause
from cmm_uq.app.commands.reading import read_job
from cmm_uq.artefacts import names, table_of
from cmm_uq.base.errors import CmmUqError, suggestion
from cmm_uq.base.output.manifest import refuse_taken, write_new
from cmm_uq.base.plugins import EFFECTS, KINDS, STANDARDS, Plugin, naming_package, offered
from cmm_uq.jobs.schema import DRAFT, Schema, chosen_by, job_schema, schema_of
from cmm_uq.jobs.tables.artefact import ArtefactFacts
from cmm_uq.machine.physics.catalogue import every
from cmm_uq.machine.physics.effect import Effect, Parameter
from cmm_uq.machine.physics.stated import physics_of


def tables() -> dict[str, type[ArtefactFacts]]:
    return {kind: table for kind in names() if (table := table_of(kind)) is not None}


def job() -> Schema:
    """Of job.toml, ``[plan]`` with it: what an effect is, its formula, and the columns that it needs."""
    effects = {
        name: f"{effect.title}: {effect.formula}"
        + (f"; needs the columns {', '.join(effect.columns)}." if effect.columns else ".")
        for name, effect in every().items()
    }
    return job_schema(tables(), effects, standards.names())


def budget() -> Schema:
    from cmm_uq.maths.uncertainty.budgets.tables import TABLES
    from cmm_uq.maths.uncertainty.models.model_file import ModelFileTable

    ready = {name: schema_of(table) for name, table in TABLES.items()}
    own = schema_of(ModelFileTable)
    told = "A ready budget by its method, in place of `[model]` and `[inputs]`."
    return {
        "$schema": DRAFT, "title": "budget file of cmm-uq", "type": "object", "additionalProperties": False,
        "properties": {**own["properties"], "budget": {"description": told, **chosen_by("method", ready, "Methods")}},
        "oneOf": [{"required": ["model", "inputs"]}, {"required": ["budget"]}],
    }  # fmt: skip


def _of_table(place: str, title: str) -> Schema:
    module, _, table = place.partition(":")
    return schema_of(getattr(import_module(f"cmm_uq.{module}"), table), title)


SCHEMAS: Mapping[str, Callable[[], Schema]] = MappingProxyType({
    "job": job, "part": partial(_of_table, "jobs.part.tables:PartFile", "job.toml of a part, for cmm-uq"),
    "budget": budget, "truth": partial(_of_table, "jobs.derived_job:Truth", "truth.toml of cmm-uq"),
    "instrument": partial(_of_table, "laboratory.live.instruments.profile:ProfileFile", "instrument profile of cmm-uq"),
    "schedule": partial(_of_table, "laboratory.schedule.settings:ScheduleFile", "schedule.toml of cmm-uq"),
})  # fmt: skip
"""By name; the module of a file's table is imported when its schema is asked for."""


@naming_package()
def schema_named(name: str) -> Schema:
    if name not in SCHEMAS:
        raise CmmUqError(f"there is no schema {name!r}", fix=suggestion(name, SCHEMAS))
    return SCHEMAS[name]()


def shipped(name: str) -> str:
    """The text of a schema: as it comes with the package where nothing of other packages could be in it."""
    if any(offered(group, Plugin) for group in (EFFECTS, KINDS, STANDARDS)):
        return as_text(schema_named(name))
    return (files("cmm_uq") / "schemas" / f"{name}.schema.json").read_text(encoding="utf-8")


def as_text(schema: Mapping[str, Any]) -> str:
    return json.dumps(schema, indent=1, ensure_ascii=False) + "\n"


@naming_package()
def listed_effects(word: str = "", job: Path | None = None) -> list[dict[str, str]]:
    """Every effect, with what a job states of its own: all that have a word anywhere; a ``CmmUqError`` where none has."""
    with physics_of(None if job is None else read_job(job, recorded=False)):
        found = [_said(effect) for effect in every().values()]
    chosen = [one for one in found if any(word.casefold() in said.casefold() for said in one.values())]
    if not chosen:
        known = {part for one in found for part in (one["name"], one["mechanism"], *one["name"].split("_")) if part[2:]}
        raise CmmUqError(f"no effect has {word!r} in it", where="cmm-uq effects", fix=suggestion(word, known))
    return chosen


def _said(effect: Effect) -> dict[str, str]:
    parameters = []
    for one in effect.reported:
        size = f"±{one.prior_sd:g}" if isinstance(one, Parameter) else f"{one.low:g} to {one.high:g}"
        parameters.append(f"{one.name} {size} {one.unit}".removesuffix(" 1"))
    told = {"name": effect.name, "title": str.__str__(effect.title), "formula": effect.formula}
    told |= {"parameters": ", ".join(parameters), "columns": ", ".join(effect.columns)}
    return told | {"mechanism": effect.mechanism, "points_to": str.__str__(effect.points_to)}


@naming_package()
def listed_standards() -> list[tuple[str, tuple[str, ...]]]:
    """Every standard with its characteristics, then the documents that decisions and budgets go by, which have none."""
    found: list[tuple[str, tuple[str, ...]]] = []
    for name in (*standards.names(), *(name for name in standards.CLAUSES if name not in standards.names())):
        standard = standards.standard_named(name)
        found.append((name, () if standard is None else tuple(one.name for one in standard.characteristics)))
    return found


@naming_package()
def clauses_of(name: str) -> Sequence[Clause]:
    standard = standards.standard_named(name)
    found = standards.CLAUSES.get(name, ()) if standard is None else standard.clauses
    if not found:
        known = [other for other, _ in listed_standards()]
        problem = "has no clauses here" if name in known else f"no standard {name!r} is decided"
        raise CmmUqError(problem, where=name, fix=suggestion(name, [other for other in known if other != name]))
    return found


def form(name: str) -> str:
    clauses = clauses_of(name)
    parts = [
        f"# Clauses of {name} as cmm-uq {__version__} takes them. Hold each against your own copy and answer it; then\n"
        '# name this file in job.toml: [[conformity]] clauses = "FILE". What stays unanswered counts as unread.\n\n'
        f"standard = {_quoted(name)}\n"
        'checked_by = ""     # who held the clauses against the copy\n'
        "# on = 2026-01-31    # when\n"
        'edition = ""        # of the copy, as on its title page\n'
    ]
    parts += [
        f"\n[clauses.{one.name}]    # {one.title}; words of the standard {'' if one.read else 'not '}read by who wrote this\n"
        f"does = {_quoted(one.does)}\n"
        f"source = {_quoted(one.source)}\n"
        '# agrees = true      # or: agrees = false with differs = "how"; stricter = true where this program asks for more\n'
        '# clause = ""        # its number in the copy\n'
        for one in clauses
    ]
    return "".join(parts)


def write_form(name: str, file: Path) -> Path:
    content = form(name)
    refuse_taken(file)
    write_new(file, content.encode())
    return file


def _quoted(text: str) -> str:
    return json.dumps(text, ensure_ascii=False)
