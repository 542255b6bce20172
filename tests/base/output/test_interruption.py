"""A signal ends a command within two seconds, with what is true of its files."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

pytestmark = pytest.mark.skipif(os.name == "nt", reason="signals of POSIX")

PROGRAM = """
import ctypes, sys, time
from pathlib import Path
from cmm_uq.base.output import Owner, staged, interruption, staging
interruption.watch()
out, moment = Path(sys.argv[1]), sys.argv[2]

def wait():
    print("now", flush=True)
    if moment == "swallowing":
        while True:
            try:
                time.sleep(60)
            except BaseException:
                pass
    ctypes.CDLL(None).sleep(60)  # far inside a library, where no handler of Python's runs

if moment == "placing":
    real = staging.place
    def slowly(*arguments):
        print("now", flush=True)
        time.sleep(0.5)
        real(*arguments)
    staging.place = slowly
with staged(out, Owner("report", "job"), expected=["x"]) as place:
    if moment in ("staged", "swallowing"):
        wait()
    place.write({"x": b"x"})
wait()
"""


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
@pytest.mark.parametrize(
    ("moment", "said", "written"),
    [
        ("staged", "interrupted; nothing was written", False),
        ("swallowing", "interrupted; nothing was written", False),
        ("placing", "interrupted; what was asked for is written in", True),
        ("done", "interrupted; what was asked for is written in", True),
    ],
)
def test_a_signal_ends_the_process_with_the_truth(
    tmp_path: Path, number: signal.Signals, moment: str, said: str, written: bool
) -> None:
    out = tmp_path / "a" / "out"
    with subprocess.Popen(
        [sys.executable, "-c", PROGRAM, str(out), moment], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
    ) as process:
        assert process.stdout is not None
        assert process.stdout.readline() == "now\n"
        began = time.monotonic()
        process.send_signal(number)
        process.wait(timeout=10)
        assert time.monotonic() - began < 2.0
        assert process.stderr is not None
        told = process.stderr.read()
    assert process.returncode == 128 + number
    assert told.count("\n") == 1
    assert said in told
    if written:
        assert sorted(path.name for path in out.iterdir()) == ["manifest.json", "x"]
    else:
        assert list(tmp_path.iterdir()) == []


THREADS = """
import sys, threading, time
from pathlib import Path
from cmm_uq.base.output import Owner, staged, interruption, staging
interruption.watch()
out = Path(sys.argv[1])
discard = staging.Stage.discard
def slowly(place):  # as on a busy disk
    discard(place)
    time.sleep(0.1)
staging.Stage.discard = slowly
real = staging._write
def written(path, content):
    time.sleep(0.01)
    real(path, content)
staging._write = written

def write(name):
    with interruption.keeping(lambda: "what is whole is kept"):
        for turn in range(1000):
            with staged(out / f"{name}{turn}", Owner("report", "job")) as place:
                place.write({f"{n}": b"x" for n in range(3)})
for name in "abcd":
    threading.Thread(target=write, args=(name,), daemon=True).start()
time.sleep(0.6)
print("now", flush=True)
time.sleep(60)
"""


def test_threads_that_write_leave_nothing_unfinished(tmp_path: Path) -> None:
    """Of each thread a set is staged, or being placed, or just begun when the signal comes; the first goes first."""
    with subprocess.Popen(
        [sys.executable, "-c", THREADS, str(tmp_path / "out")],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    ) as process:
        assert process.stdout is not None
        assert process.stdout.readline() == "now\n"
        process.send_signal(signal.SIGINT)
        _, told = process.communicate(timeout=20)
    assert (process.returncode, told) == (130, "cmm-uq: interrupted; what is whole is kept\n")
    found = list((tmp_path / "out").iterdir())
    assert found
    assert {tuple(sorted(path.name for path in folder.iterdir())) for folder in found} == {
        ("0", "1", "2", "manifest.json")
    }


def test_a_second_signal_changes_nothing(tmp_path: Path) -> None:
    with subprocess.Popen(
        [sys.executable, "-c", PROGRAM, str(tmp_path / "out"), "placing"],
        stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True,
    ) as process:  # fmt: skip
        assert process.stdout is not None
        process.stdout.readline()
        process.send_signal(signal.SIGTERM)
        time.sleep(0.2)  # of signals that wait together the one with the lowest number comes first
        for number in (signal.SIGINT, signal.SIGTERM):
            process.send_signal(number)
        process.wait(timeout=10)
    assert process.returncode == 128 + signal.SIGTERM
    assert sorted(path.name for path in (tmp_path / "out").iterdir()) == ["manifest.json", "x"]


def test_a_signal_while_the_interpreter_shuts_down_changes_nothing() -> None:
    """What was done was done: the exit code says so."""
    lines = (
        "import os, signal, sys", "from cmm_uq.base.output import interruption", "interruption.watch()", "class Late:",
        "    def __del__(self):",
        "        os.kill(os.getpid(), signal.SIGTERM)",
        "        os.kill(os.getpid(), signal.SIGINT)",
        "sys.late = Late()", "interruption.done()", "sys.exit(0)",
    )  # fmt: skip
    program = "\n".join(lines)
    ended = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=False)
    assert (ended.returncode, ended.stderr) == (0, "")


def test_a_command_that_keeps_what_it_has_says_so() -> None:
    program = (
        "import time\nfrom cmm_uq.base.output import interruption\ninterruption.watch()\n"
        "with interruption.keeping(lambda: '3 of 4 are kept'):\n    print('now', flush=True)\n    time.sleep(60)\n"
    )
    process = subprocess.Popen(
        [sys.executable, "-c", program], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
    )
    assert process.stdout is not None
    assert process.stdout.readline() == "now\n"
    process.send_signal(signal.SIGINT)
    _, told = process.communicate(timeout=20)
    assert (process.returncode, told) == (130, "cmm-uq: interrupted; 3 of 4 are kept\n")
