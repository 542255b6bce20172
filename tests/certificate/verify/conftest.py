"""A certificate of a real recording with all its forms, made once for all processes of a run of the tests."""

from __future__ import annotations

import os
import shutil
from pathlib import Path

import pytest

from cmm_uq.app.commands.report import write_report
from cmm_uq.certificate.verify.again import Again
from tests.conftest import ROOT

JOB = ROOT / "examples" / "iota-1102-20C"
DOCUMENTS = ("certificate.pdf", "certificate.html", "results.json")


@pytest.fixture(scope="session")
def made(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The folder of the report; not to be changed."""
    share = os.environ.get("CMM_UQ_TESTS_SHARE")
    folder = (Path(share) if share else tmp_path_factory.getbasetemp()) / "verified-certificate"
    if not folder.exists():
        own = folder.with_name(f"{folder.name}-{os.getpid()}")
        write_report(JOB, own)
        try:
            own.rename(folder)
        except OSError:  # another process was first
            shutil.rmtree(own)
    return folder


@pytest.fixture
def certificate(made: Path, tmp_path: Path) -> Path:
    """A copy of its documents to spoil, without the manifest that would tell at once."""
    folder = tmp_path / "certificate"
    folder.mkdir()
    for name in DOCUMENTS:
        shutil.copy(made / name, folder)
    return folder


@pytest.fixture
def again(made: Path) -> Again:
    """What the second computation would give: the certificate as it was made."""
    files = {path.name: path.read_bytes() for path in made.iterdir() if path.name != "manifest.json"}
    pdf = files.pop("certificate.pdf")
    return Again(files, pdf)
