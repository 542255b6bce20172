"""Help is whole: no bracket swallowed, every default named, an example at its end; and a slip of the keyboard is answered."""

from __future__ import annotations

import re

import pytest
import typer
from typer.testing import CliRunner

from cmm_uq.app.cli.commands import app
from cmm_uq.base.errors import CmmUqError
from tests.app.cli.process import run

COMMANDS = {info.name: info for info in app.registered_commands}
GROUP = typer.main.get_command(app)


def helped(*arguments: str) -> str:
    return CliRunner().invoke(app, [*arguments, "--help"], prog_name="cmm-uq").output


@pytest.mark.parametrize("name", COMMANDS)
def test_a_help_shows_every_sentence_as_it_is_written_and_ends_with_calls(name: str) -> None:
    shown = " ".join(helped(name).split())
    for parameter in GROUP.commands[name].params:
        assert (parameter.help or "") in shown
        if not parameter.required and parameter.param_type_name == "option" and not parameter.is_flag:
            assert re.search(rf"{re.escape(parameter.opts[0])} .*?\[default: [^\]]+\]", shown), parameter.name
    calls = re.findall(rf"(?m)^ +cmm-uq {name}\b.*$", helped(name).partition("Examples:")[2])
    assert calls


def test_brackets_of_toml_are_not_taken_for_markup() -> None:
    assert "Job folder with [machine] error_map." in helped("compensate")


def test_the_list_of_commands_is_not_cut() -> None:
    shown = helped()
    assert "..." not in shown.partition("Commands:")[2]
    assert "Exit codes: 0 done; 2 bad input" in shown


def test_alone_the_command_shows_the_three_most_used_calls() -> None:
    done = run()
    assert done.returncode == 0
    assert re.findall(r"(?m)^  cmm-uq (\w+)", done.stdout) == ["new", "report", "diagnose"]
    assert max(map(len, done.stdout.splitlines())) <= 80


@pytest.mark.parametrize(
    ("arguments", "told"),
    [
        (
            ("diagnoes", "x"),
            "No such command 'diagnoes'. Did you mean 'diagnose'? cmm-uq --help lists commands and options",
        ),
        (
            ("report", "x", "--seeed", "3"),
            "No such option: --seeed. Did you mean --seed? cmm-uq report --help lists its options",
        ),
        (("report",), "Missing argument 'JOB'. cmm-uq report --help lists its options"),
    ],
)
def test_a_slip_is_answered_with_what_was_meant(arguments: tuple[str, ...], told: str, monkeypatch) -> None:
    from cmm_uq.app.cli import commands

    monkeypatch.setattr("sys.argv", ["cmm-uq", *arguments])
    with pytest.raises(CmmUqError) as error:
        commands.run()
    assert str(error.value) == told


@pytest.mark.parametrize("group", ["records", "schedule"])
def test_a_group_of_commands_alone_shows_its_help(group: str) -> None:
    done = run(group)
    assert (done.returncode, done.stderr) == (0, "")
    assert done.stdout.rstrip() == run(group, "--help").stdout.rstrip()
