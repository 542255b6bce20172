"""The end of a command in lines, for a terminal of any width or as plain text: the result first, files last.

On a terminal texts are folded at spaces, and shortened unless everything is asked for. Elsewhere, where ``width`` is
``None``, every fact is one line, however long.
"""

from __future__ import annotations

import json as json_text
import re
import shlex
import sys
from collections.abc import Iterable, Iterator, Mapping, Sequence
from pathlib import Path, PurePosixPath
from typing import TYPE_CHECKING, Any

import typer
from rich.cells import cell_len

from cmm_uq.app.cli.options import Ending
from cmm_uq.app.cli.terminal import NOT_CONFORMING, Line, columns, folded, on_terminal, put_data, put_json, say, show
from cmm_uq.base.errors import printable
from cmm_uq.base.output import MANIFEST
from cmm_uq.base.values import dataclass

if TYPE_CHECKING:
    from cmm_uq.app.commands.files import Written
    from cmm_uq.certificate.document import Standing
    from cmm_uq.certificate.wording import Summary
    from cmm_uq.jobs.importing.cells.stated import Offer
    from cmm_uq.jobs.importing.format import Recognition
    from cmm_uq.jobs.job import Job

FILES = {
    "certificate.html": "the certificate",
    "certificate.pdf": "the certificate",
    "certificate.xml": "the digital certificate (DCC), for other programs",
    "diagnosis.html": "the diagnosis, with its plots",
    "diagnosis.pdf": "the diagnosis, with its plots",
    "plan.html": "the plan, with a picture of each placing",
    "plan.csv": "the placings, to be filled in as the recording",
    "next_plan.csv": "the set-ups to measure next, to be filled in",
    "empirical.toml": "what no known effect accounts for, as effects of the job's own",
    "validation.html": "the validation of the diagnosis",
    "validation.pdf": "the validation of the diagnosis",
    "truth.json": "what was true of each case, sealed beforehand",
    "cases.jsonl": "what was said of each case",
    "part.html": "the part, with its uncertainty",
    "part.pdf": "the part, with its uncertainty",
    "budget.html": "the budget",
    "budget.pdf": "the budget",
    "results.json": "every figure, for other programs",
    "posterior.npz": "draws of the posterior, for other programs",
    "provenance.json": "from what, by what and on what it was made",
    "correction_table.csv": "correction table, for compensate",
    "job.toml": "the job",
    "truth.toml": "what it was drawn from",
    "compensation.json": "how coordinates or map came about",
    "points-u.csv": "standard uncertainties of the coordinates",
    "error-map.csv": "the error map",
    "error-map-covariance.npy": "the covariance of its figures",
    "error-map.toml": "the key of a job that names both",
    "fleet.html": "what the machines have in common",
    "fleet.json": "every figure, for other programs",
    "fleet.csv": "every machine and value, for a spreadsheet",
    MANIFEST: "name, size and hash of each file",
}
"""What each file is that a command writes."""

COLOURS: dict[Standing, str] = {"good": "bold green", "open": "bold yellow", "bad": "bold red", "unknown": "bold"}
HEADING, FAINT = "bold", "dim"
LINES, WARNING_LINES = 3, 2  # of a text that is shortened, and of a warning
ITEMS = 6  # of a list that is shortened
NARROWEST = 8  # cells of a column that is folded
_GAP, _MORE = "  ", " …"
Row = tuple[str, str]  # names of files, and what they are


@dataclass(frozen=True)
class Layout:
    """How much is shown, and on what: cells of a line (``None``: as long as it is), and whether all, whole."""

    width: int | None = None
    verbose: bool = False

    def screen(
        self, summary: Summary, *, name: str = "", banner: str = "", files: Sequence[Row] = (), folder: str = ""
    ) -> list[Line]:
        """All that is shown at the end of a command on a job; ``banner``: what the reader must not overlook."""
        subject = ": ".join(filter(None, (name, ", ".join(filter(None, (summary.subject, summary.date))))))
        room = max((len(each.word) for each in summary.verdicts), default=0)
        verdicts: list[Line] = []
        for each in summary.verdicts:
            text = ": ".join(filter(None, (each.subject, "; ".join(each.remarks))))
            verdicts += self._hung((each.word.ljust(room), COLOURS[each.standing]), text)
        parts: list[list[Line]] = [
            [((text, COLOURS["open"]),) for text in folded(banner, self.width)] if banner else [],
            [*verdicts, *(((line, ""),) for line in (folded(subject, self.width) if subject else ()))],
            list(self.table(summary.figures)),
            list(self._items(summary.remarks)),
            list(self.table(summary.details)) if self.verbose else [],
            list(self._warnings(summary.warnings)),
            [(("Written to ", HEADING), (printable(folder), "")), *self.table(files)] if files else [],
        ]
        return [line for i, part in enumerate(filter(None, parts)) for line in ([()] if i else []) + part]

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
    return [max(map(cell_len, column)) for column in zip(*cells, strict=True)]


