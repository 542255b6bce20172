"""JSON Schema of every file that is read, with the kinds, effects and standards that other packages offer."""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping
from importlib.resources import files
from types import MappingProxyType
from typing import Any

from cmm_uq.artefacts import names, table_of
from cmm_uq.base.errors import CmmUqError, suggestion
from cmm_uq.base.plugins import EFFECTS, KINDS, STANDARDS, Plugin, naming_package, offered
from cmm_uq.jobs.derived_job import Truth
from cmm_uq.jobs.schema import DRAFT, Schema, chosen_by, job_schema, schema_of
from cmm_uq.jobs.tables.artefact import ArtefactFacts
from cmm_uq.laboratory.live.instruments.profile import ProfileFile
from cmm_uq.laboratory.schedule.settings import ScheduleFile


def tables() -> dict[str, type[ArtefactFacts]]:
    """Table of ``[artefact]`` of each kind."""
    return {kind: table for kind in names() if (table := table_of(kind)) is not None}


def job() -> Schema:
    """Of job.toml, ``[plan]`` with it: what an effect is, its formula, and the columns that it needs."""
    from cmm_uq.analysis.conformity.standards import names as standard_names
    from cmm_uq.machine.physics.catalogue import every

    effects = {
        name: f"{effect.title}: {effect.formula}"
        + (f"; needs the columns {', '.join(effect.columns)}." if effect.columns else ".")
        for name, effect in every().items()
    }
    return job_schema(tables(), effects, standard_names())


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


def part() -> Schema:
    from cmm_uq.jobs.part.tables import PartFile

    return schema_of(PartFile, "job.toml of a part, for cmm-uq")


SCHEMAS: Mapping[str, Callable[[], Schema]] = MappingProxyType({
    "job": job, "part": part, "budget": budget, "truth": lambda: schema_of(Truth, "truth.toml of cmm-uq"),
    "instrument": lambda: schema_of(ProfileFile, "instrument profile of cmm-uq"),
    "schedule": lambda: schema_of(ScheduleFile, "schedule.toml of cmm-uq"),
})  # fmt: skip


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
