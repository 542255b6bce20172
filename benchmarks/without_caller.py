"""Public functions and classes of the package that nothing but tests uses.

Run:  python benchmarks/without_caller.py

A name counts as used when it stands, as a name, an attribute or a string of an entry point ("module:NAME"), anywhere else in
the package, in pyproject.toml, or in what __all__ of the package offers. Methods are not looked at.
"""

from __future__ import annotations

import ast
from collections import Counter
from pathlib import Path

ROOT = Path(__file__).parents[1]


def definitions(tree: ast.Module) -> list[str]:
    """Public functions and classes at the top of a module."""
    kinds = (ast.FunctionDef, ast.ClassDef)
    return [node.name for node in tree.body if isinstance(node, kinds) and not node.name.startswith("_")]


def uses(tree: ast.Module) -> Counter[str]:
    """How often each name is used in a module, its own definitions and imports aside."""
    found: Counter[str] = Counter()
    for node in ast.walk(tree):
        if isinstance(node, ast.Name):
            found[node.id] += 1
        elif isinstance(node, ast.Attribute):
            found[node.attr] += 1
        elif isinstance(node, ast.Constant) and isinstance(node.value, str) and ":" in node.value:
            found[node.value.rpartition(":")[2]] += 1
    return found


def offered(tree: ast.Module) -> Counter[str]:
    """Names in a module's ``__all__``."""
    names = [
        element.value
        for node in tree.body
        if isinstance(node, ast.Assign) and any(isinstance(t, ast.Name) and t.id == "__all__" for t in node.targets)
        for element in ast.walk(node.value)
        if isinstance(element, ast.Constant)
    ]
    return Counter(str(name) for name in names)


def without_caller() -> list[tuple[str, str]]:
    """Module and name of each."""
    trees = {path: ast.parse(path.read_text(encoding="utf-8")) for path in sorted((ROOT / "cmm_uq").rglob("*.py"))}
    used = sum((uses(tree) for tree in trees.values()), Counter[str]())
    used += offered(trees[ROOT / "cmm_uq" / "__init__.py"])
    outside = (ROOT / "pyproject.toml").read_text(encoding="utf-8")
    return [
        (str(path.relative_to(ROOT)), name)
        for path, tree in trees.items()
        for name in definitions(tree)
        if not used[name] and f":{name}" not in outside
    ]


if __name__ == "__main__":
    for module, name in without_caller():
        print(f"{module}: {name}")
