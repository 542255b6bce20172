"""What several commands are tried on."""

from __future__ import annotations

import shutil
from pathlib import Path

import pytest

from tests.app.cli.laboratory import reported


@pytest.fixture(scope="session")
def reported_once(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A laboratory with one report; not to be changed."""
    return reported(tmp_path_factory.mktemp("laboratory"))


@pytest.fixture
def laboratory(reported_once: Path, tmp_path: Path) -> Path:
    """A copy of it to work in."""
    return Path(shutil.copytree(reported_once, tmp_path / "laboratory"))
