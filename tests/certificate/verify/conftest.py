"""A certificate of a real recording with all its forms."""

from __future__ import annotations

import shutil
from pathlib import Path

import pytest

from cmm_uq.certificate.verify.again import Again
from tests.certificate.iota import iota_report
from tests.shared import put

DOCUMENTS = ("certificate.pdf", "certificate.html", "results.json")


@pytest.fixture(scope="session")
def made(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The folder of the report; not to be changed."""
    return put(tmp_path_factory.mktemp("verified") / "certificate", iota_report())


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
