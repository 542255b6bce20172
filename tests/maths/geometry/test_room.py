"""The room of features loads each of them when it is first asked for, from where the type checker is told that it is."""

import ast
import subprocess
import sys
from importlib import import_module
from inspect import getsource

import pytest

from cmm_uq.maths import geometry

TOLD = [(node.module, alias.name) for node in ast.walk(ast.parse(getsource(geometry)))
        if isinstance(node, ast.ImportFrom) and str(node.module).startswith("cmm_uq.") for alias in node.names]  # fmt: skip


@pytest.mark.parametrize(("module", "name"), TOLD)
def test_a_name_is_what_its_module_has(module: str, name: str) -> None:
    assert getattr(geometry, name) is getattr(import_module(module), name)


def test_the_room_has_these_names_and_no_others() -> None:
    assert sorted(name for _, name in TOLD) == sorted(geometry.__all__)
    with pytest.raises(AttributeError, match="no attribute 'fit_torus'"):
        _ = geometry.fit_torus


def test_a_rotation_loads_no_fit() -> None:
    code = "import sys, cmm_uq.maths.geometry.feature; sys.exit('cmm_uq.maths.geometry.axial' in sys.modules)"
    assert subprocess.run([sys.executable, "-c", code], check=False).returncode == 0
