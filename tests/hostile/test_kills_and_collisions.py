"""A command killed at every call that changes the disk, and commands that meet in one folder: nothing is lost or mixed."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import pytest

from benchmarks.hostile import disk
from benchmarks.hostile.collisions import collisions, meet
from benchmarks.hostile.kills import Kill, available, calls, strike
from benchmarks.hostile.processes import CHEAP

AT_ONCE = 3  # processes side by side: a command here spends its second on imports


@pytest.fixture(scope="module")
def strace() -> None:
    if not available():
        pytest.skip("strace is not here, or may not trace")


def side_by_side(
    runs: Sequence[tuple[str, Callable[[Path], tuple[object, list[str]]]]], folder: Path
) -> list[tuple[str, list[str]]]:
    """What does not hold in each of some runs, by its words."""
    with ThreadPoolExecutor(AT_ONCE) as pool:
        found = pool.map(lambda item: item[1][1](folder / str(item[0]))[1], enumerate(runs))
        return [(what, problems) for (what, _), problems in zip(runs, found, strict=True) if problems]


@pytest.mark.long
@pytest.mark.usefixtures("strace")
def test_a_kill_at_any_call_that_moves_a_file_leaves_a_set_after_the_next_run(tmp_path: Path) -> None:
    where = [call for call in calls("simulate", over=True) if call[0].startswith("rename")]
    assert len(where) >= 5  # each file, and the folder that they come from
    kills = [Kill("simulate", over=True, signal="SIGKILL", call=call) for call in where]
    kills += [Kill("simulate", over=True, signal=name, call=where[-1]) for name in ("SIGINT", "SIGTERM")]
    assert side_by_side([(kill.what, lambda place, kill=kill: strike(kill, place)) for kill in kills], tmp_path) == []


@pytest.mark.long
@pytest.mark.usefixtures("strace")
def test_a_kill_that_does_not_come_is_counted_as_none(tmp_path: Path) -> None:
    outcome, found = strike(Kill("simulate", over=True, signal="SIGKILL", call=("rename", 1000)), tmp_path / "place")
    assert (outcome.code, found) == (0, ["the signal never came"])


@pytest.mark.long
def test_commands_that_meet_in_one_folder_lose_nothing(tmp_path: Path) -> None:
    given = [c for c in collisions(CHEAP) if not c.force]
    met = [c for c in given if c.relation == "--out is strangers"]
    met += [c for c in given if c.relation == "another job, same --out" and "budget" not in (c.first, c.second)]
    assert len(met) == len(CHEAP) + 4
    assert side_by_side([(c.what, lambda place, c=c: meet(c, place)) for c in met], tmp_path) == []


@pytest.mark.long
def test_a_place_that_cannot_be_written_to_is_told_in_one_line(tmp_path: Path) -> None:
    wanted = (
        "files of at most 1000 bytes",
        "stdout full",
        "stdout closed",
        "working folder deleted",
        "--out is 'loop'",
    )
    bad = {what: place for what, place in disk.places("simulate", mount=False).items() if what in wanted}
    assert len(bad) == len(wanted)
    runs = [(what, lambda folder, place=place: disk.attempt("simulate", place, folder)) for what, place in bad.items()]
    assert side_by_side(runs, tmp_path) == []
