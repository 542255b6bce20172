"""Where the templates are: inside an installed package, or at the top of a checkout."""

from __future__ import annotations

from pathlib import Path

from cmm_uq.base.errors import CmmUqError


def template_folder() -> Path:
    """The folder of the templates.

    Raises
    ------
    CmmUqError : neither an installed package nor a checkout has it.
    """
    package = Path(__file__).resolve().parents[1]
    for folder in (package / "templates", package.parent / "templates"):
        if (folder / "document.html").is_file():
            return folder
    raise CmmUqError(
        "the templates of the certificate are missing",
        where=str(package),
        fix="Install cmm-uq again, from a whole wheel",
    )
