"""The package is laid out as docs/layout.md says: domains in their order, and kinds known by name only where they may be."""

from __future__ import annotations

import ast
import re
from functools import cache
from pathlib import Path

from cmm_uq.artefacts import BUILT_IN
from tests.conftest import ROOT

PACKAGE = ROOT / "cmm_uq"
PAGE = (ROOT / "docs" / "layout.md").read_text(encoding="utf-8").partition("A domain imports")[0]
TABLE = re.findall(r"^\| `(\w+)` \| (.*) \|$", PAGE, re.MULTILINE)
DOMAINS = [name for name, _ in TABLE]
FILES = sorted(PACKAGE.rglob("*.py"))
KNOW_KINDS = {"artefacts", "app"}
"""Domains that know all kinds; a plane and a sphere are features of geometry, of parts and of plans of parts too."""
SHAPES_TOO = ("maths/geometry", "analysis/parts", "jobs/part")


def module_of(path: Path) -> str:
    parts = path.relative_to(ROOT).with_suffix("").parts
    return ".".join(parts[:-1] if parts[-1] == "__init__" else parts)


MODULES = {module_of(path): path for path in FILES}


@cache
def tree_of(path: Path) -> ast.Module:
    return ast.parse(path.read_text(encoding="utf-8"))


def for_types_only(tree: ast.Module) -> set[ast.AST]:
    blocks = (node for node in ast.walk(tree) if isinstance(node, ast.If) and "TYPE_CHECKING" in ast.dump(node.test))
    return {node for block in blocks for node in ast.walk(block)}


@cache
def imports(module: str) -> frozenset[str]:
    """The modules of the package that a module imports, anywhere in it but for types."""
    tree = tree_of(MODULES[module])
    passed = for_types_only(tree)
    found = set()
    for node in ast.walk(tree):
        if isinstance(node, ast.ImportFrom) and (node.module or "").startswith("cmm_uq") and node not in passed:
            inner = {f"{node.module}.{alias.name}" for alias in node.names}
            found |= {name if name in MODULES else str(node.module) for name in inner}
    return frozenset(found - {module})


def domain_of(module: str) -> str:
    return [*module.split("."), ""][1]


def test_every_domain_is_in_the_table() -> None:
    assert {domain_of(module) for module, path in MODULES.items() if path.parent != PACKAGE} == set(DOMAINS)


def test_a_domain_imports_from_those_above_it() -> None:
    inside = [module for module in MODULES if domain_of(module) in DOMAINS]
    pairs = [(module, other) for module in inside for other in imports(module) if domain_of(other) in DOMAINS]
    below = [pair for pair in pairs if DOMAINS.index(domain_of(pair[1])) > DOMAINS.index(domain_of(pair[0]))]
    assert not below


def test_no_domain_below_knows_a_kind_by_name() -> None:
    """Only the kinds themselves, their registry and the commands do."""
    asked = [path for path in FILES if domain_of(module_of(path)) not in KNOW_KINDS
             and not path.relative_to(PACKAGE).as_posix().startswith(SHAPES_TOO)]  # fmt: skip
    named = {path: {node.value for node in ast.walk(tree_of(path)) if isinstance(node, ast.Constant)} for path in asked}
    assert not {module_of(path): names & set(BUILT_IN) for path, names in named.items() if names & set(BUILT_IN)}
