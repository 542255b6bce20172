"""A summary laid out in lines, for a terminal of any width or as plain text: the result first, files last.

On a terminal texts are folded at spaces, and shortened unless everything is asked for. Elsewhere, where ``width`` is
``None``, every fact is one line, however long.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

from rich.cells import cell_len

from cmm_uq.app.cli.folding import folded
from cmm_uq.base.errors import printable

if TYPE_CHECKING:
    from cmm_uq.certificate.document import Standing
    from cmm_uq.certificate.in_short import Summary, Verdict

Line = tuple[tuple[str, str], ...]
"""Parts of a line, each with its style in the words of rich; none for the usual one."""

COLOURS: dict[Standing, str] = {"good": "bold green", "open": "bold yellow", "bad": "bold red", "unknown": "bold"}
HEADING, FAINT = "bold", "dim"

LINES, WARNING_LINES = 3, 2
"""Of a text that is shortened, and of a warning."""

ITEMS = 6
"""Of a list that is shortened."""

NARROWEST = 8
"""Cells of a column that is folded."""

_GAP, _MORE = "  ", " …"


@dataclass(frozen=True)
class Layout:
    """How much is shown, and on what.

    Parameters
    ----------
    width : cells of a line; ``None`` where lines are as long as they are.
    verbose : whether everything is shown, whole.
    """

    width: int | None = None
    verbose: bool = False

    def screen(
        self,
        summary: Summary,
        *,
        name: str = "",
        banner: str = "",
        files: Sequence[tuple[str, str]] = (),
        folder: str = "",
    ) -> list[Line]:
        """All that is shown at the end of a command.

        Parameters
        ----------
        summary : what was found.
        name : of the job.
        banner : what the reader must not overlook.
        files : that were written to ``folder``, each with what it is.
        """
        parts: list[list[Line]] = [
            [((text, COLOURS["open"]),) for text in self._folded(banner)] if banner else [],
            [*self._verdicts(summary.verdicts), *self._subject(name, summary)],
            list(self.table(summary.figures)),
            list(self._items(summary.remarks)),
            list(self.table(summary.details)) if self.verbose else [],
            list(self._warnings(summary.warnings)),
            list(self._files(files, folder)),
        ]
        return [line for i, part in enumerate(filter(None, parts)) for line in ([()] if i else []) + part]

    def _subject(self, name: str, summary: Summary) -> Iterator[Line]:
        told = ", ".join(filter(None, (summary.subject, summary.date)))
        told = ": ".join(filter(None, (name, told)))
        return (((line, ""),) for line in self._folded(told)) if told else iter(())

    def _verdicts(self, verdicts: Sequence[Verdict]) -> Iterator[Line]:
        room = max((len(each.word) for each in verdicts), default=0)
        for each in verdicts:
            told = ": ".join(filter(None, (each.subject, "; ".join(each.remarks))))
            yield from self._hung((each.word.ljust(room), COLOURS[each.standing]), told)

    def table(self, rows: Iterable[Sequence[str]]) -> Iterator[Line]:
        """Columns, of which the widest are folded until all fit."""
        cells = [[printable(cell) for cell in row] for row in rows]
        if not cells:
            return
        widths, room = _widths(cells), None
        if self.width is not None:
            room = self.width - len(_GAP) * len(widths)
            if sum(widths) > room and not self.verbose:
                # what a name means, in brackets behind it, stands in the document
                cells = [[row[0].partition(" (")[0], *row[1:]] for row in cells]
                widths = _widths(cells)
        while room is not None and sum(widths) > room and max(widths) > NARROWEST:
            widths[widths.index(max(widths))] -= 1
        for row in cells:
            parts = [folded(cell, None if room is None else width) for cell, width in zip(row, widths, strict=True)]
            for i in range(max(map(len, parts))):
                line = [part[i] if i < len(part) else "" for part in parts]
                padded = (cell + " " * (width - cell_len(cell)) for cell, width in zip(line, widths, strict=True))
                yield ((_GAP + _GAP.join(padded).rstrip(" "), ""),)

    def _warnings(self, warnings: Sequence[str]) -> Iterator[Line]:
        if warnings:
            items = list(self._items(warnings, COLOURS["open"], WARNING_LINES))
            whole = all(_MORE not in text for line in items for text, _ in line)
            count = "1 warning" if len(warnings) == 1 else f"{len(warnings)} warnings"
            yield ((count, COLOURS["open"]), ("" if whole else ", shortened: --verbose shows all", FAINT))
            yield from items

    def _items(self, texts: Sequence[str], style: str = "", most: int = LINES) -> Iterator[Line]:
        """Numbered, or behind a dash where there is only one."""
        short = self.width is not None and not self.verbose
        shown = texts[:ITEMS] if short else texts
        heads = ["-"] if len(texts) == 1 else [f"{i + 1}." for i in range(len(shown))]
        room = max(map(len, heads), default=0)
        for head, text in zip(heads, shown, strict=True):
            yield from self._hung((_GAP + head.rjust(room), style), text, gap=1, most=most)
        if len(shown) < len(texts):
            yield ((f"{_GAP}{_MORE.strip()} and {len(texts) - len(shown)} more: --verbose, or the document", FAINT),)

    def _files(self, files: Sequence[tuple[str, str]], folder: str) -> Iterator[Line]:
        if files:
            yield (("Written to ", HEADING), (printable(folder), ""))
            yield from self.table(files)

    def _folded(self, text: str) -> list[str]:
        return folded(text, self.width)

    def _hung(self, head: tuple[str, str], text: str, gap: int = 2, most: int = LINES) -> Iterator[Line]:
        """A text behind its head, all its lines under each other; shortened unless all is to be shown."""
        indent = cell_len(head[0]) + gap
        lines = folded(text, None if self.width is None else max(NARROWEST, self.width - indent))
        if self.width is not None and not self.verbose and len(lines) > most:
            room = max(NARROWEST, self.width - indent) - len(_MORE)
            lines = [*lines[: most - 1], folded(" ".join(lines[most - 1 :]), room)[0] + _MORE]
        for i, line in enumerate(lines):
            yield (head, (" " * gap + line, "")) if i == 0 else ((" " * indent + line, ""),)


def _widths(cells: Sequence[Sequence[str]]) -> list[int]:
    """Of the columns."""
    return [max(map(cell_len, column)) for column in zip(*cells, strict=True)]
