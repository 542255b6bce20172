"""What is generated from the tables of the readers is as new as they are."""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.conftest import ROOT
from tests.reference_pages import files


@pytest.mark.parametrize("path", files(), ids=lambda path: str(path.relative_to(ROOT)))
def test_a_generated_file_says_what_the_readers_take(path: Path) -> None:
    """``python -m tests.reference_pages`` writes it anew."""
    assert path.read_text(encoding="utf-8") == files()[path]
