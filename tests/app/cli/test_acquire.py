"""Recording live as an operator meets it: a real terminal, real sockets, real kills, a disk that is really full."""

from __future__ import annotations

import os
import queue
import re
import signal
import subprocess
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

import pytest

from cmm_uq.app.commands.reading import read_job
from cmm_uq.laboratory.live.instruments.ipp_server import SimulatedIppServer
from cmm_uq.laboratory.live.instruments.simulated_line import Lines, Readout1502, SimulatedLine
from cmm_uq.laboratory.live.story import read_story
from tests.app.cli.process import COMMAND, run
from tests.app.cli.terminal import until
from tests.conftest import ROOT
from tests.laboratory.live.session import job_folder

resource, termios = pytest.importorskip("resource"), pytest.importorskip("termios")  # of POSIX

PATIENCE_S = 60.0
ENVIRONMENT = {**os.environ, "PYTHONPATH": str(ROOT), "TERM": "xterm-256color"}
POINTS = [f"{x} 100 {-300 - i / 1000:.3f}" for i in range(40) for x in (100, 600)]


class Operator:
    """The command with a pipe in place of a keyboard."""

    def __init__(self, folder: Path, *options: str, limit: int | None = None) -> None:
        def small() -> None:
            if limit is not None:
                resource.setrlimit(resource.RLIMIT_FSIZE, (limit, resource.RLIM_INFINITY))

        self.process = subprocess.Popen(
            [*COMMAND, "acquire", str(folder), *options], stdin=subprocess.PIPE, stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT, text=True, bufsize=1, env=ENVIRONMENT, preexec_fn=small,
        )  # fmt: skip
        self.told: list[str] = []
        self._lines: queue.Queue[str | None] = queue.Queue()
        threading.Thread(target=self._listen, daemon=True).start()

    def type(self, *lines: str) -> None:
        assert self.process.stdin is not None
        with suppress(BrokenPipeError):
            for line in lines:
                self.process.stdin.write(line + "\n")

    def hear(self, wanted: str) -> str:
        """Lines until one has what is wanted."""
        with suppress(queue.Empty):
            while (line := self._lines.get(timeout=PATIENCE_S)) is not None:
                self.told.append(line)
                if re.search(wanted, line):
                    return line
        raise AssertionError(f"{wanted!r} was not said: {self.told[-5:]}")

    def _listen(self) -> None:
        assert self.process.stdout is not None
        for line in self.process.stdout:
            self._lines.put(line.rstrip("\n"))
        self._lines.put(None)

    def _rest(self) -> None:
        """To the end of the process."""
        self.process.wait(PATIENCE_S)
        while (line := self._lines.get(timeout=PATIENCE_S)) is not None:
            self.told.append(line)
        for pipe in (self.process.stdin, self.process.stdout):
            assert pipe is not None
            with suppress(BrokenPipeError):
                pipe.close()

    def end(self) -> int:
        self.type("quit")
        self._rest()
        return int(self.process.returncode)

    def kill(self) -> None:
        self.signal(signal.SIGKILL)

    def signal(self, number: signal.Signals) -> None:
        """Send a signal, and hear it out."""
        self.process.send_signal(number)
        self._rest()

    @property
    def accepted(self) -> list[str]:
        return [line for line in self.told if line.startswith("accepted: ")]


@contextmanager
def operating(folder: Path, *options: str, limit: int | None = None) -> Iterator[Operator]:
    operator = Operator(folder, *options, limit=limit)
    try:
        yield operator
    finally:
        if operator.process.poll() is None:
            operator.signal(signal.SIGKILL)


def places(folder: Path) -> list[str]:
    return [
        "accepted: measurement {}, point {}, repeat {}".format(*point.place)
        for point in read_story(folder / "acquisition").points.values()
    ]  # fmt: skip


def many_bars(folder: Path) -> Path:
    rows = [f"{i},{p},1,{100 if p == 1 else 600},100,-300,0" for i in range(1, 41) for p in (1, 2)]
    return job_folder(folder, plan="measurement,point,repeat,x_mm,y_mm,z_mm,time_s\n" + "\n".join(rows) + "\n")


