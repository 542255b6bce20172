"""The command as a user meets it: real files, real interruptions, and a process of its own where that matters."""

from __future__ import annotations

import json
import os
import re
import signal
import subprocess
import sys
import time
from pathlib import Path

import pikepdf
import pytest

from cmm_uq.jobs.dcc import read
from tests.app.cli.process import COMMAND, run, run_apart
from tests.app.cli.terminal import everything, on_terminal, until

FILES = [
    "certificate.html", "certificate.pdf", "certificate.xml", "manifest.json", "posterior.npz", "provenance.json",
    "results.json",
]  # fmt: skip


@pytest.fixture(scope="module")
def done(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, subprocess.CompletedProcess[str]]:
    folder = tmp_path_factory.mktemp("empty")
    example = Path(__file__).parents[3] / "examples" / "iota-1102-20C"
    return folder, run_apart("report", example, "--verbose", cwd=folder)


def test_it_writes_its_files_and_their_manifest_below_reports(
    done: tuple[Path, subprocess.CompletedProcess[str]],
) -> None:
    folder, process = done
    assert process.returncode == 0, process.stderr
    assert sorted(path.name for path in (folder / "reports" / "iota-1102-20C").iterdir()) == FILES


def test_the_digital_certificate_carries_the_page(done: tuple[Path, subprocess.CompletedProcess[str]]) -> None:
    folder, _ = done
    report = folder / "reports" / "iota-1102-20C"
    found = read((report / "certificate.xml").read_bytes(), "certificate.xml")
    assert found.document is not None
    assert found.document.data == (report / "certificate.html").read_bytes()
    assert b"certificate.xml" in found.document.data


def test_it_ends_with_a_summary_in_plain_lines(done: tuple[Path, subprocess.CompletedProcess[str]]) -> None:
    _, process = done
    assert "404.2051" in process.stdout
    assert "FAIL" in process.stdout
    assert "certificate.pdf" in process.stdout
    assert process.stdout.startswith("FAIL  ASME B89.4.1-1997, volumetric performance: 340 µm against 60 µm; ")
    assert "\x1b" not in process.stdout + process.stderr
    assert "Sampling the posterior" in process.stderr


def test_the_pdf_carries_the_job_and_the_results(
    done: tuple[Path, subprocess.CompletedProcess[str]], iota: Path
) -> None:
    folder, _ = done
    report = folder / "reports" / "iota-1102-20C"
    with pikepdf.open(report / "certificate.pdf") as pdf:
        attached = {name: pdf.attachments[name].get_file().read_bytes() for name in pdf.attachments}
    assert attached["results.json"] == (report / "results.json").read_bytes()
    assert attached["certificate.xml"] == (report / "certificate.xml").read_bytes()
    assert attached["posterior.npz"] == (report / "posterior.npz").read_bytes()
    assert attached["provenance.json"] == (report / "provenance.json").read_bytes()
    assert attached["job.toml"] == (iota / "job.toml").read_bytes()
    assert attached["ballbar.csv"] == (iota / "ballbar.csv").read_bytes()


@pytest.mark.long
def test_a_second_run_gives_the_same_bytes(
    done: tuple[Path, subprocess.CompletedProcess[str]], iota: Path, tmp_path: Path
) -> None:
    folder, _ = done
    assert run_apart("report", iota, "--out", tmp_path / "again", "--quiet").returncode == 0
    for name in FILES:
        assert (tmp_path / "again" / name).read_bytes() == (folder / "reports" / "iota-1102-20C" / name).read_bytes()


def test_json_goes_to_standard_output_and_quiet_says_nothing(iota: Path, tmp_path: Path) -> None:
    printed = run("report", iota, "--out", tmp_path / "out", "--json", "--seed", "3")
    data = json.loads(printed.stdout)
    assert data["sampling"]["seed"] == 3
    assert printed.stdout.encode() == (tmp_path / "out" / "results.json").read_bytes()
    assert printed.stderr == ""


def test_a_job_that_is_not_there_is_told_in_one_line(tmp_path: Path) -> None:
    process = run("report", tmp_path / "nothing", cwd=tmp_path)
    assert process.returncode == 2
    assert "no such file" in process.stderr
    assert "Traceback" not in process.stderr
    assert not (tmp_path / "reports").exists()


def test_bad_input_leaves_nothing_behind(job: Path, tmp_path: Path) -> None:
    path = job / "ballbar.csv"
    path.write_text(
        path.read_text(encoding="utf-8").replace("404", "x", 1).replace("-496.6823", "nan", 1), encoding="utf-8"
    )
    process = run("report", job, "--out", tmp_path / "out")
    assert process.returncode == 2
    assert "line 2, column x_mm: 'nan' is not a finite number" in process.stderr
    assert not (tmp_path / "out").exists()


