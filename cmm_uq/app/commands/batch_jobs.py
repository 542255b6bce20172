"""Which jobs a batch has, which of them are done already, and what stands in the way of the others, before any is computed."""

from __future__ import annotations

import json
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from cmm_uq import __version__
from cmm_uq.app.commands.files import RESULTS
from cmm_uq.app.commands.report import REPORT
from cmm_uq.base.errors import CmmUqError
from cmm_uq.base.languages.language import ENGLISH
from cmm_uq.base.output import Manifest, read_manifest, sha256_of
from cmm_uq.base.output.replacing import journal_for
from cmm_uq.jobs.job import Job
from cmm_uq.jobs.reading import sha256
from cmm_uq.jobs.verdicts import Verdicts
from cmm_uq.laboratory.schedule.found import job_folders


@dataclass(frozen=True, slots=True)
class Listed:
    """A job of a batch.

    Parameters
    ----------
    folder : with its job.toml.
    id : of the job; empty where job.toml cannot be read, which its report will say.
    """

    folder: str
    id: str


def jobs_in(folders: Iterable[Path], out: Path) -> tuple[list[Listed], int]:
    """Every job in folders and below them, and how many more are still to be measured.

    Parameters
    ----------
    folders : job folders, or such as hold them.
    out : folder of the reports, which is not looked into.

    Raises
    ------
    CmmUqError : there is none, a folder cannot be read, or two jobs would write to one folder.
    """
    given = list(folders)
    found: dict[str, Listed] = {}
    planned: set[str] = set()
    for root in given:
        for one in job_folders(root.parent if root.name == "job.toml" else root, leave_out=out):
            key = str(one.folder.resolve())
            if one.planned:
                planned.add(key)
            else:
                found.setdefault(key, Listed(str(one.folder), one.id))
    if not found:
        more = f"; {len(planned)} still to be measured" if planned else ""
        raise CmmUqError(f"no job was found{more}", where=", ".join(map(str, given)),
                         fix="A job is a folder with a job.toml and the recording that it names")  # fmt: skip
    listed = list(found.values())
    _refuse_two_alike(listed)
    return listed, len(planned)


def _refuse_two_alike(listed: Iterable[Listed]) -> None:
    """Also such as differ in case alone: for some systems these are one folder."""
    first: dict[str, Listed] = {}
    for one in listed:
        if one.id and (other := first.setdefault(one.id.casefold(), one)) is not one:
            raise CmmUqError(f"has the id {one.id!r}, as {other.folder} has {other.id!r}", where=one.folder,
                             fix="Give each job an id of its own: its report goes to a folder of that name")  # fmt: skip


@dataclass(frozen=True)
class Wanted:
    """What is to be written of each job.

    Parameters
    ----------
    out : a folder a job is made in it.
    seed : of everything random.
    results_only : whether figures alone are wanted.
    force : keep what stands in the way as ``NAME.previous`` instead of refusing.
    """

    out: Path
    seed: int = 0
    results_only: bool = False
    force: bool = False

    def folder(self, job: Job) -> Path:
        """That is written to."""
        return self.out / job.facts.job.id

    def names(self, job: Job) -> list[str]:
        """Of the files that are certain to be written."""
        return [RESULTS] if self.results_only else [*REPORT.names(job), RESULTS]

    def check(self, job: Job) -> None:
        """Make sure, before a job is computed, that it can be written.

        Raises
        ------
        CmmUqError : something that is not of this job stands in the way, or a certificate that would be lost.
        """
        folder = self.folder(job)
        there = read_manifest(folder)
        if self.results_only and there is not None and there.owner == REPORT.owner(job):
            documents = [name for name in REPORT.names(job) if name in there.files]
            if documents:
                raise CmmUqError("would be lost where figures alone are written again", where=str(folder / documents[0]),
                                 fix="Leave --results-only out, or choose another --out")  # fmt: skip
        names = dict.fromkeys(self.names(job), "")
        journal_for(folder, REPORT.owner(job), names, inputs=job.paths, force=self.force)

    def done(self, job: Job) -> dict[str, Any] | None:
        """Contents of results.json where the job's report is there, whole, from the same inputs by the same version."""
        folder = self.folder(job)
        there = read_manifest(folder)
        if there is None or there.owner != REPORT.owner(job) or not there.files.keys() >= set(self.names(job)):
            return None
        if not _whole(folder, there):
            return None
        data = results_of(folder)
        same = (
            data is not None
            and data.get("software", {}).get("version") == __version__
            and data.get("job", {}).get("inputs_sha256") == sha256(job.inputs)
            and data.get("job", {}).get("language", ENGLISH) == job.facts.job.language
            and data.get("sampling", {}).get("seed", self.seed) == self.seed
        )
        return data if same else None


def _whole(folder: Path, manifest: Manifest) -> bool:
    return all(sha256_of(folder / name) == digest for name, digest in manifest.files.items())


def results_of(folder: Path) -> dict[str, Any] | None:
    """Contents of a report's results.json; ``None`` where there is none that can be read."""
    try:
        data = json.loads((folder / RESULTS).read_bytes())
    except (OSError, ValueError):
        return None
    return data if isinstance(data, dict) else None


def conforming(results: Mapping[str, Any]) -> bool:
    """Whether every statement of conformity is a pass, and the recording agrees with the model that the job names."""
    return Verdicts.of_results(results).conforming and verdict(results) in ("consistent", "")


def verdict(results: Mapping[str, Any]) -> str:
    """Of the diagnosis; empty where there is none."""
    return str((results.get("diagnosis") or {}).get("verdict") or "")
