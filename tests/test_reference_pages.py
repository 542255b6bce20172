"""What is generated from the tables of the readers is as new as they are."""

from __future__ import annotations

from pathlib import Path

import pytest

from cmm_uq.app.commands.jobs.new import known
from cmm_uq.artefacts import kind_named
from cmm_uq.jobs.columns import COLUMNS, OPTIONAL, REQUIRED
from cmm_uq.machine.physics.catalogue import EVERY
from tests.conftest import ROOT
from tests.reference_pages import files

FILES = files()


@pytest.mark.parametrize("path", FILES, ids=lambda path: str(path.relative_to(ROOT)))
def test_a_generated_file_says_what_the_readers_take(path: Path) -> None:
    """``python -m tests.reference_pages`` writes it anew."""
    assert path.read_text(encoding="utf-8") == FILES[path]()


def test_every_column_that_something_goes_by_has_a_sentence() -> None:
    for column in (*REQUIRED, *OPTIONAL, *(column for effect in EVERY.values() for column in effect.columns)):
        assert COLUMNS[column].endswith("."), column
    for name, of in known().items():
        kind = kind_named(of)
        assert kind is not None
        begin = kind.beginning(name)
        assert begin.numbering.endswith("."), name
        for column, told in {**begin.columns, **begin.further}.items():
            assert (told or COLUMNS[column]).endswith("."), column