@pytest.mark.skipif(os.name == "nt" or os.geteuid() == 0, reason="needs a user whom permissions bind")
def test_an_unwritable_folder_is_refused_before_anything_is_computed(iota: Path, tmp_path: Path) -> None:
    tmp_path.chmod(0o500)
    process = run("report", iota, "--out", tmp_path / "out")
    tmp_path.chmod(0o700)
    assert process.returncode == 3
    assert "Permission denied" in process.stderr


@pytest.mark.parametrize(
    "line",
    [("check",), ("report",), ("report", "job", "--out"), ("batch",), ("verify",), ("records", "verify", "--records")],
)
def test_a_name_that_is_too_long_is_refused_in_words(job: Path, line: tuple[str, ...]) -> None:
    process = run(*(job if word == "job" else word for word in line), job.parent / ("long" * 80))
    assert process.returncode == (3 if line[-1].startswith("--") else 2)
    assert re.search(": (is too long a name|cannot be .*: File name too long)", process.stderr)


def test_a_file_where_the_folder_should_be_is_refused(iota: Path, tmp_path: Path) -> None:
    (tmp_path / "out").write_text("mine")
    process = run("report", iota, "--out", tmp_path / "out")
    assert process.returncode == 2
    assert "is a file, not a folder" in process.stderr
    assert "Sampling" not in process.stderr


@pytest.mark.long
@pytest.mark.skipif(os.name == "nt", reason="signals of POSIX")
@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_an_interruption_leaves_no_half_report(iota: Path, tmp_path: Path, number: signal.Signals) -> None:
    out, records = tmp_path / "out", tmp_path / "records.db"
    with subprocess.Popen(
        [*COMMAND, "report", str(iota), "--out", str(out), "--records", str(records), "--verbose"],
        stderr=subprocess.PIPE,
        text=True,
    ) as process:
        assert process.stderr is not None
        for line in process.stderr:
            if "Rendering" in line:
                break
        process.send_signal(number)
        rest = process.stderr.read()
    assert process.returncode == 128 + number
    assert "nothing was written" in rest
    assert "Traceback" not in rest
    assert list(tmp_path.iterdir()) == []  # no records without an entry either


def test_a_wrong_option_is_answered_with_exit_code_2(iota: Path) -> None:
    assert run_apart("report", iota, "--seed", "-1").returncode == 2
    assert run("reprot", iota).returncode == 2


def test_help_and_errors_import_nothing_heavy() -> None:
    code = (
        "import sys; sys.argv = ['cmm-uq', 'report', '--help']\n"
        "from cmm_uq.app.cli.commands import run; run()\n"
        "heavy = {'numpy', 'scipy', 'pandas', 'matplotlib', 'emcee', 'arviz', 'jinja2', 'typst', 'rich.console'}\n"
        "import cmm_uq.app.cli.terminal\n"  # what tells an error on a terminal
        "print(sorted(heavy & set(sys.modules)))"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert "Usage: cmm-uq report" in done.stdout
    assert done.stdout.splitlines()[-1] == "[]"


def test_the_version_is_printed() -> None:
    from cmm_uq import __version__

    assert run_apart("--version").stdout.strip() == f"cmm-uq {__version__}"


@pytest.mark.long
@pytest.mark.skipif(os.name == "nt", reason="pseudo-terminals of POSIX")
def test_on_a_terminal_there_are_progress_and_a_decision_in_colour(iota: Path, tmp_path: Path) -> None:
    code, shown = on_terminal("report", iota, "--out", tmp_path / "out", columns=60)
    assert code == 0
    assert re.search(r"Sampling the posterior: \d+% of the", shown)
    _, _, result = shown.rpartition("\x1b[2K")  # the bar is wiped away before the result is printed
    assert re.search(r"\x1b\[1;31mFAIL *\x1b\[0m", result)
    lines = re.sub(r"\x1b\[[0-9;]*m", "", result).split("\n")
    assert max(len(line) for line in lines if not line.startswith("Written to")) <= 60


@pytest.mark.long
@pytest.mark.skipif(os.name == "nt", reason="signals of POSIX")
def test_ctrl_c_wipes_the_bar_away_and_leaves_one_line(iota: Path, tmp_path: Path) -> None:
    import pty

    master, slave = pty.openpty()
    environment = {**os.environ, "TERM": "xterm", "COLUMNS": "60"}
    with subprocess.Popen([*COMMAND, "report", iota, "--out", tmp_path / "out"], stdin=slave, stdout=slave, stderr=slave,
                          env=environment, start_new_session=True) as process:  # fmt: skip
        os.close(slave)
        assert "Sampling" in until(master, "Sampling", time.monotonic() + 60)
        process.send_signal(signal.SIGINT)
        shown = everything(master, time.monotonic() + 30)
    os.close(master)
    assert process.returncode == 130
    assert shown.rpartition("\x1b[?25h")[2] == "cmm-uq: interrupted; nothing was written\r\n"
    assert not (tmp_path / "out").exists()