@pytest.mark.long
def test_what_was_shown_as_accepted_survives_a_kill_and_it_goes_on(tmp_path: Path) -> None:
    """Once; benchmarks/acquisition/kills.py does it a thousand times."""
    folder = many_bars(tmp_path / "job")
    with operating(folder) as operator:
        operator.type(*POINTS)
        for _ in range(5):
            operator.hear("^accepted: ")
        operator.kill()
        shown = [line.rpartition(":")[0] for line in operator.accepted]
    assert len(shown) >= 5
    kept = places(folder)
    assert shown == kept[: len(shown)]
    with operating(folder) as operator:
        assert operator.end() == 0
        assert f"{len(kept)} points are kept" in " ".join(operator.told)
    assert len(read_job(folder).points) == len(kept) // 2 * 2


@pytest.mark.long
def test_on_a_full_disk_nothing_is_accepted_and_it_goes_on_when_there_is_room(tmp_path: Path) -> None:
    folder = many_bars(tmp_path / "job")
    with operating(folder, limit=6000) as operator:
        operator.type(*POINTS)
        operator.hear("no room on the disk .* wait in memory, not accepted")
        shown = len(operator.accepted)
        assert 0 < shown < len(POINTS)
        assert shown <= len(places(folder))  # all that was shown is in what the disk holds
        resource.prlimit(operator.process.pid, resource.RLIMIT_FSIZE, (resource.RLIM_INFINITY, resource.RLIM_INFINITY))
        operator.hear("there is room on the disk again")
        for _ in range(len(POINTS) - len(operator.accepted)):
            operator.hear("^accepted: ")
        assert operator.end() == 0
    assert len(places(folder)) == len(POINTS)
    assert len(read_job(folder).points) == len(POINTS)


@pytest.mark.long
def test_a_machine_and_a_logger_at_real_sockets_one_of_them_unplugged(tmp_path: Path) -> None:
    machine = SimulatedIppServer()
    with SimulatedLine(Lines(), "socket") as logger:
        folder = job_folder(tmp_path / "job", f"""
max_gap_s = 0.8
[[acquire.source]]
name = "cmm"
profile = "ipp"
port = "{machine.url}"
serial = "CMM-7"
[[acquire.source]]
name = "air"
profile = "line-logger"
port = "{logger.port}"
certificate = "K-2031"
values = {{ value1 = "temp_air_c", value2 = "temp_artefact_c", value3 = "dew_c" }}
""")  # fmt: skip
        with operating(folder) as operator:
            operator.hear("next: measurement 1")
            time.sleep(0.6)
            machine.pick(100.0, 100.0, -300.0)
            operator.hear("^accepted: .* point 1")
            time.sleep(0.7)  # as fast as a machine can
            machine.pick(600.001, 100.0, -300.0)
            operator.hear("^accepted: .* point 2")
            operator.hear("^deviation")  # both have their temperatures
            logger.unplug()
            operator.hear("^air: ")
            machine.pick(100.0, 100.001, -300.0)
            machine.pick(600.0, 100.001, -300.0)
            operator.hear("temp_air_c: air gave nothing")
            logger.plug_in()
            operator.hear("^air is back after")
            assert operator.end() == 0
    machine.close()
    job = read_job(folder)
    assert job.points.xyz[1].tolist() == [600.001, 100.0, -300.0]
    acquired = job.acquired
    assert acquired is not None
    told = {one.name: one for one in acquired.said.instruments}
    assert (told["cmm"].serial, told["cmm"].firmware, told["air"].certificate) == ("CMM-7", "I++ DME 1.4.3", "K-2031")
    header, first, *_ = (folder / "bar.csv").read_text(encoding="utf-8").splitlines()
    values = dict(zip(header.split(","), first.split(","), strict=True))
    assert (float(values["temp_air_c"]), float(values["temp_artefact_c"])) == (20.01, 20.02)
    assert acquired.said.columns["temp_air_c"].missing[0] == (1, 1, 2)
    assert acquired.said.gaps


SCALES = """
[[acquire.source]]
name = "scales"
profile = "line-logger"
port = "{port}"
values = {{ value1 = "x_mm", value2 = "y_mm", value3 = "z_mm", value4 = "temp_artefact_c" }}
"""


