"""What the docstrings and the page of the API show is run, and gives what they say."""

from __future__ import annotations

import doctest
import re
from importlib import import_module
from pathlib import Path

import pytest

from tests.conftest import ROOT

PAGE = ROOT / "docs" / "api.md"


@pytest.mark.parametrize(("module", "least"), [("cmm_uq", 3), ("cmm_uq.api.calls", 10), ("cmm_uq.api.beginning", 4)])
def test_the_examples_of_the_docstrings_hold(module: str, least: int, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(ROOT)
    ran = doctest.testmod(import_module(module), raise_on_error=False)
    assert ran.attempted >= least
    assert ran.failed == 0


def test_the_page_runs_from_top_to_bottom(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "examples").symlink_to(ROOT / "examples")
    monkeypatch.chdir(tmp_path)
    text = PAGE.read_text(encoding="utf-8")
    test = doctest.DocTestParser().get_doctest(
        "\n".join(re.findall(r"```python\n(.*?)```", text, re.DOTALL)), {}, "api.md", str(PAGE), 0
    )
    assert len(test.examples) > 15
    assert doctest.DocTestRunner(optionflags=doctest.NORMALIZE_WHITESPACE | doctest.ELLIPSIS).run(test).failed == 0
