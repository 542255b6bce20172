"""The rooms of the package stand in the order of docs/layout.md, and every import goes to a room above."""

from __future__ import annotations

import ast
import re
from pathlib import Path

import pytest

from cmm_uq.kinds import BUILT_IN
from tests.conftest import ROOT

PACKAGE = ROOT / "cmm_uq"
ROWS = [line.split("|")[1] for line in (ROOT / "docs" / "layout.md").read_text(encoding="utf-8").splitlines()
        if line.startswith("| `")]  # fmt: skip
ORDER = {name.removesuffix(".py"): place for place, row in enumerate(ROWS) for name in re.findall(r"`([^`]+)`", row)}
KNOW_KINDS = ("kinds", "commands", "geometry", "parts")
MODULES = sorted(path for path in PACKAGE.rglob("*.py") if path.name not in ("__main__.py", "__init__.py"))


def room_of(path: Path) -> str:
    return path.relative_to(PACKAGE).parts[0].removesuffix(".py")


def imported(path: Path) -> set[str]:
    names = [node.module for node in ast.walk(ast.parse(path.read_text(encoding="utf-8")))
             if isinstance(node, ast.ImportFrom) and node.module]  # fmt: skip
    return {name.split(".")[1] for name in names if name.startswith("cmm_uq.")}


def test_every_room_is_in_the_table() -> None:
    assert {room_of(path) for path in MODULES} <= set(ORDER)


@pytest.mark.parametrize("path", MODULES, ids=lambda path: str(path.relative_to(PACKAGE)))
def test_a_module_imports_from_its_own_room_and_those_above(path: Path) -> None:
    room = room_of(path)
    below = {name for name in imported(path) - {room} if ORDER[name] > ORDER[room]}
    assert not below


def constants(tree: ast.AST) -> set[object]:
    return {node.value for node in ast.walk(tree) if isinstance(node, ast.Constant)}


@pytest.mark.parametrize("path", [path for path in PACKAGE.rglob("*.py")
                                  if room_of(path) not in KNOW_KINDS and path.parent != PACKAGE / "jobs" / "part"],
                         ids=lambda path: str(path.relative_to(PACKAGE)))  # fmt: skip
def test_no_room_below_knows_a_kind_by_name(path: Path) -> None:
    """Only the kinds themselves, their registry and the commands do; a plane and a sphere are features of geometry too."""
    tree = ast.parse(path.read_text(encoding="utf-8"))
    assert not constants(tree) & set(BUILT_IN)
    assert "kinds" not in imported(path)
