"""The templates are found in a checkout and in an installed package."""

from __future__ import annotations

from pathlib import Path

import pytest

from cmm_uq.base.errors import CmmUqError
from cmm_uq.certificate.render import html as templates


def test_the_folder_holds_both_views() -> None:
    names = {path.name for path in templates.template_folder().iterdir()}
    assert {"document.html", "document.css", "document.typ"} <= names


def test_an_installed_package_has_its_own(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "cmm_uq" / "templates").mkdir(parents=True)
    (tmp_path / "cmm_uq" / "templates" / "document.html").touch()
    monkeypatch.setattr(templates, "__file__", str(tmp_path / "cmm_uq" / "certificate" / "render" / "html.py"))
    assert templates.template_folder() == tmp_path / "cmm_uq" / "templates"


def test_a_package_without_them_says_what_to_do(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(templates, "__file__", str(tmp_path / "cmm_uq" / "certificate" / "render" / "html.py"))
    with pytest.raises(CmmUqError, match="Install cmm-uq again"):
        templates.template_folder()
