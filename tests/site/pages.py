"""The pages of the documentation, and what they show as code."""

from __future__ import annotations

import re
from dataclasses import dataclass
from pathlib import Path

from tests.conftest import ROOT

PAGES = sorted([ROOT / "README.md", ROOT / "CONTRIBUTING.md", *(ROOT / "docs").rglob("*.md")])


@dataclass(frozen=True)
class Snippet:
    """A fenced block: its language, whether it is marked as an excerpt, and its text."""

    page: Path
    line: int
    language: str
    excerpt: bool
    text: str

    def __str__(self) -> str:
        return f"{self.page.relative_to(ROOT)}:{self.line}"


def snippets(page: Path, *languages: str, excerpt: bool = False) -> list[Snippet]:
    """Those of one page in these languages, as they follow each other."""
    found = []
    text = page.read_text(encoding="utf-8")
    for match in re.finditer(r"^( *)```(\w+)( excerpt)?\n(.*?)^\1```$", text, re.DOTALL | re.MULTILINE):
        indent, language, marked, block = match.groups()
        if language in languages and bool(marked) == excerpt:
            line = text.count("\n", 0, match.start()) + 1
            found.append(Snippet(page, line, language, excerpt, re.sub(f"^{indent}", "", block, flags=re.MULTILINE)))
    return found
