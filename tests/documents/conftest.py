"""The sample certificate."""

from __future__ import annotations

import pytest

from cmm_uq.documents.document import Document
from tests.documents.samples import ballbar_certificate


@pytest.fixture(scope="session")
def certificate() -> Document:
    return ballbar_certificate()
