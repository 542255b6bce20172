"""Mutants against the tests that cover their lines: ``python -m benchmarks.mutation.driver [MODULE ...]``.

pytest collects the tests once; every mutant is a fork of that process, in which the code of its function is exchanged and the
tests run, fastest first, until one fails. What runs on import (constants, defaults) gets fresh imports in the fork. Results are
appended to ``--results`` as they come, and a run takes up where the last one ended; ``--survivors`` tries what survived again.
``--measure`` (first of all, or for some test files alone) finds out which tests cover which lines, and how long they take.
"""

from __future__ import annotations

import argparse
import gc
import importlib.abc
import importlib.util
import json
import os
import random
import re
import signal
import sys
import time
import xml.etree.ElementTree as ElementTree
from collections import Counter, defaultdict
from collections.abc import Iterator, Sequence
from functools import cache
from importlib.machinery import ModuleSpec
from pathlib import Path
from types import CodeType, FunctionType, ModuleType

import pytest
from coverage import CoverageData

from benchmarks.mutation.modules import MODULES, ROOT
from benchmarks.mutation.operators import Mutant, mutants

KEEP = ROOT / "reports" / "mutation"
OUTSIDE = (
    "tests/hostile",
    "tests/test_packaging.py",
    "tests/test_contributing.py",
    "tests/documents/test_html_layout.py",
)
"""Tests that start other processes or a browser: they would run the code without the fault."""
QUIET = ["-q", "-p", "no:cacheprovider", "-o", "tmp_path_retention_policy=none", "--hypothesis-profile=ci",
         "-W", "ignore::pytest.PytestAssertRewriteWarning", *(f"--ignore={path}" for path in OUTSIDE)]  # fmt: skip
LEAST, PATIENCE = 30.0, 5.0
"""Seconds that any test may take, and times those of the longest on top: then the mutant hangs, which kills it."""


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
        for case in ElementTree.parse(path).iter("testcase"):
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


def functions() -> dict[str, list[FunctionType]]:
    """All functions of the running process that can be exchanged, by module."""
    found = defaultdict(list)
    for function in gc.get_objects():
        if isinstance(function, FunctionType):
            found[function.__code__.co_filename].append(function)
    return {module: found[str(ROOT / module)] for module in MODULES}


def exchange(mutant: Mutant, present: Sequence[FunctionType]) -> bool:
    """Put the faulty code into the functions of the running process; whether any function took it."""
    wanted, done = dict(_codes(mutant.code(ROOT))), False
    for function in present:
        new = wanted.get(_name(function.__code__))
        if new is not None and len(new.co_freevars) == len(function.__code__.co_freevars):
            done |= str(mutant.qualname).startswith(function.__code__.co_qualname.split(".<locals>")[0])
            function.__code__ = new
    return done


def _name(code: CodeType) -> tuple[object, ...]:
    return code.co_qualname, code.co_firstlineno, code.co_varnames[: code.co_argcount]


def _codes(code: CodeType) -> Iterator[tuple[tuple[object, ...], CodeType]]:
    yield _name(code), code
    for constant in code.co_consts:
        if isinstance(constant, CodeType):
            yield from _codes(constant)


class Faulty(importlib.abc.MetaPathFinder, importlib.abc.Loader):
    """Imports one module with its fault."""

    def __init__(self, mutant: Mutant) -> None:
        self._mutant = mutant
        self._name = mutant.module.removesuffix(".py").replace("/", ".")

    def find_spec(self, name: str, path: object, target: object = None) -> ModuleSpec | None:
        """See the base class."""
        return (
            importlib.util.spec_from_file_location(name, ROOT / self._mutant.module, loader=self)
            if name == self._name
            else None
        )

    def exec_module(self, module: ModuleType) -> None:
        """See the base class."""
        exec(self._mutant.code(ROOT), module.__dict__)  # noqa: S102