@pytest.mark.long
def test_points_taken_from_scales_as_fast_as_keys_are_pressed_are_reported_at_once(tmp_path: Path) -> None:
    """Their times are of the program's own clock, so that 0.2 s from ball to ball are no minutes."""
    speaker = Lines()
    with SimulatedLine(speaker, "pty", tmp_path) as line:
        folder = job_folder(tmp_path / "job", SCALES.format(port=line.port))
        with operating(folder) as operator:
            operator.hear("next: measurement 1")
            for x, y, z in ((100, 100, -300), (600.001, 100, -300), (100, 100.001, -300), (600.002, 100.001, -300),
                            (100, 100, -300), (100, 600.003, -300), (100, 100, -300), (500.001, 400, -300)):  # fmt: skip
                speaker.readings[:] = [x, y, z, 20.0]
                time.sleep(0.25)
                operator.type("")
                operator.hear("^accepted: ")
            assert operator.end() == 0
    job = read_job(folder)
    steps = job.points.columns["time_s"][1::2] - job.points.columns["time_s"][::2]
    assert (steps > 0).all()
    assert (steps < 0.6).any()
    told = run("report", folder)
    assert (told.returncode, told.stderr) == (0, "")
    (folder / "bar.csv").write_text((folder / "bar.csv").read_text(encoding="utf-8") + "# changed\n", encoding="utf-8")
    changed = run("report", folder)  # whose clock is it now?
    assert changed.returncode == 2
    assert "looks like minutes or hours" in changed.stderr


@pytest.mark.long
def test_answers_that_nobody_asked_for_are_counted_on_the_certificate(tmp_path: Path) -> None:
    class Twice(Readout1502):
        def answer(self, command: str) -> bytes:
            return super().answer(command) * (1 + (command == "T"))

    with SimulatedLine(Twice(), "pty", tmp_path) as line:
        folder = job_folder(tmp_path / "job", f"""
[[acquire.source]]
name = "bar"
profile = "fluke-1502a"
port = "{line.port}"
values = {{ temp_c = "temp_artefact_c" }}
""")  # fmt: skip
        with operating(folder) as operator:
            operator.hear("^bar: temp_c = 20.013 answers no question, and is not used: nobody had asked")
            operator.type("100 100 -300", "600.001 100 -300")
            operator.hear("1 of 4 set-ups")
            assert operator.end() == 0
    told = read_job(folder).acquired
    assert told is not None
    (bar,) = told.said.instruments
    assert bar.unasked >= 1
    assert f"{bar.unasked} answer" in str(bar.sentence)
    assert bar.units == {}  # it says them itself


@pytest.mark.long
def test_a_folder_of_results_is_read_as_they_come(tmp_path: Path) -> None:
    folder = job_folder(tmp_path / "job", 'folder = "drop"\n')
    (folder / "drop").mkdir()
    with operating(folder) as operator:
        operator.hear("next: measurement 1")
        unfinished = folder / "drop" / ".result.csv"
        unfinished.write_text("X [mm];Y [mm];Z [mm]\n100,0;100,0;-300,0\n600,002;100,0;-300,0\n", encoding="utf-8")
        unfinished.rename(folder / "drop" / "result.csv")
        operator.hear("1 of 4 set-ups")
        assert operator.end() == 0
    job = read_job(folder)
    assert job.points.xyz[1].tolist() == [600.002, 100.0, -300.0]
    assert [path.name for path in (folder / "acquisition" / "files").iterdir()] == ["0001-result.csv"]
    assert "Points were read from result.csv." in str(job.acquired.sentence)  # type: ignore[union-attr]


@pytest.mark.long
def test_the_screen_takes_keys_shows_what_comes_next_and_leaves_the_terminal_as_it_was(tmp_path: Path) -> None:
    import pty

    folder = job_folder(tmp_path / "job")
    master, slave = pty.openpty()
    before = termios.tcgetattr(slave)
    with subprocess.Popen([*COMMAND, "acquire", str(folder)], stdin=slave, stdout=slave, stderr=slave,
                          env={**ENVIRONMENT, "COLUMNS": "100", "LINES": "40"}) as process:  # fmt: skip

        def see(wanted: str) -> str:
            shown = until(master, wanted, time.monotonic() + PATIENCE_S)
            assert re.search(wanted, shown), shown[-2000:]
            return shown

        first = see("next: measurement 1")
        assert "from above" in first + see("from the front")
        os.write(master, b"100 100 -300\r")
        see("accepted: measurement 1, point 1")
        os.write(master, b"600.003 100 -301\x7f0\r")  # a digit taken back
        see(r"deviation \+3.0")
        os.write(master, b"undo slipped\r")
        see("taken back")
        os.write(master, b"quit\r")
        see("cmm-uq report|no set-up is complete")
        process.wait(PATIENCE_S)
    assert process.returncode == 0
    assert termios.tcgetattr(slave) == before
    os.close(master)
    os.close(slave)
    assert [point.columns["z_mm"] for point in read_story(folder / "acquisition").points.values()] == [-300.0]


