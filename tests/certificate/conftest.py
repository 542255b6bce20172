"""The sample certificate."""

from __future__ import annotations

import pytest

from cmm_uq.certificate.document import Document
from tests.certificate.samples import ballbar_certificate


@pytest.fixture(scope="session")
def certificate() -> Document:
    return ballbar_certificate()
