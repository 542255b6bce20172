"""docs/report.md shows the function that computes a report, and each of its steps with what it rests on."""

from __future__ import annotations

import ast
import inspect
import re
import textwrap

from cmm_uq.app.commands.report import evaluate
from tests.conftest import ROOT

PAGE = ROOT / "docs" / "report.md"
BUILT_IN = {
    "partial",
    "tuple",
    "enumerate",
    "must_be_finite",
    "named_draws",
    "parameters",
    "sizes",
    "noise",
    "noise_of",
    "observing",
    "contradictions",
    "together",
}


def test_the_page_shows_the_function_as_it_is() -> None:
    assert f"```text\n{inspect.getsource(evaluate)}```" in PAGE.read_text(encoding="utf-8")


def test_every_step_has_a_row_and_every_row_is_a_step() -> None:
    rows = re.findall(r"^\| `(\w+)` \|", PAGE.read_text(encoding="utf-8"), re.MULTILINE)
    tree = ast.parse(textwrap.dedent(inspect.getsource(evaluate)))
    calls = {node.func.id for node in ast.walk(tree) if isinstance(node, ast.Call) and isinstance(node.func, ast.Name)}
    assert set(rows) <= calls
    assert calls - set(rows) <= BUILT_IN


def test_the_function_is_read_in_one_sitting_and_its_steps_follow_in_order() -> None:
    source = inspect.getsource(evaluate)
    assert len(source.splitlines()) <= 60
    rows = re.findall(r"^\| `(\w+)` \|", PAGE.read_text(encoding="utf-8"), re.MULTILINE)
    places = [re.search(rf"\b{row}\(", source).start() for row in rows]  # type: ignore[union-attr]
    assert places == sorted(places)


def test_every_link_of_the_page_leads_to_a_file() -> None:
    links = re.findall(r"\]\(([^)#]+)", PAGE.read_text(encoding="utf-8"))
    assert len(links) > 20
    assert [link for link in links if not (PAGE.parent / link).exists()] == []
