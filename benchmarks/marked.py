"""What studies write into pages of the documentation: each its part, between two marks."""

from __future__ import annotations

from pathlib import Path


def put(page: Path, begin: str, end: str, text: str) -> None:
    """Write one part anew, and leave the rest of the page as it is."""
    whole = page.read_text(encoding="utf-8") if page.exists() else begin + end
    before, _, rest = whole.partition(begin)
    page.write_text(f"{before}{begin}\n\n{text}\n\n{end}{rest.partition(end)[2]}", encoding="utf-8")
