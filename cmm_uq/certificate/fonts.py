"""The fonts that a document's language needs beside those of the typst wheel: Japanese has none there."""

from __future__ import annotations

from importlib.util import find_spec
from pathlib import Path

from cmm_uq.base.errors import CmmUqError
from cmm_uq.base.languages.language import Code

JAPANESE = "IPAexGothic"
"""Family that sets Japanese, under the IPA Font License 1.0, which allows it in documents."""
_PACKAGE = "matplotlib_fontja"
"""What it comes in; the package is not imported, since that would change matplotlib's settings."""


def japanese_font() -> Path:
    """File of the Japanese font.

    Raises
    ------
    CmmUqError : it is not installed.
    """
    spec = find_spec(_PACKAGE)
    for folder in (spec.submodule_search_locations or ()) if spec else ():
        file = Path(folder) / "fonts" / "ipaexg.ttf"
        if file.is_file():
            return file
    raise CmmUqError(
        f"a document in Japanese needs the font {JAPANESE}, which is not installed",
        fix="pip install 'cmm-uq[ja]', or ask for another language",
    )


def fonts_of(language: Code) -> list[Path]:
    """Files of the fonts that a language needs.

    Raises
    ------
    CmmUqError : one is not installed.
    """
    return [japanese_font()] if language == "ja" else []
