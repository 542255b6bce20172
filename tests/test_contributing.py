"""The code that CONTRIBUTING.md shows is the code that the tests run."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

from tests.conftest import ROOT
from tests.plugin.packages import OUTSIDE_EFFECTS, OUTSIDE_KINDS, OUTSIDE_STANDARDS

SHOWN = re.findall(r"```(?:python|toml)\n(.*?)```", (ROOT / "CONTRIBUTING.md").read_text(encoding="utf-8"), re.DOTALL)
EFFECT, KIND = OUTSIDE_EFFECTS / "outside_effects.py", OUTSIDE_KINDS / "tracker_length.py"
STANDARD = OUTSIDE_STANDARDS / "interim_check.py"


@pytest.mark.parametrize("source", [EFFECT, OUTSIDE_EFFECTS / "pyproject.toml", KIND, OUTSIDE_KINDS / "pyproject.toml",
                                    STANDARD, OUTSIDE_STANDARDS / "pyproject.toml"],
                         ids=lambda path: f"{path.parent.name}-{path.name}")  # fmt: skip
def test_what_is_shown_is_what_is_tested(source: Path) -> None:
    assert source.read_text(encoding="utf-8") in SHOWN


@pytest.mark.parametrize(
    ("source", "most"), [(EFFECT, 25), (KIND, 135), (STANDARD, 55)], ids=["effect", "kind", "standard"]
)
def test_an_outside_package_needs_no_more_lines(source: Path, most: int) -> None:
    assert len(source.read_text(encoding="utf-8").splitlines()) <= most
