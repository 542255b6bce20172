"""Mutants against the tests that run their lines: ``python -m benchmarks.mutation.driver [MODULE ...]``.

pytest collects the tests once; every mutant is a fork of that process, in which the code of its function is exchanged and the
tests run, fastest first, until one fails. What runs on import (constants, defaults) gets fresh imports there. Results are
appended to ``results.jsonl`` as they come, and a run takes up where the last one ended; ``--survivors`` tries again what
survived. ``--measure`` (first of all, or for some test files alone) finds out which tests run which lines.
"""

from __future__ import annotations

import argparse
import gc
import json
import os
import random
import sys
import time
from collections import Counter, defaultdict
from collections.abc import Iterator, Sequence
from pathlib import Path

import pytest

from benchmarks.mutation.covering import QUIET, Cover, durations, measure
from benchmarks.mutation.faulty import Faulty, Watched, exchange, functions
from benchmarks.mutation.modules import KEEP, MODULES, ROOT
from benchmarks.mutation.operators import Mutant, mutants
from benchmarks.mutation.table import Equivalents, read

LEAST, PATIENCE = 30.0, 5.0
"""Seconds that any test may take, and times those of the longest on top: then the mutant hangs, which kills it."""


def drawn_of(faults: Sequence[Mutant], count: int, seed: int) -> list[Mutant]:
    """So many of a module's faults, in the order of the source; a fault more or less elsewhere draws the others as before."""
    order = sorted(faults, key=lambda mutant: random.Random(f"{seed} {mutant.key}").random())
    return sorted(order[:count], key=lambda mutant: mutant.line)


class Study:
    """The plugin that takes the place of pytest's loop over tests."""

    def __init__(self, options: argparse.Namespace) -> None:
        self.options = options
        self.usual, self.first = durations(options.keep)
        self.kills: dict[str, Counter[str]] = defaultdict(Counter)
        for record in read(options.keep).values():
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
        gc.unfreeze()  # what is collected is frozen, and not listed
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
        equivalents = Equivalents()
        done = {key: record["result"] for key, record in read(self.options.keep).items()}
        for module in self.options.modules or MODULES:
            drawn = mutants(ROOT, module)
            if self.options.sample:
                drawn = drawn_of(drawn, self.options.sample, self.options.seed)
            for mutant in drawn:
                if mutant in equivalents:
                    continue
                if mutant.key not in done or (self.options.survivors and done[mutant.key] == "survived"):
                    yield mutant

    def _order(self, mutant: Mutant, tests: set[str]) -> list[str]:
        """By how many others of this module each has killed, those of the module itself one more, for each second it takes."""
        own, kills = f"test_{Path(mutant.module).stem}.py", self.kills[mutant.module]

        def worth(test: str) -> float:
            return (kills[test] + (1.0 if own in test else 0.2)) / (self._seconds(test) + 0.02)

        spent, chosen, files = 0.0, [], set()
        for test in sorted(tests, key=worth, reverse=True):
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
        by = last if result == "killed" else ""
        record = {
            "module": module, "line": mutant.line, "source": source, "change": change, "nth": nth, "result": result, "by": by,
            "status": status, "tests": len(tests), "seconds": round(seconds, 1),
        }  # fmt: skip
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
