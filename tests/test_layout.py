"""The package is laid out as docs/layout.md says: domains in order, no circles, a class a name, few and full files."""

from __future__ import annotations

import ast
import re
import sys
from collections import Counter, defaultdict
from collections.abc import Iterator
from functools import cache
from importlib import import_module
from pathlib import Path

from cmm_uq.artefacts import BUILT_IN
from tests.conftest import ROOT
from tests.sources import nodes_of

PACKAGE = ROOT / "cmm_uq"
PAGE = (ROOT / "docs" / "layout.md").read_text(encoding="utf-8").partition("A domain imports")[0]
TABLE = re.findall(r"^\| `(\w+)` \| (.*) \|$", PAGE, re.MULTILINE)
DOMAINS = [name for name, _ in TABLE]
FILES = sorted(PACKAGE.rglob("*.py"))
KNOW_KINDS = {"artefacts", "app"}
"""Domains that know all kinds; a plane and a sphere are features of geometry, of parts and of plans of parts too."""
SHAPES_TOO = ("maths/geometry", "analysis/parts", "jobs/part")
MAY_BE_SHORT = re.compile(r"\.app\.|\.artefacts\.|\.effects\.|\.importing\.|\.profiles\.|\.standards|\.reference\.")
"""Commands, kinds, effects, formats, profiles, standards and reference cases are a file each, however short."""
CEILING = {
    "": 134, "base": 3_533, "maths": 11_051, "jobs": 19_443, "machine": 7_805, "analysis": 21_905, "laboratory": 14_766,
    "certificate": 16_680, "artefacts": 13_914, "app": 18_846,
}  # fmt: skip
"""Lines a domain may have; lowered whenever one has fewer."""
OWN_IMPORTS_INSIDE, FORMATTED_BY_HAND = 220, 1458
"""Imports of the package within functions, and exemptions from the formatter: only falling."""
LOADED_LATE = {
    "arviz", "asn1crypto", "asyncio", "contourpy", "cryptography", "ctypes", "defusedxml", "emcee", "fcntl",
    "hashlib", "importlib", "jinja2", "json", "lxml", "markupsafe", "matplotlib", "msvcrt", "numpy", "openpyxl",
    "pandas", "pint", "pkcs11", "pty", "pydantic", "pyhanko", "pyhanko_certvalidator", "pypdf", "pyvisa", "resource", "rich",
    "scipy", "serial", "signxml", "sqlalchemy", "termios", "tty", "typst", "uncertainties", "webbrowser",
    "xmlschema",
}  # fmt: skip
"""Packages that are imported where they are used: extras, and heavy libraries that a quick command does without."""


def module_of(path: Path) -> str:
    parts = path.relative_to(ROOT).with_suffix("").parts
    return ".".join(parts[:-1] if parts[-1] == "__init__" else parts)


MODULES = {module_of(path): path for path in FILES}


def for_types_only(path: Path) -> set[ast.AST]:
    blocks = (node for node in nodes_of(path) if isinstance(node, ast.If) and "TYPE_CHECKING" in ast.dump(node.test))
    return {node for block in blocks for node in ast.walk(block)}


@cache
def imports(module: str) -> frozenset[str]:
    """The modules of the package that a module imports, anywhere in it but for types."""
    passed = for_types_only(MODULES[module])
    found = set()
    for node in nodes_of(MODULES[module]):
        if isinstance(node, ast.ImportFrom) and (node.module or "").startswith("cmm_uq") and node not in passed:
            inner = {f"{node.module}.{alias.name}" for alias in node.names}
            found |= {name if name in MODULES else str(node.module) for name in inner}
    return frozenset(found - {module})


def domain_of(module: str) -> str:
    return [*module.split("."), ""][1]


def circles() -> Iterator[set[str]]:
    """Sets of modules that import each other: strongly connected components (Tarjan, SIAM J. Comput. 1 (1972) 146)."""
    index: dict[str, int] = {}
    low: dict[str, int] = {}
    stack: list[str] = []

    def visit(module: str) -> Iterator[set[str]]:
        index[module] = low[module] = len(index)
        stack.append(module)
        for other in imports(module):
            if other not in index:
                yield from visit(other)
                low[module] = min(low[module], low[other])
            elif other in stack:
                low[module] = min(low[module], index[other])
        if low[module] == index[module]:
            place = stack.index(module)
            members = set(stack[place:])
            del stack[place:]
            if len(members) > 1:
                yield members

    sys.setrecursionlimit(10_000)
    for module in MODULES:
        if module not in index:
            yield from visit(module)


