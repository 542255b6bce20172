"""A text in lines that fit a terminal; it imports next to nothing, for an error must be told at once."""

from __future__ import annotations

from rich.cells import cell_len

from cmm_uq.base.errors import printable


def folded(text: str, width: int | None) -> list[str]:
    """Lines of at most ``width`` cells, broken at spaces; a no-break space holds, and a longer word stays whole."""
    words = printable(text.replace("\n", " ")).split(" ")
    if width is None:
        return [" ".join(words)]
    lines, line = [], words[0]
    for word in words[1:]:
        if cell_len(line) + 1 + cell_len(word) <= width:
            line += f" {word}"
        else:
            lines.append(line)
            line = word
    return [*lines, line]