def screen_layout(*, verbose: bool) -> Layout:
    return Layout(columns() if on_terminal(sys.stdout) else None, verbose)


def file_rows(files: Mapping[str, Path], *, whole: bool) -> list[Row]:
    """Rows of what was written and what it is; files that are the same thing on one row, unless each has a row of its own."""
    if whole:
        return [(str(path), _what(name)) for name, path in files.items()]
    rows: dict[str, list[str]] = {}
    for name in (name for name in files if name != MANIFEST):  # which lists the others
        rows.setdefault(_what(name), []).append(name)
    return [(", ".join(names), what) for what, names in rows.items()]


def _what(name: str) -> str:
    from cmm_uq.jobs.tables.identification import COMPENSATED, SIMULATED

    path = PurePosixPath(name)
    plain = path.stem.removesuffix(f"-{SIMULATED}").removesuffix(f"-{COMPENSATED}")
    what = FILES.get(plain + path.suffix, "input of the job")
    return what.replace("certificate", "evaluation, not a certificate") if plain != path.stem else what


def folder_of(files: Mapping[str, Path]) -> str:
    return next((str(path.parent) for name, path in files.items() if "/" not in name), "")


def summary_lines(
    summary: Summary, files: Mapping[str, Path], verbose: bool, name: str = "", banner: str = ""
) -> list[Line]:
    rows, folder = file_rows(files, whole=verbose), folder_of(files)
    return screen_layout(verbose=verbose).screen(summary, name=name, banner=banner, files=rows, folder=folder)


def conclude(result: Written[Any], end: Ending) -> None:
    """How a command ends that wrote an outcome: results.json or a summary; exit code 4 if strict, when not all is well."""
    if end.json:
        put_json(result.results.decode())
    elif not end.quiet:
        from cmm_uq.certificate.origin import BANNERS

        banner = BANNERS.get(result.origin, "")
        show(summary_lines(result.summary, result.files, end.verbose, result.name, banner))
        if result.recorded:
            say(result.recorded)
    if end.strict and not result.conforming:
        raise typer.Exit(NOT_CONFORMING)


def conclude_derived(
    files: Mapping[str, Path], what: str, end: Ending, *, is_job: bool = True, remarks: Sequence[str] = ()
) -> None:
    """How a command ends that wrote a recording made from another one: its manifest, or where it is and what to do next."""
    if end.json:
        put_manifest(files)
    elif not end.quiet:
        from cmm_uq.base.messages import Verbatim, say
        from cmm_uq.certificate.wording import Summary

        further = (say("Next: cmm-uq report {folder}", folder=Verbatim(folder_of(files))),) if is_job else ()
        show(summary_lines(Summary(Verbatim(what), remarks=(*map(Verbatim, remarks), *further)), files, end.verbose))


def put_manifest(files: Mapping[str, Path]) -> None:
    """The manifest of what was written, and the folder, as JSON."""
    put_data({**json_text.loads(files[MANIFEST].read_bytes()), "folder": folder_of(files)})


def show_recognised(recognised: Recognition) -> None:
    show([(("Recognised", "bold"),), *screen_layout(verbose=True).table(recognised.rows), ()])


def show_offered(offers: Sequence[Offer]) -> None:
    """What the file says of its measurement, and the options of ``cmm-uq new`` that take it over."""
    if offers:
        table = screen_layout(verbose=True).table([one.row for one in offers])
        show([(("Said of the measurement", "bold"),), *table, ()])
    taken = " ".join(f"--set {shlex.quote(one.setting)}" for one in offers if one.taken)
    if taken:
        say(f"To take it over, where it is right, with cmm-uq new --from: {taken}")


def show_proposed(recognised: Recognition | None, example: str, places: Mapping[str, tuple[str, str, str]]) -> None:
    """How lengths were read, and the question where their lines lie, as options of the command."""
    if recognised is not None:
        show_recognised(recognised)
    asked = {name: own for name, own in places.items() if not own[0] or "?" in own[0]}
    say(f"Read as: {example}")
    planned = ", or --plan plan.csv where they were planned" if recognised is not None else ""
    say(f"Where they lie, with figures in mm for each ?{planned}:")
    for name, (place, like, words) in asked.items():
        beside = f"   # the file says: {words}" if words else ""
        say(f'  --line "{name}={place or re.sub("[0-9]+", "?", like)}"{beside}')


def show_imported(job: Job, *, silent: bool) -> None:
    """What was recognised of the files of a job that were imported, before anything is computed of them."""
    for recognised in () if silent else job.imported:
        show_recognised(recognised)
