"""The notebooks run, and show what they find: written anew by ``python -m tests.site.notebooks``."""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.site.notebooks import NOTEBOOKS, executed, printed, read


@pytest.mark.long
@pytest.mark.parametrize("path", NOTEBOOKS, ids=lambda path: path.stem)
@pytest.mark.filterwarnings("ignore::DeprecationWarning")  # of the kernel's client
def test_a_notebook_finds_what_it_shows(path: Path) -> None:
    assert printed(executed(path)) == printed(read(path))
