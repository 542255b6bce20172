"""Which tests run which lines, and how long they take: measured once, and again for tests that are new."""

from __future__ import annotations

import re
import xml.etree.ElementTree as ET
from collections import defaultdict
from collections.abc import Sequence
from functools import cache
from pathlib import Path

import pytest
from coverage import CoverageData

from benchmarks.mutation.modules import MODULES, ROOT
from benchmarks.mutation.operators import Mutant

OUTSIDE = (
    "tests/hostile",
    "tests/test_packaging.py",
    "tests/test_contributing.py",
    "tests/certificate/test_html_layout.py",
)
"""Tests that start other processes or a browser: they would run the code without the fault."""
QUIET = ["-q", "-p", "no:cacheprovider", "-o", "tmp_path_retention_policy=none", "--hypothesis-profile=ci",
         "-W", "ignore::pytest.PytestAssertRewriteWarning", *(f"--ignore={path}" for path in OUTSIDE)]  # fmt: skip


def measure(tests: Sequence[str], keep: Path) -> int:
    """Which test runs which line, and how long each test takes; added to what is known."""
    keep.mkdir(parents=True, exist_ok=True)
    settings = keep / "coveragerc"
    lines = "\n".join(f"    {ROOT / module}" for module in MODULES)
    settings.write_text(f"[run]\ndata_file = {keep / 'coverage.db'}\ninclude =\n{lines}\n", encoding="utf-8")
    times = keep / f"times-{len(list(keep.glob('times-*.xml'))):03d}.xml"
    wanted = list(tests) or ["tests"]
    return pytest.main([*QUIET, "-n", "2", "--cov", "--cov-append", f"--cov-config={settings}", "--cov-context=test",
                        "--cov-report=", f"--junitxml={times}", *wanted])  # fmt: skip


@cache
def shares(path: str) -> bool:
    """Whether the tests of a file share what is computed once: then the first of them pays for all."""
    beside = ROOT / path, (ROOT / path).with_name("conftest.py")
    return any(
        re.search(r"scope=|@cache|simulated", file.read_text(encoding="utf-8")) for file in beside if file.exists()
    )


def durations(keep: Path) -> tuple[dict[str, float], dict[str, float]]:
    """Seconds that each test takes, and what the first of a file takes at most where its tests share something."""
    found: dict[str, float] = {}
    for path in sorted(keep.glob("times-*.xml")):
        for case in ET.parse(path).iter("testcase"):
            found[f"{case.get('classname', '').replace('.', '/')}.py::{case.get('name')}"] = float(case.get("time", 0))
    first: dict[str, float] = defaultdict(float)
    for test, seconds in found.items():
        file = test.split("::")[0]
        if (ROOT / file).exists() and shares(file):
            first[file] = max(first[file], seconds)
    return found, first


class Cover:
    """Tests by the lines that they run.

    Where a line runs while a test is set up, or a file caches what it computes, other tests of that file may rest on it too.
    """

    def __init__(self, keep: Path, known: Sequence[str]) -> None:
        self._data = CoverageData(str(keep / "coverage.db"))
        self._data.read()
        self._by_file: dict[str, list[str]] = defaultdict(list)
        for test in known:
            self._by_file[test.split("::")[0]].append(test)

    def of(self, mutant: Mutant) -> set[str]:
        """Tests that may kill a mutant: those that run its lines, or any line of the module where it acts on import."""
        by_line = self._data.contexts_by_lineno(str(ROOT / mutant.module))
        lines = by_line if mutant.qualname is None else range(mutant.line, mutant.last + 1)
        found: set[str] = set()
        for test, _, phase in (context.rpartition("|") for line in lines for context in by_line.get(line, ())):
            path = test.split("::")[0]
            found |= {test} if phase == "run" and not shares(path) else set(self._by_file[path])
        return found
