"""Budgets of models, and the schemas of all that is read."""

from __future__ import annotations

import io
import json
import re
import subprocess
import sys
import tomllib
from pathlib import Path
from typing import Any

import jsonschema
import pikepdf
import pypdf
import pytest

from cmm_uq.app.commands.budget import write_budget
from cmm_uq.app.commands.forms import SCHEMAS, as_text, schema_named
from cmm_uq.artefacts import kind_named
from cmm_uq.base.errors import CmmUqError
from cmm_uq.jobs.schema import keys_of
from tests.conftest import MACHINE_JOBS, ROOT
from tests.plugin.packages import OUTSIDE_EFFECTS, OUTSIDE_KINDS, install

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


@pytest.mark.long
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


@pytest.fixture(scope="module")
def job() -> jsonschema.Draft7Validator:
    schema = schema_named("job")
    jsonschema.Draft7Validator.check_schema(schema)
    return jsonschema.Draft7Validator(schema)


def dated(value: Any) -> Any:
    """TOML's dates as the texts that JSON has for them."""
    if isinstance(value, dict):
        return {key: dated(item) for key, item in value.items()}
    if isinstance(value, list):
        return [dated(item) for item in value]
    return value.isoformat() if hasattr(value, "isoformat") else value


def told(folder: Path) -> dict[str, Any]:
    found: dict[str, Any] = dated(tomllib.loads((folder / "job.toml").read_text(encoding="utf-8")))
    return found


@pytest.mark.parametrize("name", SCHEMAS)
def test_every_key_has_a_sentence(name: str) -> None:
    keys = dict(keys_of(schema_named(name)))
    assert len(keys) > 10
    assert [key for key, said in keys.items() if not said.get("description", "").strip().endswith(".")] == []


def test_schemas_hold_no_reference_and_no_null() -> None:
    """Editors show nothing of a key whose schema is a reference, and TOML has no null."""
    for name in SCHEMAS:
        text = as_text(schema_named(name))
        assert "$ref" not in text
        assert "null" not in text


@pytest.mark.parametrize("folder", MACHINE_JOBS, ids=lambda folder: folder.name)
def test_an_example_is_valid(folder: Path, job: jsonschema.Draft7Validator) -> None:
    job.validate(told(folder))


WRONG: tuple[tuple[str, str, Any], ...] = (
    ("artefact", "lenght_mm", 400.0),
    ("artefact", "form_um", 0.1),  # a key of another kind
    ("artefact", "kind", "balbar"),
    ("artefact", "length_mm", "400 mm"),
    ("artefact", "length_mm", -400.0),
    ("machine", "travel_mm", {"x": [0, 900, 1000]}),
    ("model", "effects", ["scale"]),
    ("job", "origin", "guessed"),
    ("recording", "file", None),
    ("conformity", "rule", "by feeling"),
    ("conformity", "standard", "ISO 10360"),
)
"""Table, key and value that report refuses, of a ballbar."""


@pytest.mark.parametrize(("table", "key", "value"), WRONG)
def test_what_a_table_alone_shows_to_be_wrong_is_invalid(
    table: str, key: str, value: Any, job: jsonschema.Draft7Validator, iota: Path
) -> None:
    data = told(iota)
    inside = data[table][0] if table == "conformity" else data[table]
    if value is None:
        del inside[key]
    else:
        inside[key] = value
    assert not job.is_valid(data)


def test_an_expanded_uncertainty_with_its_factor_and_a_limit_as_a_formula_are_valid(
    job: jsonschema.Draft7Validator, iota: Path
) -> None:
    data = told(iota)
    del data["artefact"]["u_um"]
    data["artefact"] |= {"U_um": 10.0, "k": 2}
    del data["conformity"][0]["limit_um"]
    data["conformity"][0]["mpe"] = "3 + L/300"
    job.validate(data)


def test_only_error_maps_need_no_recording(job: jsonschema.Draft7Validator, iota: Path) -> None:
    maps, bar = told(ROOT / "examples" / "iota-1102-maps"), told(iota)
    assert "recording" not in maps
    assert job.is_valid(maps)
    del bar["recording"]
    assert not job.is_valid(bar)


def test_kinds_and_effects_of_other_packages_take_part(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    for package in (OUTSIDE_KINDS, OUTSIDE_EFFECTS):
        monkeypatch.syspath_prepend(install(package, tmp_path))
    kind_named.cache_clear()
    schema = schema_named("job")
    kind_named.cache_clear()
    artefact = schema["properties"]["artefact"]["properties"]
    assert "tracker_length" in artefact["kind"]["enum"]
    assert artefact["u_um_per_m"]["description"].endswith("wavelength. Unit: µm/m. Kinds: tracker_length.")
    assert "beam_twist" in schema["properties"]["model"]["properties"]["effects"]["items"]["anyOf"][0]["enum"]


def test_an_effect_of_its_own_is_what_only_a_job_that_states_one_may_name(
    job: jsonschema.Draft7Validator, iota: Path
) -> None:
    data = told(iota)
    data["model"]["effects"] = ["my_own"]
    assert not job.is_valid(data)
    data["effect"] = [{"name": "my_own", "formula": "e_x = k*x*y", "unit": "µm/m²", "prior": 5.0}]
    assert job.is_valid(data)


MODEL = """
[model]
outputs = { y = "x1 * 2" }
[inputs.x1]
distribution = "normal"
value = "3 mm"
u = 0.1
unit = "mm"
"""
READY = """
[budget]
method = "ISO/TS 23165 probing"
error_um = 1.0
form_um = 0.1
u_form_um = 0.05
"""


@pytest.mark.parametrize(
    ("name", "text", "valid"),
    [
        ("budget", MODEL, True),
        ("budget", MODEL.replace("u = 0.1", "uncertainty = 0.1"), False),
        ("budget", READY, True),
        ("budget", READY + "length_mm = 3\n", False),
        ("budget", MODEL + READY, False),
        ("truth", "seed = 1\n[effects.scale_x]\nppm = 12\n[noise]\ncoordinate_um = { x = 1, y = 1, z = 2 }\n", True),
        ("truth", "sed = 1\n", False),
    ],
)
def test_budgets_and_truths_are_checked_likewise(name: str, text: str, valid: bool) -> None:
    assert jsonschema.Draft7Validator(schema_named(name)).is_valid(dated(tomllib.loads(text))) == valid


def test_an_unknown_schema_is_refused_with_those_that_there_are() -> None:
    with pytest.raises(CmmUqError, match="Did you mean 'truth'"):
        schema_named("thruth")
