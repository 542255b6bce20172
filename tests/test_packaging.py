"""The wheel is complete by itself: it writes a certificate from an empty folder, far from the checkout."""

from __future__ import annotations

import contextlib
import ctypes
import os
import re
import shutil
import subprocess
import sys
import time
import tomllib
import zipfile
from collections.abc import Callable, Iterator
from itertools import chain
from pathlib import Path

import pytest
from packaging.requirements import Requirement
from packaging.utils import canonicalize_name

import start
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


@pytest.mark.long
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


@pytest.fixture
def beyond_permissions() -> Callable[[], None]:
    """For the child before it runs: root without its right to write whatever permissions say; others have none."""
    if not sys.platform.startswith("linux"):
        pytest.skip("Linux has rights that a process can give up one by one")
    libc = ctypes.CDLL(None, use_errno=True)

    def give_up() -> None:
        if os.geteuid() == 0 and libc.prctl(24, 1, 0, 0, 0) != 0:  # PR_CAPBSET_DROP, CAP_DAC_OVERRIDE
            raise OSError(ctypes.get_errno(), "the right cannot be given up")

    return give_up


@contextlib.contextmanager
def read_only(tree: Path) -> Iterator[None]:
    inside = [tree, *tree.rglob("*")]
    for path in inside:
        path.chmod(0o555 if path.is_dir() else 0o444)
    try:
        yield
    finally:
        for path in inside:
            path.chmod(0o755 if path.is_dir() else 0o644)


def compiled_at_start(tree: Path, home: Path, give_up: Callable[[], None]) -> set[str]:
    """Modules of a tree that Python compiles when a command starts, as ``python -v`` says."""
    line = [sys.executable, "-v", "-m", "cmm_uq", "schema", "job"]
    environment = {**os.environ, "PYTHONPATH": str(tree), "HOME": str(home)}
    for name in ("PYTHONDONTWRITEBYTECODE", "PYTHONPYCACHEPREFIX"):
        environment.pop(name, None)
    done = subprocess.run(
        line, capture_output=True, text=True, check=False, cwd=home, env=environment, preexec_fn=give_up
    )
    assert done.returncode == 0, done.stderr[-500:]
    assert f"{tree}/cmm_uq/__init__.py" in done.stderr
    return set(re.findall(rf"^# code object from {re.escape(str(tree))}/(\S+\.py)$", done.stderr, re.MULTILINE))


@pytest.mark.long
@pytest.mark.process
@pytest.mark.parametrize("way", ["nobody compiled", "pip", "start.py"])
def test_who_may_not_write_to_the_installation_compiles_nothing_at_each_start(
    way: str, unpacked: Path, tmp_path: Path, beyond_permissions: Callable[[], None]
) -> None:
    """pip compiles what it installs; start.py installs the tree as it stands, and compiles it then, and what was changed."""
    tree, home = tmp_path / "tree", tmp_path / "home"
    home.mkdir()
    if way == "pip":
        (wheel,) = unpacked.parent.glob("*.whl")
        pip = [sys.executable, "-m", "pip", "install", "--quiet", "--no-deps", "--no-index", "--target", tree, wheel]
        subprocess.run(pip, check=True, env={**os.environ, "PYTHONDONTWRITEBYTECODE": ""})
    else:
        shutil.copytree(unpacked, tree, ignore=shutil.ignore_patterns("__pycache__"))
    if way == "start.py":
        shutil.copy(ROOT / "start.py", tree)
        script = f"import start; start.SCRIPTS = start.Path(r'{sys.executable}').parent; start.compile_changed()"
        (tree / "env").mkdir()
        again = {**os.environ, "CMM_UQ_ENV": str(tree / "env"), "PYTHONPATH": str(tree)}
        for _ in range(2):
            subprocess.run([sys.executable, "-B", "-c", script], check=True, cwd=home, env=again)
            time.sleep(1.1)  # bytecode knows the time of its source to the second
            changed = tree / "cmm_uq" / "base" / "errors.py"  # as by a new version of the sources
            changed.write_text(changed.read_text(encoding="utf-8") + "\n# changed\n", encoding="utf-8")
        subprocess.run([sys.executable, "-B", "-c", script], check=True, cwd=home, env=again)
    with read_only(tree):
        probe = [sys.executable, "-c", f"open(r'{tree / 'cmm_uq' / 'probe'}', 'w')"]
        assert b"Permission denied" in subprocess.run(probe, capture_output=True, preexec_fn=beyond_permissions).stderr
        found = compiled_at_start(tree, home, beyond_permissions)
        assert found == compiled_at_start(tree, home, beyond_permissions)
    assert bool(found) is (way == "nobody compiled"), sorted(found)[:5]


def test_start_compiles_what_others_import_and_not_their_tests(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Also where the whole environment lies below a folder called tests."""
    monkeypatch.setattr(start, "SCRIPTS", Path(sys.executable).parent)
    packages = tmp_path / "tests" / "lib" / "site-packages"
    for name in ("one/a.py", "one/tests/b.py"):
        (packages / name).parent.mkdir(parents=True, exist_ok=True)
        (packages / name).write_text("x = 1\n")
    start.compile_sources(tmp_path)
    assert {path.name.split(".")[0] for path in tmp_path.rglob("*.pyc")} == {"a"}


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