@pytest.mark.long
def test_an_interruption_ends_it_at_once_and_says_that_what_was_accepted_is_written(tmp_path: Path) -> None:
    folder = job_folder(tmp_path / "job")
    with operating(folder) as operator:
        operator.type("100 100 -300")
        operator.hear("^accepted")
        operator.signal(signal.SIGINT)
    assert operator.process.returncode == 130
    assert "interrupted; what was asked for is written" in operator.told[-1]
    assert len(places(folder)) == 1


def test_a_trial_without_instruments_is_marked_simulated_and_can_be_reported(tmp_path: Path) -> None:
    trial = tmp_path / "trial"
    with operating(job_folder(tmp_path / "job"), "--simulate", "--out", str(trial)) as operator:
        operator.type("", "")
        operator.hear("1 of 4 set-ups")
        assert operator.end() == 0
    job = read_job(trial)
    assert (job.origin, len(job.points)) == ("simulated", 2)
    text = (trial / "job.toml").read_text(encoding="utf-8")
    (trial / "job.toml").write_text(text.replace('origin = "simulated"', ""), encoding="utf-8")
    passed_off = run("report", trial)
    assert passed_off.returncode == 2
    assert "the recording was simulated, and job.toml says measured" in passed_off.stderr


@pytest.mark.parametrize(("options", "told"), [
    (("--simulate",), "a simulated recording would pass for measured"), (("--out", "x"), "--out is for a trial"),
])  # fmt: skip
def test_a_trial_never_touches_a_measured_job(tmp_path: Path, options: tuple[str, ...], told: str) -> None:
    folder = job_folder(tmp_path / "job")
    ended = run("acquire", folder, *options, cwd=tmp_path)
    assert ended.returncode == 2
    assert told in ended.stderr
    assert not (folder / "acquisition").exists()


def test_a_trial_whose_plan_cannot_be_read_leaves_no_folder(tmp_path: Path) -> None:
    job = job_folder(tmp_path / "job")
    for content in (b"measurement,point,x_mm,y_mm,z_mm\n1,1,0,0\n", None):
        if content is None:
            (job / "plan.csv").unlink()
        else:
            (job / "plan.csv").write_bytes(content)
        ended = run("acquire", job, "--simulate", "--out", tmp_path / "out", cwd=tmp_path)
        assert ended.returncode == 2
        assert "plan.csv" in ended.stderr
        assert not (tmp_path / "out").exists()


def test_a_trial_where_no_folder_can_be_is_refused_in_a_line(tmp_path: Path) -> None:
    job = job_folder(tmp_path / "job")
    (tmp_path / "taken").write_text("mine", encoding="utf-8")
    for out in ("taken", "taken/x"):
        ended = run("acquire", job, "--simulate", "--out", out, cwd=tmp_path)
        assert ended.returncode == 3
        assert ended.stderr.startswith(f"cmm-uq: {out}: cannot be made: ")
        assert len(ended.stderr.splitlines()) == 1
    assert (tmp_path / "taken").read_text(encoding="utf-8") == "mine"


@pytest.mark.parametrize(("more", "told"), [
    ('plan_ = "x"', "plan"), ('folder = "none"', "is no folder"),
    ('[[acquire.source]]\nname = "a"\nprofile = "line-logger"\nport = "/dev/none"', "/dev/none"),
    ('[[acquire.source]]\nname = "a"\nprofile = "nothing"', "there is no profile 'nothing'"),
    ("max_gap_s = 0", "max_gap_s"),
    ('[[acquire.source]]\nname = "a"\nprofile = "line-logger"\nvalues = { value1 = "temp_x_c", value2 = "temp_x_c" }',
     "two quantities go into the column temp_x_c"),
    ('[[acquire.source]]\nname = "a"\nprofile = "line-logger"\nvalues = { value1 = "temp_x_k" }',
     "the column 'temp_x_k' is not in the unit of 'temp_x_c'"),
])  # fmt: skip
def test_a_wrong_job_is_refused_in_one_line_and_nothing_is_left(tmp_path: Path, more: str, told: str) -> None:
    folder = job_folder(tmp_path / "job", more)
    ended = run("acquire", folder)
    assert ended.returncode == 2
    assert told in ended.stderr
    assert ended.stderr.count("\n") == 1
    assert sorted(path.name for path in folder.iterdir()) == ["job.toml", "plan.csv"]
