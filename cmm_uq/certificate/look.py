"""How all that is shown looks: its colours, and where the templates lie. It loads nothing more: a first page is quick."""

from __future__ import annotations

from pathlib import Path

from cmm_uq.base.errors import NotInstalledError

INK = "#1b2328"  # text and outlines; 15.9 : 1 on white.
MUTED = "#5a666e"  # secondary text, and what was before; 5.9 : 1 on white.
RULE = "#d3dade"  # hairlines
TINT = "#eef4f6"  # A wash of the accent behind text
ACCENT = "#0b5c7a"  # the one accent colour; 7.4 : 1 on white.
BAND = "#d5e4ea"  # A stronger wash, for bands behind data
GOOD, OPEN, BAD = "#1f6b3a", "#8a5300", "#9c2420"
"""A verdict: nothing to do, something to do, something wrong; white on them at least 6 : 1. A sign and words go with them."""
COLOURS = {
    "ink": INK, "muted": MUTED, "rule": RULE, "tint": TINT, "accent": ACCENT, "good": GOOD, "open": OPEN, "bad": BAD,
    "unknown": MUTED,
}  # fmt: skip
"""The same, for the templates."""


def template_folder() -> Path:
    package = Path(__file__).resolve().parents[1]
    for folder in (package / "templates", package.parent / "templates"):
        if (folder / "document.html").is_file():
            return folder
    raise NotInstalledError("the templates of the certificate are missing", where=str(package),
                            fix="Install cmm-uq again, from a whole wheel")  # fmt: skip
