"""Ready files start the very command that they were made for, whatever its paths hold: tried by sh and systemd."""

from __future__ import annotations

import json
import re
import shutil
import subprocess
import sys
import xml.etree.ElementTree as ET
from pathlib import Path, PureWindowsPath

import pytest

from cmm_uq.app.commands.laboratory.schedule import ready_files, write_ready
from cmm_uq.base.errors import CmmUqError
from cmm_uq.laboratory.schedule.schedulers import ScheduledCall, cron, encoded, systemd, windows

SHOW = (sys.executable, "-c", "import json, os, sys; print(json.dumps([os.getcwd(), sys.argv[1:]]))")
AWKWARD = ["plain", "two words", "50%", "o'neil", 'quo"te', "$HOME", "a;b", "ünï", "a&b"]
TASK = "{http://schemas.microsoft.com/windows/2004/02/mit/task}"


def call(tmp_path: Path, name: str, **further: object) -> ScheduledCall:
    folder = tmp_path / name
    folder.mkdir()
    return ScheduledCall(SHOW, (folder, folder / "x"), folder / "schedule.toml", folder, 6, 5, **further)  # type: ignore[arg-type]


@pytest.mark.skipif(shutil.which("sh") is None, reason="no sh")
@pytest.mark.parametrize("name", AWKWARD)
def test_what_cron_hands_to_sh_is_the_command(tmp_path: Path, name: str) -> None:
    r"""crontab(5): five fields, then the command up to the first ``%`` that has no backslash before it; ``\%`` is ``%``."""
    made = call(tmp_path, name)
    (text,) = cron(made).values()
    (line,) = [line for line in text.splitlines() if not line.startswith("#")]
    *fields, command = line.split(" ", 5)
    assert fields == ["5", "6", "*", "*", "*"]
    assert re.search(r"(?<!\\)%", command) is None
    done = subprocess.run(
        ["sh", "-c", command.replace("\\%", "%")], capture_output=True, text=True, check=True, cwd="/"
    )
    expected = [str(tmp_path / name), made.line("--quiet")[len(SHOW) :]]
    assert json.loads(done.stdout) == expected
    assert expected[1] == [
        "report",
        "--scheduled",
        *map(str, made.folders),
        "--schedule",
        str(made.schedule),
        "--quiet",
    ]


def test_cron_knows_the_days_by_their_names(tmp_path: Path) -> None:
    (text,) = cron(call(tmp_path, "x", days=("MON", "THU"))).values()
    assert "\n5 6 * * mon,thu cd " in text


def exec_words(setting: str) -> list[str]:
    words = re.findall(r'"((?:[^"\\]|\\.)*)"|(\S+)', setting)
    return [re.sub(r"\\(.)", r"\1", a or b).replace("%%", "%").replace("$$", "$") for a, b in words]


@pytest.mark.parametrize("name", AWKWARD)
def test_a_service_of_systemd_runs_the_command(tmp_path: Path, name: str) -> None:
    made = call(tmp_path, name, user="cmm")
    service = systemd(made)["cmm-uq-schedule.service"]
    settings = dict(line.split("=", 1) for line in service.splitlines() if "=" in line and not line.startswith("#"))
    assert exec_words(settings["ExecStart"]) == made.line()
    assert settings["WorkingDirectory"].replace("%%", "%") == str(tmp_path / name)
    assert settings["User"] == "cmm"
    assert "SuccessExitStatus" not in settings  # a Python that cannot start ends with 1


