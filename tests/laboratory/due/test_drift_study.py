"""The study of the drift model: what was sealed is what was run, and the page is what its tool writes."""

from __future__ import annotations

import ast
import hashlib
import json
import re

import pytest

from benchmarks.drift import page
from benchmarks.drift.study import HERE, RESULT, SEAL, hashes, seed_of
from tests.conftest import ROOT

SEALED_IMPORTS = """\
from cmm_uq.recertification.crossing import DAYS, Crossings, crossings
from cmm_uq.recertification.drift import History, side_by_side
from cmm_uq.recertification.drift_filter import filtered
from cmm_uq.recertification.drift_prior import default_prior
from cmm_uq.recertification.fleet import Fleet, Member, belonging, fit_fleet

"""
"""Where the judging took the model from when it was sealed; nothing else of it may differ from what was sealed."""


def test_generator_and_judging_are_those_that_were_sealed_and_run() -> None:
    seal, result = (json.loads(path.read_text(encoding="utf-8")) for path in (SEAL, RESULT))
    assert seal == result["seal"]
    study = (HERE / "study.py").read_text(encoding="utf-8")
    as_sealed = re.sub(
        r"^from cmm_uq\.laboratory.*?\n\n", SEALED_IMPORTS, study, count=1, flags=re.MULTILINE | re.DOTALL
    )
    assert seal == hashes() | {"study.py": hashlib.sha256(as_sealed.encode()).hexdigest()}
    assert result["seed"] == seed_of(seal)


@pytest.mark.parametrize("name", ["generator.py", "policies.py"])
def test_the_generator_and_the_rules_beside_it_share_no_code_with_the_package(name: str) -> None:
    tree = ast.parse((HERE / name).read_text(encoding="utf-8"))
    modules = [node.module or "" for node in ast.walk(tree) if isinstance(node, ast.ImportFrom)]
    modules += [alias.name for node in ast.walk(tree) if isinstance(node, ast.Import) for alias in node.names]
    assert not [module for module in modules if module.startswith("cmm_uq")]


def test_the_page_is_what_its_tool_writes_of_the_result() -> None:
    result = json.loads(RESULT.read_text(encoding="utf-8"))
    written = (ROOT / "docs" / "records" / "drift-study.md").read_text(encoding="utf-8")
    assert written == "\n\n".join(page.parts(result)) + "\n"
