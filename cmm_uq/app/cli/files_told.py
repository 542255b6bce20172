"""What each file is that a command has written, in a few words."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path, PurePosixPath

from cmm_uq.base.output import MANIFEST
from cmm_uq.jobs.origin import COMPENSATED, SIMULATED

_WHAT = {
    "certificate.html": "the certificate",
    "certificate.pdf": "the certificate",
    "certificate.xml": "the digital certificate (DCC), for other programs",
    "diagnosis.html": "the diagnosis, with its plots",
    "diagnosis.pdf": "the diagnosis, with its plots",
    "plan.html": "the plan, with a picture of each placing",
    "plan.csv": "the placings, to be filled in as the recording",
    "next_plan.csv": "the set-ups to measure next, to be filled in",
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
    "compensation.json": "how the coordinates came about",
    "fleet.html": "what the machines have in common",
    "fleet.json": "every figure, for other programs",
    "fleet.csv": "every machine and value, for a spreadsheet",
    MANIFEST: "name, size and hash of each file",
}


def told(files: Mapping[str, Path], *, whole: bool) -> list[tuple[str, str]]:
    """Rows of what was written and what it is; files that are the same thing on one row.

    Parameters
    ----------
    files : by name.
    whole : whether each file has a row of its own, with its path.
    """
    if whole:
        return [(str(path), _what(name)) for name, path in files.items()]
    by_what: dict[str, list[str]] = {}
    for name in files:
        if name == MANIFEST:
            continue  # a list of the others
        by_what.setdefault(_what(name), []).append(name)
    return [(", ".join(names), what) for what, names in by_what.items()]


def _what(name: str) -> str:
    path = PurePosixPath(name)
    plain = path.stem
    for origin in (SIMULATED, COMPENSATED):
        plain = plain.removesuffix(f"-{origin}")
    what = _WHAT.get(plain + path.suffix, "input of the job")
    return what.replace("certificate", "evaluation, not a certificate") if plain != path.stem else what


def folder_of(files: Mapping[str, Path]) -> str:
    """Folder that they were written to."""
    return next((str(path.parent) for name, path in files.items() if "/" not in name), "")
