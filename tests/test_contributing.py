"""The code that CONTRIBUTING.md shows is the code that the tests run."""

from __future__ import annotations

import re

import pytest

from tests.conftest import ROOT
from tests.plugin.packages import OUTSIDE

SHOWN = dict(re.findall(r"```(\w+)\n(.*?)```", (ROOT / "CONTRIBUTING.md").read_text(encoding="utf-8"), re.DOTALL))


@pytest.mark.parametrize(("language", "file"), [("python", "outside_effects.py"), ("toml", "pyproject.toml")])
def test_the_new_effect_that_is_shown_is_the_one_that_is_tested(language: str, file: str) -> None:
    assert SHOWN[language] == (OUTSIDE / file).read_text(encoding="utf-8")


def test_an_outside_effect_needs_no_more_than_thirty_lines() -> None:
    assert len((OUTSIDE / "outside_effects.py").read_text(encoding="utf-8").splitlines()) <= 30