class Study:
    """The plugin that takes the place of pytest's loop over tests."""

    def __init__(self, options: argparse.Namespace) -> None:
        self.options = options
        self.usual, self.first = durations(options.keep)
        self.kills: dict[str, Counter[str]] = defaultdict(Counter)
        for record in read(options.results).values():
            self.kills[str(record["module"])][str(record["by"])] += record["result"] == "killed"
        self.sound: dict[str, bool] = {}

    @pytest.hookimpl(trylast=True)
    def pytest_configure(self) -> None:
        """Hypothesis tries the same examples each time, and shrinks none."""
        from hypothesis import Phase, settings

        profile = settings.get_profile("ci")
        settings.register_profile("mutation", profile, phases=(Phase.explicit, Phase.generate))
        settings.load_profile("mutation")

    def pytest_runtestloop(self, session: pytest.Session) -> bool:
        """Run all mutants, a few at a time."""
        self.items = {item.nodeid: item for item in session.items}
        session.config._tmp_path_factory.getbasetemp()  # type: ignore[attr-defined]  # one folder for all forks
        cover = Cover(self.options.keep, list(self.items))
        self.present = functions()
        gc.freeze()
        running: dict[int, tuple[Mutant, list[str], float, int]] = {}
        waiting = iter(self._wanted())
        while True:
            while len(running) < self.options.workers and (mutant := next(waiting, None)):
                tests = self._order(mutant, cover.of(mutant) & set(self.items))
                reading, writing = os.pipe()
                running[self._fork(mutant, tests, writing)] = mutant, tests, time.monotonic(), reading
                os.close(writing)
            if not running:
                return True
            pid, status = os.wait()
            mutant, tests, began, reading = running.pop(pid)
            with os.fdopen(reading, "rb") as pipe:
                last = pipe.read().decode().splitlines()
            self._note(mutant, tests, status, last[-1] if last else "", time.monotonic() - began)

    def _wanted(self) -> Iterator[Mutant]:
        done = {key: record["result"] for key, record in read(self.options.results).items()}
        for module in self.options.modules or MODULES:
            drawn = mutants(ROOT, module)
            if self.options.sample and len(drawn) > self.options.sample:
                drawn = random.Random(self.options.seed).sample(drawn, self.options.sample)
            for mutant in drawn:
                if mutant.key not in done or (self.options.survivors and done[mutant.key] == "survived"):
                    yield mutant

    def _order(self, mutant: Mutant, tests: set[str]) -> list[str]:
        """First those that killed others of this module, then those of the module itself, each by its seconds."""
        own, kills = f"test_{Path(mutant.module).stem}.py", self.kills[mutant.module]
        spent, chosen, files = 0.0, [], set()
        for test in sorted(tests, key=lambda test: (-kills[test], own not in test, self._seconds(test))):
            spent += self.usual.get(test, 1.0) if (file := test.split("::")[0]) in files else self._seconds(test)
            if spent > self.options.seconds and chosen:
                break
            chosen.append(test)
            files.add(file)
        return chosen

    def _seconds(self, test: str) -> float:
        return self.usual.get(test, 1.0) + self.first.get(test.split("::")[0], 0.0)

    def _fork(self, mutant: Mutant | None, tests: Sequence[str], pipe: int) -> int:
        sys.stdout.flush()
        if pid := os.fork():
            return pid
        code = 3
        try:
            os.dup2(os.open(os.devnull, os.O_WRONLY), 1)
            os.dup2(os.open(os.devnull, os.O_WRONLY), 2)
            plugin = Watched(pipe, int(LEAST + PATIENCE * max(map(self._seconds, tests), default=0.0)))
            if mutant is None or (mutant.qualname is not None and exchange(mutant, self.present[mutant.module])):
                code = plugin.run([self.items[test] for test in tests]) if tests else 0
            else:
                for name in [name for name in sys.modules if name.partition(".")[0] in ("cmm_uq", "tests")]:
                    del sys.modules[name]
                sys.meta_path.insert(0, Faulty(mutant))
                code = pytest.main([*QUIET, "--hypothesis-profile=mutation", *tests], plugins=[plugin]) if tests else 0
        finally:
            os._exit(code)

    def _note(self, mutant: Mutant, tests: Sequence[str], status: int, last: str, seconds: float) -> None:
        result = "survived" if status == 0 else "killed"
        if result == "killed" and last and not self._is_sound(last):
            print(f"{last} fails without a fault: left out", flush=True)
            self.items.pop(last, None)
            return
        if result == "killed":
            self.kills[mutant.module][last] += 1
        module, source, change, nth = mutant.key
        record = {"module": module, "line": mutant.line, "source": source, "change": change, "nth": nth, "result": result,
                  "by": last if result == "killed" else "", "status": status, "tests": len(tests), "seconds": round(seconds, 1)}  # fmt: skip
        with self.options.results.open("a", encoding="utf-8") as file:
            file.write(json.dumps(record, ensure_ascii=False) + "\n")

    def _is_sound(self, test: str) -> bool:
        """Whether a test passes without a fault; asked once."""
        if test not in self.sound:
            reading, writing = os.pipe()
            self.sound[test] = os.waitpid(self._fork(None, [test], writing), 0)[1] == 0 if test in self.items else True
            os.close(reading)
            os.close(writing)
        return self.sound[test]


class Watched:
    """Names each test as it starts, and ends the process where it takes too long."""

    def __init__(self, pipe: int, limit: int) -> None:
        self._pipe, self._limit = pipe, limit

    def run(self, items: Sequence[pytest.Item]) -> int:
        """Run tests of the collecting process; no return when one fails."""
        for item, following in zip(items, [*items[1:], None], strict=True):
            if item is items[0]:
                item.config.pluginmanager.register(self)
            item.config.hook.pytest_runtest_protocol(item=item, nextitem=following)
        return 0

    @pytest.hookimpl(tryfirst=True)
    def pytest_runtest_setup(self, item: pytest.Item) -> None:
        """Note which test runs, and set the clock."""
        signal.signal(signal.SIGALRM, signal.SIG_DFL)
        signal.alarm(self._limit)
        os.write(self._pipe, f"{item.nodeid}\n".encode())

    @pytest.hookimpl(tryfirst=True)
    def pytest_runtest_makereport(self, call: pytest.CallInfo[None]) -> None:
        """End at the first failure, of which nobody asks for a report."""
        if call.excinfo is not None and not isinstance(call.excinfo.value, pytest.skip.Exception):
            os._exit(1)


def read(results: Path) -> dict[tuple[object, ...], dict[str, object]]:
    """The last result of every mutant."""
    lines = results.read_text(encoding="utf-8").splitlines() if results.exists() else []
    records = [json.loads(line) for line in lines]
    return {tuple(record[name] for name in ("module", "source", "change", "nth")): record for record in records}


def main() -> int:
    """Run the study."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("modules", nargs="*", metavar="MODULE")
    parser.add_argument("--measure", nargs="*", metavar="TESTS")
    parser.add_argument("--workers", type=int, default=2)
    parser.add_argument("--sample", type=int, help="mutants to draw of each module (all)")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--seconds", type=float, default=60.0, help="of tests for each mutant")
    parser.add_argument("--survivors", action="store_true")
    parser.add_argument("--keep", type=Path, default=KEEP)
    options = parser.parse_args()
    if options.measure is not None:
        return measure(options.measure, options.keep)
    options.results = options.keep / "results.jsonl"
    return int(pytest.main([*QUIET, "tests"], plugins=[Study(options)]))


if __name__ == "__main__":
    sys.exit(main())
