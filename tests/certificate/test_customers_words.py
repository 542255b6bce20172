"""A page for customers has no key of a job file: what a laboratory would state is said in words there."""

from __future__ import annotations

import json
import re
from collections.abc import Iterator
from dataclasses import replace
from functools import cache
from typing import Any

import pytest

from cmm_uq.app.commands.jobs.schemas import shipped
from cmm_uq.base.messages import Message, Text, Verbatim
from cmm_uq.certificate.document import Document
from tests.artefacts.simulated import document
from tests.certificate.saying import leaves
from tests.conftest import MACHINE_JOBS

REPORTED = sorted(
    path.name for path in MACHINE_JOBS
    if not path.name.startswith("plan-") and path.name not in ("iota-1102-maps", "iota-1102-20C-against-simulation")
)  # fmt: skip


@cache
def keys() -> re.Pattern[str]:
    """Keys that are no words: with an underscore, of any depth of the schema of a job; tables in brackets; job.toml."""

    def names(schema: Any) -> Iterator[str]:
        if isinstance(schema, dict):
            yield from (schema.get("properties") or {})
            for part in schema.values():
                yield from names(part)
        elif isinstance(schema, list):
            for part in schema:
                yield from names(part)

    every = {name for schema in ("job", "part") for name in names(json.loads(shipped(schema)))}
    joined = [*sorted(name for name in every if "_" in name), "job.toml", "temp_artefact_c", "time_s", "tip_x_mm"]
    tables = sorted(name for name in every if "_" not in name)
    return re.compile(rf"\b({'|'.join(map(re.escape, joined))})\b|\[\[?({'|'.join(map(re.escape, tables))})\b")


def customers(made: Document) -> Document:
    """Without the annex of opinions, the names of the files, and where they come from."""
    return replace(
        made, attachments=(), produced_by=Verbatim(""), sections=tuple(one for one in made.sections if not one.opinion)
    )


def said(text: Text) -> Iterator[str]:
    """What a text says by itself; what the user wrote, in whichever message, is the user's."""
    if isinstance(text, Message):
        yield re.sub(r"\{[^}]*\}", "", text.pattern)
        for argument in text.arguments.values():
            if isinstance(argument, Text):
                yield from said(argument)


def mentioned(made: Document) -> list[str]:
    return sorted({f"{found[0]}: {part}" for text in leaves(customers(made)) for part in said(text)
                   for found in keys().finditer(part)})  # fmt: skip


@pytest.mark.parametrize("name", REPORTED)
def test_no_key_of_a_job_file_stands_on_a_certificate(name: str) -> None:
    assert mentioned(document(name)) == []
