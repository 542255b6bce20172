"""``cmm-uq instruments``: what is ready, one tried at its port, a new profile, and what is said where nothing comes."""

from __future__ import annotations

import importlib.util
import json
import os
import shutil
import subprocess
import time
import tomllib
from pathlib import Path

import pytest

from cmm_uq.laboratory.live.instruments.library import profile_named, ready
from cmm_uq.laboratory.live.instruments.simulated_line import Readout1502, Speaker, Thermocouples
from tests.app.cli.process import COMMAND, run
from tests.app.cli.terminal import everything
from tests.conftest import ROOT
from tests.laboratory.live.instruments.mischief import UnreliableLine

pytestmark = pytest.mark.skipif(os.name == "nt", reason="no pseudo-terminals here")


LONGER_S = (0.5, 3.0, 12.0)
"""How long an instrument is listened to, until what must come has come: a busy machine takes its time."""


def listened(told: str, *arguments: object) -> subprocess.CompletedProcess[str]:
    """A command that listens for a while, with a longer while where it did not hear enough."""
    for seconds in LONGER_S:
        done = run("instruments", *arguments, "--seconds", seconds)
        if told in done.stdout + done.stderr:
            break
    return done


def test_ready_profiles_are_listed(monkeypatch: pytest.MonkeyPatch) -> None:
    done = run("instruments", "list", "--json")
    assert [one["name"] for one in json.loads(done.stdout)["profiles"]] == list(ready())
    assert run("instruments").stdout == run("instruments", "list").stdout
    assert "fluke-1502a " in run("instruments", "list").stdout


def test_a_message_stands_beside_what_was_understood(tmp_path: Path) -> None:
    with UnreliableLine(Readout1502(), "pty", tmp_path) as line:
        done = listened("temp_c = 20.013", "test", "fluke-1502a", line.port)
    assert done.returncode == 0, done.stderr
    assert "<LF>t:   20.013 C<CR>                         temp_c = 20.013\n" in done.stdout
    assert "fluke-1502a: maker HART, model 1502A, serial A24680, firmware 1.10" in done.stdout


@pytest.mark.long
def test_a_source_of_a_job_is_tried_by_its_name(tmp_path: Path) -> None:
    job = tmp_path / "job"
    shutil.copytree(ROOT / "examples" / "iota-1102-20C", job)
    with UnreliableLine(Thermocouples(), "pty", tmp_path) as line:
        with (job / "job.toml").open("a", encoding="utf-8") as file:
            file.write(
                f'\n[[acquire.source]]\nname = "table"\nprofile = "thermocouple-logger-11"\nport = "{line.port}"\n'
            )
        done = listened("temp11_c", "test", "table", "--job", job, "--json")
        assert json.loads(done.stdout)["quantities"]["temp11_c"] == 19.87
        done = listened("temp1_c = 20.11", "watch", "table", "--job", job)
        assert "temp1_c = 20.11" in done.stdout
    assert (
        "the job has no source 'tabel'. Did you mean 'table'?"
        in run("instruments", "test", "tabel", "--job", job).stderr
    )


class Silent(Speaker):
    """Says nothing."""


class Foreign(Speaker):
    """Says something else."""

    every_s = 0.05

    def says(self) -> bytes:
        return b"HELLO WORLD\r"


def garbled(line: UnreliableLine) -> None:
    line.mischief.garbled = True


@pytest.mark.long
@pytest.mark.parametrize(("speaker", "spoil", "told"), [
    (Silent(), None, "nothing came; expected like t:   20.013 C<CR>. Check power and cable (crossed or straight), the "
                     "settings (the profile has 2400 8N1), that it is set to be asked"),
    (Foreign(), None, "what comes is not understood: HELLO WORLD<CR>; expected like t:   20.013 C<CR>. Check that it is "
                      "this instrument, and its settings"),
    (Foreign(), garbled, "; expected like t:   20.013 C<CR>. Check baud rate, data bits and parity: the profile has 2400 8N1"),
])  # fmt: skip
def test_where_nothing_is_understood_it_says_what_to_check(speaker, spoil, told: str, tmp_path: Path) -> None:
    with UnreliableLine(speaker, "pty", tmp_path) as line:
        if spoil:
            spoil(line)
        done = listened(told, "test", "fluke-1502a", line.port)
    assert done.returncode == 2
    assert told in done.stderr
    assert len(done.stderr.splitlines()) == 1