def test_every_domain_is_in_the_table() -> None:
    assert {domain_of(module) for module, path in MODULES.items() if path.parent != PACKAGE} == set(DOMAINS)


def test_a_domain_imports_from_those_above_it() -> None:
    inside = [module for module in MODULES if domain_of(module) in DOMAINS]
    pairs = [(module, other) for module in inside for other in imports(module) if domain_of(other) in DOMAINS]
    below = [pair for pair in pairs if DOMAINS.index(domain_of(pair[1])) > DOMAINS.index(domain_of(pair[0]))]
    assert not below


def test_no_files_import_each_other_in_a_circle() -> None:
    assert not [sorted(circle) for circle in circles()]


def test_a_public_class_has_a_name_of_its_own() -> None:
    places = defaultdict(list)
    for module, path in MODULES.items():
        for node in nodes_of(path):
            if isinstance(node, ast.ClassDef) and not node.name.startswith("_"):
                places[node.name].append(module)
    assert not {name: modules for name, modules in places.items() if len(modules) > 1}


def test_no_folder_has_more_entries_than_are_taken_in_at_a_glance() -> None:
    kept = {path for path in PACKAGE.rglob("*") if path.is_file() and "__pycache__" not in path.parts}
    entries = {entry for path in kept for entry in (path, *path.parents) if PACKAGE in entry.parents}
    counts = Counter(entry.parent for entry in entries if entry.name != "__init__.py")
    assert not {folder.relative_to(ROOT): count for folder, count in counts.items() if count > 20}


def lines_of(path: Path) -> int:
    return path.read_text(encoding="utf-8").count("\n")


def test_no_file_is_too_long_to_read_at_one_sitting() -> None:
    assert not {module: lines for module, path in MODULES.items() if (lines := lines_of(path)) > 400}


def test_no_file_is_a_slice_of_its_only_neighbour() -> None:
    """A module whose only importer stands in its own folder has something to say by itself: at least 80 lines."""
    importers = defaultdict(set)
    for module in MODULES:
        for other in imports(module):
            importers[other].add(module)
    slices = {
        module: next(iter(importers[module]))
        for module, path in MODULES.items()
        if len(importers[module]) == 1 and path.name != "__init__.py" and not MAY_BE_SHORT.search(module)
        and MODULES[next(iter(importers[module]))].parent == path.parent and lines_of(path) < 80
    }  # fmt: skip
    assert not slices


def test_imports_stand_at_the_top() -> None:
    functions = [node for module in MODULES for node in nodes_of(MODULES[module])
                 if isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef)]  # fmt: skip
    within = [node for function in functions for node in ast.walk(function)]
    inside = Counter(node.module or "" for node in within if isinstance(node, ast.ImportFrom))
    inside.update(node.names[0].name for node in within if isinstance(node, ast.Import))
    own = sum(count for name, count in inside.items() if name.split(".")[0] == "cmm_uq")
    assert own <= OWN_IMPORTS_INSIDE
    assert {name.split(".")[0] for name in inside} - {"cmm_uq"} <= LOADED_LATE


def test_what_benchmarks_import_of_the_package_is_there() -> None:
    imported = {
        (node.module, alias.name)
        for path in (ROOT / "benchmarks").rglob("*.py")
        for node in nodes_of(path)
        if isinstance(node, ast.ImportFrom) and (node.module or "") in MODULES
        for alias in node.names
    }
    assert not [
        (module, name)
        for module, name in imported
        if f"{module}.{name}" not in MODULES and not hasattr(import_module(str(module)), name)
    ]


def test_the_package_does_not_grow() -> None:
    """As ``wc -l`` counts: what comes is paid for by what goes."""
    lines: Counter[str] = Counter()
    for module, path in MODULES.items():
        lines[domain_of(module) if domain_of(module) in DOMAINS else ""] += lines_of(path)
    assert not {domain: count for domain, count in lines.items() if count > CEILING[domain]}
    assert sum(path.read_text(encoding="utf-8").count("# fmt: skip") for path in FILES) <= FORMATTED_BY_HAND


def test_no_domain_below_knows_a_kind_by_name() -> None:
    """Only the kinds themselves, their registry and the commands do."""
    asked = [path for path in FILES if domain_of(module_of(path)) not in KNOW_KINDS
             and not path.relative_to(PACKAGE).as_posix().startswith(SHAPES_TOO)]  # fmt: skip
    named = {path: {node.value for node in nodes_of(path) if isinstance(node, ast.Constant)} for path in asked}
    assert not {module_of(path): names & set(BUILT_IN) for path, names in named.items() if names & set(BUILT_IN)}
