"""Colour and progress are for who looks at them: never in a pipe, never against NO_COLOR, never on a dumb terminal."""

from __future__ import annotations

import os

import pytest

from cmm_uq.app.cli.terminal import progress
from tests.app.cli.terminal import on_terminal

ANSWER = "cmm-uq: No such option: --seeed. Did you mean --seed? cmm-uq report --help lists its options"


@pytest.mark.skipif(os.name == "nt", reason="pseudo-terminals of POSIX")
@pytest.mark.parametrize(
    ("environment", "coloured"), [({}, True), ({"NO_COLOR": "1"}, False), ({"TERM": "dumb"}, False)]
)
def test_an_error_is_folded_between_words_and_red_only_where_colour_is_wanted(
    environment: dict[str, str], coloured: bool
) -> None:
    code, told = on_terminal("report", "x", "--seeed", "3", columns=60, environment=environment)
    assert code == 2
    assert ("\x1b[1;31mcmm-uq:\x1b[0m" in told) is coloured
    plain = told.replace("\x1b[1;31m", "").replace("\x1b[0m", "")
    assert "\x1b" not in plain
    assert max(map(len, plain.splitlines())) <= 60
    assert " ".join(plain.split()) == ANSWER


def stages(capsys: pytest.CaptureFixture[str], *, quiet: bool, verbose: bool) -> list[str]:
    with progress(quiet=quiet, verbose=verbose) as stage:
        for part in (0.0, 0.5, 1.0) if stage else ():
            stage(f"Sampling: {part:.0%} of the draws needed", part)
        if stage:
            stage("Writing", 1.0)
    said = capsys.readouterr()
    assert said.out == ""
    return said.err.splitlines()


def test_away_from_a_terminal_stages_are_told_once_each_and_only_when_asked_for(
    capsys: pytest.CaptureFixture[str],
) -> None:
    assert stages(capsys, quiet=False, verbose=True) == ["Sampling", "Writing"]
    assert stages(capsys, quiet=False, verbose=False) == []
    assert stages(capsys, quiet=True, verbose=True) == []
