"""A model file's budget as a user meets it."""

from __future__ import annotations

import io
import json
import re
import subprocess
import sys
from pathlib import Path

import pikepdf
import pypdf
import pytest

from cmm_uq.app.commands.budget import write_budget
from cmm_uq.base.errors import CmmUqError

COMPARISON_LOSS = """
[model]
outputs = { y = "x1**2 + x2**2" }
seed = 1
[inputs.x1]
distribution = "normal"
value = 0.05
u = 0.005
source = "certificate 123"
[inputs.x2]
distribution = "normal"
value = 0.0
u = 0.005
"""


@pytest.fixture
def file(tmp_path: Path) -> Path:
    path = tmp_path / "loss.toml"
    path.write_text(COMPARISON_LOSS, encoding="utf-8")
    return path


def test_the_comparison_loss_of_jcgm_101_is_written(file: Path, tmp_path: Path) -> None:
    """JCGM 101:2008 9.4.2.2, x1 = 0.050, r = 0: y = 2550·10⁻⁶, u = 502·10⁻⁶, shortest interval [1590, 3543]·10⁻⁶."""
    written = write_budget(file, tmp_path / "out")
    assert sorted(written.files) == ["budget.html", "budget.pdf", "manifest.json", "results.json"]
    y = json.loads(written.results)["outputs"]["y"]
    assert y["method"] == "monte_carlo"
    assert y["value"] == pytest.approx(2550e-6, abs=3e-6)
    assert y["u"] == pytest.approx(502.5e-6, abs=5e-6)
    assert y["interval"] == pytest.approx([1593.6e-6, 3548.6e-6], abs=25e-6)


def test_page_and_pdf_carry_the_same_figures_and_the_model(file: Path, tmp_path: Path) -> None:
    files = write_budget(file, tmp_path / "out").files
    page = re.sub(r"<[^>]+>", " ", files["budget.html"].read_text(encoding="utf-8"))
    pdf = files["budget.pdf"].read_bytes()
    text = "".join(p.extract_text() for p in pypdf.PdfReader(io.BytesIO(pdf)).pages)
    for figure in ("0.00050", "certificate 123", "Monte Carlo", "x1**2 + x2**2"):
        assert figure in page
        assert figure.replace(" ", "") in text.replace(" ", "").replace("\n", "")
    with pikepdf.open(io.BytesIO(pdf)) as opened:
        assert opened.attachments["loss.toml"].get_file().read_bytes() == file.read_bytes()


def test_the_same_seed_gives_the_same_bytes(file: Path, tmp_path: Path) -> None:
    first, again = (write_budget(file, tmp_path / name).files for name in ("a", "b"))
    for name in first:
        assert first[name].read_bytes() == again[name].read_bytes()


def test_an_unknown_name_in_an_expression_is_refused(file: Path, tmp_path: Path) -> None:
    file.write_text(COMPARISON_LOSS.replace("x2**2", "x3**2"), encoding="utf-8")
    with pytest.raises(CmmUqError, match="x3"):
        write_budget(file, tmp_path / "out")
    assert not (tmp_path / "out").exists()


def test_the_command_prints_the_result_and_refuses_code(file: Path, tmp_path: Path) -> None:
    command = [sys.executable, "-m", "cmm_uq", "budget", str(file), "--out", str(tmp_path / "out")]
    done = subprocess.run(command, capture_output=True, text=True, check=False, encoding="utf-8")
    assert done.returncode == 0
    assert "0.00255" in done.stdout
    file.write_text(COMPARISON_LOSS.replace("x1**2 + x2**2", "__import__('os').getcwd()"), encoding="utf-8")
    done = subprocess.run(command, capture_output=True, text=True, check=False, encoding="utf-8")
    assert done.returncode == 2
    assert "Traceback" not in done.stderr


def test_two_models_of_one_name_do_not_replace_each_other_and_a_moved_project_goes_on(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    text = '[model]\noutputs = { y = "2*x" }\nmethod = "first"\n[inputs.x]\ndistribution = "normal"\nvalue = 1.0\nu = 0.1\n'
    here = tmp_path / "here"
    for folder in ("a", "b"):
        (here / folder).mkdir(parents=True)
        (here / folder / "budget.toml").write_text(text)
    monkeypatch.chdir(here)
    write_budget(Path("a/budget.toml"))
    write_budget(here / "a" / "budget.toml")
    with pytest.raises(CmmUqError, match=r"holds what cmm-uq budget for a/budget\.toml wrote"):
        write_budget(Path("b/budget.toml"))
    moved = here.rename(tmp_path / "there")
    monkeypatch.chdir(moved)
    write_budget(Path("a/budget.toml"))
