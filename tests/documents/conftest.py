"""The sample certificate, and a real browser to open it in."""

from __future__ import annotations

import os
import shutil
from collections.abc import Iterator
from typing import TYPE_CHECKING

import pytest

from cmm_uq.documents.document import Document
from tests.documents.samples import ballbar_certificate

if TYPE_CHECKING:
    from playwright.sync_api import Browser


@pytest.fixture(scope="session")
def certificate() -> Document:
    return ballbar_certificate()


@pytest.fixture(scope="session")
def browser() -> Iterator[Browser]:
    """The installed Chromium; tests that need it are skipped without one, unless CMM_UQ_REQUIRE_BROWSER=1 asks for it."""
    names = ("chromium", "chromium-browser", "google-chrome")
    path = next((found for name in names if (found := shutil.which(name))), None)
    if path is None:
        if os.environ.get("CMM_UQ_REQUIRE_BROWSER") == "1":
            pytest.fail("CMM_UQ_REQUIRE_BROWSER=1, but no Chromium is installed")
        pytest.skip("no Chromium is installed")
    from playwright.sync_api import sync_playwright

    quiet = ["--no-sandbox", "--disable-gpu", "--disable-background-networking", "--disable-component-update",
             "--disable-sync", "--no-first-run"]  # fmt: skip
    with sync_playwright() as playwright:
        chromium = playwright.chromium.launch(executable_path=path, args=quiet)
        yield chromium
        chromium.close()