@pytest.mark.skipif(shutil.which("systemd-analyze") is None, reason="no systemd here")
def test_systemd_finds_nothing_wrong_with_the_units(tmp_path: Path) -> None:
    made = call(tmp_path, "50% o'neil", days=("MON", "SUN"))
    paths = []
    for name, text in systemd(made).items():
        (tmp_path / name).write_text(text)
        paths.append(tmp_path / name)
    done = subprocess.run(["systemd-analyze", "verify", *paths], capture_output=True, text=True, check=False)
    assert (done.returncode, done.stderr) == (0, "")
    when = re.search(r"OnCalendar=(.*)", paths[1].read_text())
    assert when is not None
    shown = subprocess.run(["systemd-analyze", "calendar", when[1]], capture_output=True, text=True, check=True).stdout
    assert "Normalized form: Mon,Sun *-*-* 06:05:00" in shown


def test_a_task_of_windows_keeps_to_its_schema(tmp_path: Path) -> None:
    """Task Scheduler Schema: one namespace, these elements, times as xs:dateTime, durations as xs:duration."""
    folder = PureWindowsPath(r"C:\CMM & Söhne\jobs")
    made = ScheduledCall(
        (r"C:\Program Files\Python\python.exe", "-m", "cmm_uq"), (folder,), None, folder, 6, 5, ("TUE",)
    )
    ((name, text),) = windows(made).items()
    task = ET.fromstring(encoded(name, text))
    assert task.tag == f"{TASK}Task"
    assert [child.tag.removeprefix(TASK) for child in task] == ["RegistrationInfo", "Triggers", "Settings", "Actions"]
    assert task.findtext(f".//{TASK}Command") == r"C:\Program Files\Python\python.exe"
    assert task.findtext(f".//{TASK}Arguments") == r'-m cmm_uq report --scheduled "C:\CMM & Söhne\jobs" --quiet'
    assert task.findtext(f".//{TASK}WorkingDirectory") == str(folder)
    assert re.fullmatch(r"\d{4}-\d\d-\d\dT06:05:00", task.findtext(f".//{TASK}StartBoundary") or "")
    assert [day.tag.removeprefix(TASK) for day in task.find(f".//{TASK}DaysOfWeek") or ()] == ["Tuesday"]
    assert task.findtext(f".//{TASK}MultipleInstancesPolicy") == "IgnoreNew"
    assert task.findtext(f".//{TASK}StartWhenAvailable") == "true"
    assert encoded(name, text)[:2] in (b"\xff\xfe", b"\xfe\xff")


def test_every_day_is_a_schedule_by_day(tmp_path: Path) -> None:
    (text,) = windows(call(tmp_path, "x")).values()
    assert "<ScheduleByDay>" in text
    assert "ScheduleByWeek" not in text


def test_ready_files_are_of_this_python_and_of_whole_paths_and_over_nothing(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "jobs").mkdir()
    monkeypatch.chdir(tmp_path)
    files = ready_files("systemd", [Path("jobs")], at="23:59", days="sun, MON")
    assert (
        f"ExecStart={sys.executable} -m cmm_uq report --scheduled {tmp_path}/jobs\n" in files["cmm-uq-schedule.service"]
    )
    assert "OnCalendar=Mon,Sun *-*-* 23:59:00\n" in files["cmm-uq-schedule.timer"]
    for path in write_ready(files, tmp_path):
        assert path.read_text() == files[path.name]
    with pytest.raises(CmmUqError, match="is there already"):
        write_ready(files, tmp_path)


@pytest.mark.parametrize(
    ("scheduler", "further", "told"),
    [
        ("crom", {}, "Did you mean 'cron'"),
        ("cron", {"at": "6"}, "'6' is no time of day"),
        ("cron", {"at": "24:00"}, "is no time of day"),
        ("cron", {"days": "MON,FUN"}, "'FUN' is no day of the week"),
        ("cron", {"folders": [Path("nowhere")]}, "no such folder"),
    ],
)
def test_what_is_wrong_is_told(tmp_path: Path, scheduler: str, further: dict[str, object], told: str) -> None:
    given: dict[str, object] = {"folders": [tmp_path], **further}
    with pytest.raises(CmmUqError, match=re.escape(told)):
        ready_files(scheduler, **given)  # type: ignore[arg-type]
