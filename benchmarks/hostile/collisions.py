"""Two commands and one folder: every ordered pair, one after the other and at once, and folders of someone else."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, field
from functools import cache
from pathlib import Path

from benchmarks.hostile.invariants import MANIFEST, Outcome, lost, problems, set_problems, snapshot
from benchmarks.hostile.processes import COMMANDS, OUT, contents, emptied, put, reference, run

ONE, OTHER = "job-one", "job-two"
DEFAULTS = ("report", "diagnose", "plan", "budget")
"""Commands that know where to write without being told."""


@dataclass(frozen=True)
class Collision:
    """A command that meets a folder which is not, or not only, its own.

    Parameters
    ----------
    second : the command that comes second, or alone.
    first : the command whose set lies there, or that runs at once.
    relation : in words.
    force : whether ``--force`` is given.
    """

    second: str
    first: str | None
    relation: str
    force: bool = False
    check: Callable[[Collision, Path], tuple[Outcome, list[str]]] = field(kw_only=True, repr=False)

    @property
    def what(self) -> str:
        """In words."""
        after = f" after {self.first}" if self.first else ""
        return f"{self.second}{after}: {self.relation}{', --force' if self.force else ''}"


@cache
def forces(command: str) -> bool:
    """Whether a command knows ``--force``."""
    return "--force" in run([command, "--help"], Path("/")).stdout


def collisions(commands: tuple[str, ...]) -> Iterator[Collision]:
    """Every collision among some commands."""
    for second in commands:
        for first in commands:
            for force in (False, True) if forces(second) else (False,):
                yield Collision(second, first, "same job, same --out", force, check=_after)
                yield Collision(second, first, "another job, same --out", force, check=_after)
            yield Collision(second, first, "at once, same --out", check=_at_once)
            if first in DEFAULTS and second in DEFAULTS:
                yield Collision(second, first, "no --out", check=_by_default)
        for force in (False, True) if forces(second) else (False,):
            for place in ("job", "job/below", ".", "other", "strangers"):
                yield Collision(second, None, f"--out is {place}", force, check=_alone)


def meet(collision: Collision, folder: Path) -> tuple[Outcome, list[str]]:
    """Let it happen in an empty folder, and say what does not hold."""
    return collision.check(collision, emptied(folder))


def _forced(collision: Collision) -> tuple[str, ...]:
    return ("--force",) if collision.force else ()


def _after(collision: Collision, folder: Path) -> tuple[Outcome, list[str]]:
    """The set of the first lies there, whole, and the second writes to the same folder.

    A budget is known by its file's name, which is the same here: two budgets are the same job in two versions.
    """
    assert collision.first
    same = collision.relation.startswith("same") or (collision.first, collision.second) == ("budget", "budget")
    COMMANDS[collision.second].prepare(folder, 1, name=ONE if same else OTHER)
    theirs = reference(collision.first, 0, ONE)
    put(folder / OUT, theirs)
    own = {f"{OUT}/{name}" for name in theirs} if same and collision.first == collision.second else set()
    if collision.force:
        own.add(f"{OUT}/{MANIFEST}")  # says what the folder holds now; its old text is kept like any other file
    before = snapshot(folder)
    outcome = run([*COMMANDS[collision.second].arguments(), *_forced(collision)], folder)
    found = problems(outcome) + lost(before, snapshot(folder), own=frozenset(own)) + set_problems(folder / OUT)
    if outcome.code == 0 and collision.first == collision.second and not same and not collision.force:
        found.append("replaces the set of another job")
    return outcome, found


def _at_once(collision: Collision, folder: Path) -> tuple[Outcome, list[str]]:
    """Both write to one new folder at the same time."""
    assert collision.first
    sides = ((COMMANDS[collision.first], "a", ONE), (COMMANDS[collision.second], "b", OTHER))
    for command, place, name in sides:
        command.prepare(folder / place, 0, name=name)
    before = snapshot(folder)
    with ThreadPoolExecutor(2) as both:
        running = [both.submit(run, command.arguments(out=f"../{OUT}"), folder / place) for command, place, _ in sides]
        outcomes = [each.result() for each in running]
    found = [problem for outcome in outcomes for problem in problems(outcome)]
    found += lost(before, snapshot(folder)) + set_problems(folder / OUT)
    lies = contents(folder / OUT)
    lies.pop(MANIFEST, None)
    sets = [{k: v for k, v in reference(command.name, 0, name).items() if k != MANIFEST} for command, _, name in sides]
    if not any(outcome.code == 0 for outcome in outcomes):
        found.append("neither of two ends well")
    elif lies not in sets:
        found.append("two sets lie mixed in one folder")
    return outcomes[1], found


def _by_default(collision: Collision, folder: Path) -> tuple[Outcome, list[str]]:
    """Both run on the same job without ``--out``, one after the other."""
    assert collision.first
    pairs = [COMMANDS[name] for name in (collision.first, collision.second)]
    outcomes, found, before = [], [], {}
    for i, command in enumerate(pairs):
        command.prepare(folder, 0, job=f"job{i}", name=ONE)
        without = [part for part in command.arguments(job=f"job{i}") if part not in ("--out", OUT)]
        before = {name: seal for name, seal in snapshot(folder).items() if not name.endswith(MANIFEST)}
        outcomes.append(run(without, folder))
        found += problems(outcomes[-1])
    own = frozenset(before) if collision.first == collision.second else frozenset()
    found += lost(before, snapshot(folder), own=own)
    apart = collision.first == collision.second == "budget"  # a model of that name in another folder is another job
    if outcomes[0].code or (outcomes[1].code == 2) is not apart:
        found.append("the folder of another is not refused" if apart else "is refused in its own folder")
    return outcomes[1], found


def _alone(collision: Collision, folder: Path) -> tuple[Outcome, list[str]]:
    """A folder that holds a job, another job, or a stranger's files named like outputs."""
    place = collision.relation.removeprefix("--out is ")
    command = COMMANDS[collision.second]
    command.prepare(folder, 0)
    command.prepare(folder, 1, job="other", name=OTHER)
    names = [*reference(collision.second, 0), MANIFEST, ".placing", ".unfinished-mine"]
    put(folder / "strangers", {name: f"not yours: {name}\n".encode() for name in names})
    before = snapshot(folder)
    outcome = run([*command.arguments(out=place), *_forced(collision)], folder)
    found = problems(outcome) + lost(before, snapshot(folder))
    if outcome.code == 0:
        found += [
            problem
            for problem in set_problems(folder / place)
            if not (place == "strangers" and problem.startswith("left"))
        ]
        found += (
            []
            if _lists_its_own(folder / place, command.name)
            else ["the manifest does not list what the command writes"]
        )
    return outcome, found


def _lists_its_own(folder: Path, command: str) -> bool:
    try:
        listed = json.loads((folder / MANIFEST).read_bytes())["files"]
    except (OSError, ValueError, KeyError):
        return True  # reported as a missing manifest
    return set(listed) == set(reference(command, 0)) - {MANIFEST}
