"""The site, built once for all its tests."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest

from start import SITE
from tests.conftest import ROOT


@pytest.fixture(scope="session")
def site(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """As ``python3 start.py docs`` builds it, with every warning an error."""
    folder = tmp_path_factory.mktemp("site")
    built = subprocess.run(
        [sys.executable, "-m", "sphinx", *SITE, "--doctree-dir", str(folder / "read"), ".", str(folder / "site")],
        cwd=ROOT, capture_output=True, text=True, check=False,
    )  # fmt: skip
    assert built.returncode == 0, built.stderr
    return folder / "site"
