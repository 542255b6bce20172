"""The standards that are decided here, clause by clause, and the form that a laboratory fills in beside its own copy."""

from __future__ import annotations

import json
from collections.abc import Sequence
from pathlib import Path

from cmm_uq import __version__
from cmm_uq.analysis.conformity.standards import CLAUSES, names, standard_named
from cmm_uq.analysis.conformity.statement import Clause
from cmm_uq.base.errors import CmmUqError, suggestion
from cmm_uq.base.output.new_file import refuse_taken, write_new
from cmm_uq.base.plugins import naming_package


@naming_package()
def listed_standards() -> list[tuple[str, tuple[str, ...]]]:
    """Every standard with its characteristics, then the documents that decisions and budgets go by, which have none."""
    found: list[tuple[str, tuple[str, ...]]] = []
    for name in (*names(), *(name for name in CLAUSES if name not in names())):
        standard = standard_named(name)
        found.append((name, () if standard is None else tuple(one.name for one in standard.characteristics)))
    return found


@naming_package()
def clauses_of(name: str) -> Sequence[Clause]:
    """Clauses of a standard, or of a document that decisions go by."""
    standard = standard_named(name)
    found = CLAUSES.get(name, ()) if standard is None else standard.clauses
    if not found:
        known = [other for other, _ in listed_standards()]
        problem = "has no clauses here" if name in known else f"no standard {name!r} is decided"
        raise CmmUqError(problem, where=name, fix=suggestion(name, [other for other in known if other != name]))
    return found


def form(name: str) -> str:
    """The form of a standard, to be filled in."""
    clauses = clauses_of(name)
    parts = [
        f"# Clauses of {name} as cmm-uq {__version__} takes them. Hold each against your own copy and answer it; then\n"
        '# name this file in job.toml: [[conformity]] clauses = "FILE". What stays unanswered counts as unread.\n\n'
        f"standard = {_quoted(name)}\n"
        'checked_by = ""     # who held the clauses against the copy\n'
        "# on = 2026-01-31    # when\n"
        'edition = ""        # of the copy, as on its title page\n'
    ]
    parts += [
        f"\n[clauses.{one.name}]    # {one.title}; words of the standard {'' if one.read else 'not '}read by who wrote this\n"
        f"does = {_quoted(one.does)}\n"
        f"source = {_quoted(one.source)}\n"
        '# agrees = true      # or: agrees = false with differs = "how"; stricter = true where this program asks for more\n'
        '# clause = ""        # its number in the copy\n'
        for one in clauses
    ]
    return "".join(parts)


def write_form(name: str, file: Path) -> Path:
    """Write the form of a standard; nothing is overwritten."""
    content = form(name)
    refuse_taken(file)
    write_new(file, content.encode())
    return file


def _quoted(text: str) -> str:
    return json.dumps(text, ensure_ascii=False)