def test_an_instrument_that_answers_but_is_ill_is_said(tmp_path: Path) -> None:
    speaker = Readout1502()
    speaker.ill = True
    with UnreliableLine(speaker, "pty", tmp_path) as line:
        done = listened("the probe is open", "test", "fluke-1502a", line.port)
    assert "the instrument answers, but gives no value" in done.stderr
    assert "the probe is open or out of range" in done.stderr


def test_a_new_profile_from_a_line_reads_that_instrument(tmp_path: Path) -> None:
    own = tmp_path / "my-gauge.toml"
    arguments = ("--line", "14:03:22,20.11,20.13,20.09,20.31,20.3,20.28,20.55,20.52,20.57,20.02,19.87<CR><LF>",
                 "--quantity", "temp_scale_x_c=4", "--range", "temp_scale_x_c=0:40")  # fmt: skip
    done = run("instruments", "new", own, *arguments)
    assert done.returncode == 0, done.stderr
    assert tomllib.loads(own.read_text())["quantities"]["temp_scale_x_c"]["range"] == [0, 40]
    spaced = own.rename(tmp_path / "my gauge.toml")
    with UnreliableLine(Thermocouples(), "pty", tmp_path) as line:
        done = listened("temp_scale_x_c", "test", spaced, line.port, "--json")
    spaced.rename(own)
    assert json.loads(done.stdout)["quantities"] == {"temp_scale_x_c": 20.11}
    assert "is there already" in run("instruments", "new", own, *arguments).stderr


def test_on_a_terminal_it_asks_for_what_is_needed(tmp_path: Path) -> None:
    """The answers are typed ahead: title, settings, question, line, and for its number a name and a range."""
    import pty

    master, slave = pty.openpty()
    with subprocess.Popen([*COMMAND, "instruments", "new", "own.toml"], stdin=slave, stdout=slave, stderr=slave, cwd=tmp_path,
                          env={**os.environ, "TERM": "dumb", "PYTHONPATH": str(ROOT)}) as process:  # fmt: skip
        os.close(slave)
        answers = ("Gauge", "4800", "7", "even", "2", "R<CR>", "+   2.1380, MM<CR><LF>", "length_mm", "-50:50")
        os.write(master, "".join(f"{answer}\n" for answer in answers).encode())
        shown = everything(master, time.monotonic() + 60)
    os.close(master)
    assert process.returncode == 0, shown
    made = profile_named("own.toml", tmp_path)
    assert (made.title, made.connection.baud, made.connection.parity, made.connection.stop_bits) == (
        "Gauge",
        4800,
        "even",
        2,
    )
    assert made.send.poll[0].send == "R<CR>"
    assert made.example[0].values == {"length_mm": 2.138}
    assert made.quantities["length_mm"].range == [-50, 50]


@pytest.mark.parametrize(("arguments", "told"), [
    (("new", "a.toml"), "no example line is given"), (("new", "a.toml", "--line", "1"), "no quantity is named"),
    (("new", "a.txt", "--line", "1<CR>", "--quantity", "x_mm=1"), "a profile's file ends in .toml"),
    (("new", "a.toml", "--line", "1<CR>", "--quantity", "x_mm"), "'x_mm' says nothing"),
    (("new", "a.toml", "--line", "1<CR>", "--quantity", "x_mm=1", "--range", "x_mm=3:2"), "'3:2' is no range"),
    (("test", "fluke", "x"), "there is no profile 'fluke'"), (("test", "none.toml", "x"), "no such file"),
    (("test", "line-logger"), "no port is named"), (("simulate", "nothing"), "there is no profile 'nothing'"),
    (("simulate", "line-logger", "--way", "usb"), "'usb' is no way to a simulated instrument here"),
])  # fmt: skip
def test_a_slip_is_one_line_and_writes_nothing(arguments: tuple[str, ...], told: str, tmp_path: Path) -> None:
    done = run("instruments", *arguments, cwd=tmp_path)
    assert done.returncode == 2
    assert told in done.stderr
    assert not list(tmp_path.iterdir())


def test_a_simulated_instrument_gives_its_port() -> None:
    assert run("instruments", "simulate", "fluke-1502a", "--seconds", "0.1").stdout.strip().endswith("tty")
    assert run("instruments", "simulate", "ipp", "--seconds", "0.1").stdout.startswith("tcp://127.0.0.1:")


@pytest.mark.skipif(importlib.util.find_spec("pyvisa") is not None, reason="pyvisa is installed")
def test_without_pyvisa_it_says_what_to_install() -> None:
    done = run("instruments", "test", "fluke-1529", "visa://GPIB0::17::INSTR")
    assert 'Install it: pip install "cmm-uq[visa]"' in done.stderr
