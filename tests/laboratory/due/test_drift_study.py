"""The study of the drift model: what was sealed is what was run, and the page is what its tool writes."""

from __future__ import annotations

import ast
import json
import re
from hashlib import sha256

import pytest

from benchmarks.drift import kinds_page, kinds_study, page
from benchmarks.drift.study import HERE, RESULT, SEAL, hashes, seed_of

SEALED_IMPORTS = """\
from {}.recertification.crossing import DAYS, Crossings, crossings
from {}.recertification.drift import History, side_by_side
from {}.recertification.drift_filter import filtered
from {}.recertification.drift_prior import default_prior
from {}.recertification.fleet import Fleet, Member, belonging, fit_fleet
""".replace("{}", "cmm_uq")
"""What the study imported from the package when it was sealed: rooms and names have moved since."""

SAMPLING = """\
        "sampling": f"{learnt.draws} draws worth {learnt.worth:.0f} independent ones",
"""
SEALED_SAMPLING = """\
        "chains": {"rhat_max": learnt.chains.rhat_max, "ess_min": learnt.chains.ess_min, "steps": learnt.chains.steps,
                   "converged": learnt.chains.converged},
"""
"""What it kept of the sampling, which was by emcee then."""


def test_generator_and_judging_are_those_that_were_sealed_and_run() -> None:
    seal, result = (json.loads(path.read_text(encoding="utf-8")) for path in (SEAL, RESULT))
    text = (HERE / "study.py").read_text(encoding="utf-8")
    sealed = re.sub(r"(^from cmm_uq\.\S+ import .*\n)+", SEALED_IMPORTS, text, flags=re.MULTILINE)
    sealed = sealed.replace(SAMPLING, SEALED_SAMPLING)
    assert seal == {**hashes(), "study.py": sha256(sealed.encode()).hexdigest()} == result["seal"]
    assert result["seed"] == seed_of(seal)


def test_the_study_of_kinds_is_the_one_that_was_sealed_and_its_page_what_its_tool_writes() -> None:
    seal, result = (json.loads(path.read_text(encoding="utf-8")) for path in (kinds_study.SEAL, kinds_study.RESULT))
    assert seal == kinds_study.hashes() == result["seal"]
    assert result["seed"] == kinds_study.seed_of(seal)
    assert "\n\n".join([kinds_page.BEGIN, *kinds_page.parts(result), kinds_page.END]) in page.PAGE.read_text(
        encoding="utf-8"
    )
    for kind, of in result["kinds"].items():
        assert of["alone"]["groups"]["all"]["machines"] >= 1000, kind


@pytest.mark.parametrize("name", ["generator.py", "kinds.py", "policies.py"])
def test_the_generator_and_the_rules_beside_it_share_no_code_with_the_package(name: str) -> None:
    tree = ast.parse((HERE / name).read_text(encoding="utf-8"))
    modules = [node.module or "" for node in ast.walk(tree) if isinstance(node, ast.ImportFrom)]
    modules += [alias.name for node in ast.walk(tree) if isinstance(node, ast.Import) for alias in node.names]
    assert not [module for module in modules if module.startswith("cmm_uq")]


def test_the_page_is_what_its_tool_writes_of_the_result() -> None:
    result = json.loads(RESULT.read_text(encoding="utf-8"))
    assert "\n\n".join([page.BEGIN, *page.parts(result), page.END]) in page.PAGE.read_text(encoding="utf-8")
