"""``cmm-uq acquire`` killed, and pseudo-terminals that do wrong: a few of the study's cases."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import pytest

pytest.importorskip("termios")  # of POSIX

from benchmarks.hostile.acquisitions import strike, what
from benchmarks.hostile.terminals import trials
from benchmarks.hostile.warm import Warm


@pytest.fixture(scope="module")
def warm() -> Iterator[Warm]:
    with Warm() as made:
        yield made


@pytest.mark.long(but="SIGKILL2")
@pytest.mark.parametrize("number", range(6), ids=lambda number: what(2, number)[:7])
def test_a_session_that_is_killed_has_every_accepted_point_and_goes_on(number: int, warm: Warm, tmp_path: Path) -> None:
    outcome, found, accepted = strike(2, number, tmp_path / "session", warm)
    assert found == [], outcome.stderr
    assert accepted >= 1


@pytest.mark.long
@pytest.mark.parametrize("words", [
    "instruments test: it babbles, from the first", "instruments watch: it vanishes, while it is listened to",
    "acquire: an instrument vanishes, and the operator quits", "acquire: the operator's terminal vanishes, of its session",
    "acquire: the operator's terminal vanishes",
])  # fmt: skip
def test_a_terminal_that_does_wrong_costs_no_accepted_point(words: str, warm: Warm, tmp_path: Path) -> None:
    outcome, found = trials()[words](tmp_path / "case", warm)
    assert found == [], outcome.stderr
