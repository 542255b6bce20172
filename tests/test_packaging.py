"""The wheel is complete by itself: it writes a certificate from an empty folder, far from the checkout."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
import tomllib
import zipfile
from itertools import chain
from pathlib import Path

import pytest
from packaging.requirements import Requirement
from packaging.utils import canonicalize_name

from cmm_uq import __version__
from cmm_uq.laboratory.live.instruments.library import ready
from tests.catalogues import TRANSLATED
from tests.conftest import ROOT


@pytest.fixture(scope="module")
def unpacked(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("wheel")
    subprocess.run(
        [sys.executable, "-m", "hatchling", "build", "-t", "wheel", "-d", str(folder)],
        check=True, capture_output=True, cwd=ROOT,
    )  # fmt: skip
    (wheel,) = folder.glob("*.whl")
    with zipfile.ZipFile(wheel) as archive:
        archive.extractall(folder / "site")
    return folder / "site"


def test_the_wheel_holds_the_templates_the_catalogues_its_type_marker_and_the_profiles(unpacked: Path) -> None:
    packed = {path.name for path in (unpacked / "cmm_uq" / "templates").iterdir()}
    assert packed == {path.name for path in (ROOT / "templates").iterdir()}
    assert (unpacked / "cmm_uq" / "py.typed").is_file()
    assert {
        path.stem for path in (unpacked / "cmm_uq" / "laboratory" / "live" / "instruments" / "profiles").iterdir()
    } == set(ready())
    assert {path.stem for path in (unpacked / "cmm_uq" / "base" / "languages").glob("*.po")} == set(TRANSLATED)
    assert not (unpacked / "tests").exists()


EXTRAS = [
    "asn1crypto", "cryptography", "dask", "distributed", "pkcs11", "psycopg", "pyarrow", "pyhanko", "pyhanko_certvalidator",
    "pyvisa", "signxml",
]  # fmt: skip
"""What only extras install, and a report does without."""


def test_it_reports_from_an_empty_folder(unpacked: Path, tmp_path: Path) -> None:
    shutil.copytree(ROOT / "examples" / "iota-1102-20C", tmp_path / "job")
    script = (
        f"import sys; sys.modules.update(dict.fromkeys({EXTRAS}))\n"
        "import cmm_uq; assert 'site' in cmm_uq.__file__, cmm_uq.__file__\n"
        "from cmm_uq.app.cli import main; main()"
    )
    done = subprocess.run(
        [sys.executable, "-c", script, "report", "job"], cwd=tmp_path, capture_output=True, text=True, check=False,
        env={**os.environ, "PYTHONPATH": str(unpacked)},
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    assert (tmp_path / "reports" / "iota-1102-20C" / "certificate.pdf").read_bytes().startswith(b"%PDF")


def test_the_locked_environment_has_whatever_the_package_asks_for() -> None:
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    asked = [
        Requirement(text) for text in (*project["dependencies"], *chain(*project["optional-dependencies"].values()))
    ]
    packages = tomllib.loads((ROOT / "pylock.toml").read_text(encoding="utf-8"))["packages"]
    locked = {package["name"]: package["version"] for package in packages}
    others = [wanted for wanted in asked if wanted.name != project["name"]]
    missing = [
        wanted for wanted in others if not wanted.specifier.contains(locked.get(canonicalize_name(wanted.name), ""))
    ]
    assert not missing


def test_the_citation_names_this_version() -> None:
    assert f"\nversion: {__version__}\n" in (ROOT / "CITATION.cff").read_text(encoding="utf-8")
