"""What modules of the project import, wherever in them: also in functions that no test calls."""

from __future__ import annotations

import ast
from functools import cache
from pathlib import Path

from tests.conftest import ROOT


def file_of(module: str) -> Path | None:
    """The source of a module of the project."""
    path = ROOT.joinpath(*module.split("."))
    return next((one for one in (path.with_suffix(".py"), path / "__init__.py") if one.is_file()), None)


@cache
def imports_of(module: str) -> frozenset[str]:
    """Modules named by its import statements; none of one that is not the project's."""
    file, found = file_of(module), set[str]()
    for node in ast.walk(ast.parse(file.read_text(encoding="utf-8"))) if file else ():
        if isinstance(node, ast.Import):
            found |= {one.name for one in node.names}
        elif isinstance(node, ast.ImportFrom):
            assert node.level == 0, f"{module}: a relative import"
            own = {f"{node.module}.{one.name}" for one in node.names}
            found |= {str(node.module), *(one for one in own if file_of(one))}
    return frozenset(found)


def packages_reached(*modules: str) -> set[str]:
    """Names of all packages that modules of the project import, and those that they import."""
    found, left = set[str](), set(modules)
    assert all(file_of(module) for module in modules)
    while left:
        found |= left
        left = {one for module in left for one in imports_of(module)} - found
    return {module.partition(".")[0] for module in found}
