"""What commands write, recorded as it is written: which records, and what is recorded of an outcome."""

from __future__ import annotations

import contextlib
import json
from collections.abc import Iterator, Mapping
from functools import cache
from hashlib import sha256
from pathlib import Path
from typing import TYPE_CHECKING, Any

from cmm_uq.base.output import Ledger
from cmm_uq.jobs.job import Job
from cmm_uq.laboratory.records.content import certificate_content, folder_from, kind_of_entry
from cmm_uq.laboratory.records.place import DEFAULT, beside, place_of

if TYPE_CHECKING:
    from cmm_uq.laboratory.records.store import Records

_UNITS_AT_THE_END = ("mm", "um", "arcsec", "ppm", "rad", "deg", "m", "k", "per")


@contextlib.contextmanager
def opened(where: str | Path | None, out: Path | None) -> Iterator[Records | None]:
    """The records that a command writes to, made where there are none; ``None`` where there are to be none.

    Parameters
    ----------
    where : option of the command.
    out : folder that it writes to, where that is not the default.

    Raises
    ------
    CmmUqError : they cannot be opened.
    OutputError : they cannot be written to.
    """
    place = place_of(where, DEFAULT if out is None else beside(out.absolute()))
    if place is None:
        yield None
        return
    from cmm_uq.laboratory.records.opening import open_records

    with open_records(place, create=True) as records:
        yield records


def ledger_of(
    records: Records, job: Job, command: str, folder: Path, files: Mapping[str, bytes], results: str
) -> Ledger:
    """For the files of an outcome, that are recorded as they are put in place.

    Parameters
    ----------
    records : to be added to.
    job : that the outcome is of.
    command : report or diagnose.
    folder : of the files.
    files : contents by name.
    results : name of results.json.
    """
    content = content_of(
        records, files[results], job, command, folder, {name: sha256(data).hexdigest() for name, data in files.items()}
    )
    return records.ledger(kind_of_entry(content), content)


def content_of(
    records: Records, results: bytes, job: Job | None, command: str, folder: Path, files: Mapping[str, str]
) -> dict[str, Any]:  # fmt: skip
    """Content of the entry of a results.json; see :func:`cmm_uq.laboratory.records.content.certificate_content`."""
    return certificate_content(
        json.loads(results), None if job is None else job.facts, command=command, folder=folder_from(records.home, folder),
        results_sha256=sha256(results).hexdigest(), files=files, named=called,
    )  # fmt: skip


@cache
def called(name: str) -> str:
    """How a value of results.json is called in the field: by its effect's title, else by its own name in words."""
    from cmm_uq.machine.physics.catalogue import every

    owner, _, own = name.partition(".")
    effect = every().get(owner)
    if effect is None:
        words = own.split("_")
        while len(words) > 1 and words[-1] in _UNITS_AT_THE_END:
            words.pop()
        said = " ".join(words)
        return said[:1].upper() + said[1:]
    title = str(effect.title)
    what = next((str(one.what) for one in effect.reported if one.name == own and one.what), "")
    return f"{title}, {what}" if what else title
