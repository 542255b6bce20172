"""What the documentation shows runs as it stands; what does not is marked as an excerpt, and is true to its form."""

from __future__ import annotations

import doctest
import os
import re
import shlex
import shutil
import subprocess
import sys
import tomllib
from pathlib import Path
from unittest import mock

import pytest
from typer.main import get_command

import cmm_uq
from benchmarks.examples.screens import PAGE, complete
from cmm_uq.app.cli.commands import app
from cmm_uq.laboratory.live.instruments.library import profile_of
from cmm_uq.maths.uncertainty.models.model_file import read_model_file
from tests.app.cli.process import run as run_here
from tests.conftest import ROOT
from tests.site.pages import PAGES, Snippet, snippets


def having(*languages: str, excerpt: bool = False) -> list[object]:
    """Pages with such a snippet, each named by its path."""
    return [
        pytest.param(page, id=page.relative_to(ROOT).as_posix())
        for page in PAGES if snippets(page, *languages, excerpt=excerpt)
    ]  # fmt: skip


@pytest.fixture
def project(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A folder with nothing but the examples and the tutorial's workbook, where a reader would stand."""
    (tmp_path / "examples").symlink_to(ROOT / "examples")
    shutil.copy(ROOT / "docs" / "tutorial" / "ballbar-export.xlsx", tmp_path)
    monkeypatch.chdir(tmp_path)
    return tmp_path


@pytest.mark.long(but="howto/part")
@pytest.mark.parametrize("page", having("python", "console"))
def test_a_page_runs_from_its_top_to_its_end(page: Path, project: Path) -> None:
    scope: dict[str, object] = {}
    for snippet in snippets(page, "python", "console"):
        if snippet.language == "console":
            obeyed(snippet, project)
        elif page.name == "CONTRIBUTING.md":
            compile(snippet.text, str(snippet), "exec")  # run by test_contributing.py
        elif ">>> " in snippet.text:
            test = doctest.DocTestParser().get_doctest(snippet.text, scope, str(snippet), str(page), snippet.line)
            runner = doctest.DocTestRunner(optionflags=doctest.NORMALIZE_WHITESPACE | doctest.ELLIPSIS)
            assert runner.run(test, clear_globs=False).failed == 0
            scope = test.globs
        else:
            exec(compile(snippet.text, str(snippet), "exec"), scope)


def obeyed(snippet: Snippet, project: Path) -> None:
    """Run the lines after ``$``; what follows one is found in its output. A code other than 0 is shown by ``echo $?``."""
    lines = snippet.text.replace("\\\n", " ").splitlines()
    here, code, output = project, 0, ""
    for line, following in zip(lines, [*lines[1:], ""], strict=True):
        if line == "$ echo $?":
            output = str(code)
        elif line.startswith("$ cd "):
            here = here / line.removeprefix("$ cd ")
        elif line.startswith("$ "):
            done = run(shlex.split(line.removeprefix("$ "), comments=True), here)
            code, output = done.returncode, done.stdout + done.stderr
            assert code == 0 or following == "$ echo $?", f"{snippet}: {line}\n{output}"
        elif line.strip() not in ("", "…"):
            assert line.strip() in output, f"{snippet}: {line!r} is not in\n{output}"


def run(words: list[str], here: Path) -> subprocess.CompletedProcess[str]:
    """A command of the project in this process, or one of the few of a shell that pages use."""
    assert words[0] in {"cmm-uq", "python", "python3", "cp", "mkdir", "cmp"}, words
    environment = {**os.environ, "PYTHONPATH": str(ROOT), "COLUMNS": "80", "NO_COLOR": "1"}
    if words[0] == "cmm-uq":
        with mock.patch.dict(os.environ, environment):
            return run_here(*words[1:], cwd=here)
    command = [sys.executable if words[0].startswith("python") else words[0], *words[1:]]
    return subprocess.run(command, cwd=here, env=environment, capture_output=True, text=True, check=False)


@pytest.mark.parametrize("page", having("toml"))
def test_a_whole_toml_file_is_read(page: Path, project: Path) -> None:
    for snippet in snippets(page, "toml"):
        keys = tomllib.loads(snippet.text)
        path = project / "job.toml"
        path.write_text(snippet.text, encoding="utf-8")
        if "recording" in keys:
            (example,) = (ROOT / "examples").glob(f"*-20C/{keys['recording']['file']}")
            shutil.copy(example, project)
            assert cmm_uq.read(project).facts.job.id == keys["job"]["id"]
        elif "outputs" in keys.get("model", {}):
            assert read_model_file(path).evaluate().stated
        elif "parse" in keys:
            assert profile_of(snippet.text.encode(), path).example
        elif "effects" in keys:
            assert cmm_uq.simulate(ROOT / "examples" / "iota-1102-20C", path).origin == "simulated"
        else:
            assert set(keys) == {"project"}, f"{snippet}: mark it as an excerpt"  # run by test_contributing.py


@pytest.mark.parametrize("page", having("toml", excerpt=True))
def test_an_excerpt_of_toml_keeps_to_its_form(page: Path) -> None:
    for snippet in snippets(page, "toml", excerpt=True):
        assert tomllib.loads(snippet.text), snippet


@pytest.mark.parametrize("page", having("console", excerpt=True))
def test_an_excerpt_of_commands_names_commands_that_exist(page: Path) -> None:
    names = set(get_command(app).commands)
    for snippet in snippets(page, "console", excerpt=True):
        for command in re.findall(r"^\$ cmm-uq (\S+)", snippet.text, re.MULTILINE):
            assert command in names or command.startswith("--"), f"{snippet}: {command}"


def test_every_block_that_could_run_says_so_in_its_language() -> None:
    """A block with ``cmm-uq`` or an import and no language would be looked at by none of these tests."""
    for page in PAGES:
        for block in snippets(page, "text", "sh", "bash", "py", "pycon", "shell"):
            assert not block.text.startswith(("$ ", ">>> ", "import ", "from ")), block


def test_what_the_tutorial_adds_completes_the_certificate(project: Path) -> None:
    """Of ISO/IEC 17025:2017, 7.8 nothing is missing any more, and nothing is wrong."""
    obeyed(snippets(PAGE, "console")[1], project)
    assert "17025" in run(["cmm-uq", "check", "iota"], project).stdout
    complete(project / "iota" / "job.toml")
    checked = run(["cmm-uq", "check", "iota"], project)
    assert checked.returncode == 0
    assert "17025" not in checked.stdout


@pytest.mark.long
def test_the_job_of_a_laboratory_with_everything_stated_passes(project: Path) -> None:
    """Readings are simulated, with a temperature beside them; on the form every clause is answered."""
    page = ROOT / "docs" / "howto" / "laboratory.md"
    (text,) = [block.text for block in snippets(page, "toml", excerpt=True) if "[recording]" in block.text]
    job, form = tomllib.loads(text), project / "stated" / tomllib.loads(text)["conformity"][0]["clauses"]
    assert run(["cmm-uq", "new", "step_gauge", "readings", "--quiet"], project).returncode == 0
    form.parent.mkdir()
    assert run(["cmm-uq", "standards", job["conformity"][0]["standard"], "--form", str(form)], project).returncode == 0
    answers = {"checked_by = \"\"": "checked_by = \"A. Example\"", "edition = \"\"": "edition = \"2009\"",
               "# on =": "on =", "# agrees =": "agrees ="}  # fmt: skip
    filled = form.read_text(encoding="utf-8")
    for blank, answer in answers.items():
        filled = filled.replace(blank, answer)
    form.write_text(filled, encoding="utf-8")
    (form.parent / "job.toml").write_text(text, encoding="utf-8")
    (form.parent / job["laboratory"]["logo"]).write_text('<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 9 9"/>')
    simulated, heading, *rows = (project / "readings" / "recording.csv").read_text(encoding="utf-8").splitlines()
    assert simulated.startswith("# simulated")
    assert heading.endswith(",temp_artefact_c")
    recorded = [heading, *(f"{row.rpartition(',')[0]},20.1" for row in rows), ""]
    (form.parent / job["recording"]["file"]).write_text("\n".join(recorded), encoding="utf-8")
    assert run(["cmm-uq", "check", "stated"], project).stdout.startswith("SOUND  stated: nothing would stop report\n")
    done = run(["cmm-uq", "report", "stated"], project)
    assert re.findall(r"^([A-Z]+)  ISO 10360-2:2009, (\w+): ", done.stdout, re.MULTILINE) == [
        ("PASS", "E0"),
        ("PASS", "R0"),
    ]
    assert "Not complete" not in done.stdout
