"""Job folders found below the folders of a schedule, whether they changed, and whether they are still being copied.

Whether a job changed is decided by the content of job.toml and of every file that it names. Times of files say only whether
somebody is at them: they may lie, and where they cannot be right two looks at the folder decide.
"""

from __future__ import annotations

import os
import re
import tomllib
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path

from cmm_uq.base.errors import CmmUqError
from cmm_uq.base.files.content import content_of, text_of
from cmm_uq.base.files.limits import JOB_BYTES
from cmm_uq.base.files.toml import toml_of
from cmm_uq.base.output import sha256_of
from cmm_uq.jobs.acquired import provenance_name
from cmm_uq.jobs.file_names import device_name
from cmm_uq.jobs.origin import is_planned

JOB_FILE = "job.toml"

Snapshot = frozenset[tuple[str, int, int, int]]
"""Name, size, and times of change in nanoseconds of every file in a folder."""

_ID = re.compile(r"[A-Za-z0-9._-]{1,100}")
_HEAD = 200
"""Bytes of a recording that say whether it is a plan still to be measured."""


@dataclass(frozen=True)
class Found:
    """A job folder.

    Parameters
    ----------
    folder : with its job.toml.
    root : folder of the schedule that it lies in.
    id : of the job; empty where job.toml cannot be read, which its report will say.
    recording : name of the file that is recorded; empty where none is named.
    planned : whether the recording is still to be made.
    """

    folder: Path
    root: Path
    id: str = ""
    recording: str = ""
    planned: bool = False


def job_folders(root: Path, leave_out: Path | None = None) -> Iterator[Found]:
    """Job folders in a folder and below it, in the order of their names; none inside another job, none that is hidden.

    Parameters
    ----------
    root : a job folder itself, or one that holds them.
    leave_out : folder that is not looked into: that of the reports.

    Raises
    ------
    CmmUqError : a folder is not there, or cannot be read.
    """
    if not root.is_dir():
        what = "is a file, not a folder" if root.exists() else "no such folder"
        raise CmmUqError(what, where=str(root), fix="Mend its name; if it is on another machine, is it mounted?")
    without = None if leave_out is None else leave_out.resolve()
    for folder, below, files in os.walk(root, onerror=_refuse):
        here = Path(folder)
        if JOB_FILE in files:
            below.clear()
            yield _read(here, root)
        below[:] = sorted(name for name in below if not name.startswith(".") and (here / name).resolve() != without)


def differing(job: Found, inputs: Mapping[str, str]) -> list[str]:
    """Names of the files that are not what they were.

    Parameters
    ----------
    job : as it is now.
    inputs : SHA-256 of every file that was read, by name.
    """
    changed = [name for name, digest in inputs.items() if sha256_of(job.folder / name) != digest]
    if job.recording:
        beside = provenance_name(job.recording)
        if beside not in inputs and os.path.lexists(job.folder / beside):
            changed.append(beside)  # of a recording taken live: read where it is there
    return changed


def snapshot(folder: Path) -> Snapshot:
    """What lies in a folder now; empty where it is gone."""
    found = []
    for here, below, files in os.walk(folder):
        below[:] = [name for name in below if not name.startswith(".")]
        for name in files:
            path = os.path.join(here, name)  # noqa: PTH118 - of many files
            try:
                status = os.stat(path)  # noqa: PTH116
            except OSError:
                continue
            found.append((path, status.st_size, status.st_mtime_ns, status.st_ctime_ns))
    return frozenset(found)


def quiet_since(seen: Snapshot, now_s: float) -> float:
    """Seconds for which no file of a folder was changed, by their own times; negative where one lies in the future.

    Parameters
    ----------
    seen : what lies in the folder.
    now_s : seconds since 1970.
    """
    newest = max((max(changed, moved) for _, _, changed, moved in seen), default=0)
    return now_s - newest / 1e9


def _refuse(error: OSError) -> None:
    raise CmmUqError(f"cannot be read: {error.strerror}", where=str(error.filename), fix="Mend its permissions")


def _read(folder: Path, root: Path) -> Found:
    path = folder / JOB_FILE
    try:
        data = toml_of(text_of(content_of(path, JOB_BYTES, ""), str(path)), str(path))
        identity, recording = data["job"]["id"], data.get("recording", {}).get("file", "")
    except (CmmUqError, tomllib.TOMLDecodeError, KeyError, TypeError, AttributeError):
        return Found(folder, root)
    if not (isinstance(identity, str) and isinstance(recording, str) and _names_a_folder(identity)):
        return Found(folder, root)
    return Found(folder, root, identity, recording, _is_to_be_measured(folder / recording, with_plan="plan" in data))


def _names_a_folder(identity: str) -> bool:
    """Whether an id is one that a job may have; what is wrong with another, reading the job says."""
    return bool(_ID.fullmatch(identity)) and set(identity) != {"."} and not device_name(identity)


def _is_to_be_measured(recording: Path, *, with_plan: bool) -> bool:
    try:
        with recording.open("rb") as file:
            return is_planned(file.read(_HEAD))
    except FileNotFoundError:
        return with_plan
    except (OSError, ValueError):
        return False
