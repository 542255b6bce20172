"""Files of a job: their names, the same on every system and never one that a command writes, and where they are read from."""

from __future__ import annotations

import hashlib
import os
import re
import unicodedata
from collections.abc import Iterable, Mapping
from pathlib import Path, PurePosixPath, PureWindowsPath

from cmm_uq.base.errors import CmmUqError
from cmm_uq.base.files.limits import FILE_NAME, Limit, content_of
from cmm_uq.base.values import dataclass

# names that commands write, or attach to a certificate, beside the recording of a job
_WRITTEN = re.compile(
    r"job\.toml|results\.json|manifest\.json|truth\.toml|compensation\.json|(certificate|diagnosis|plan).*\.(html|pdf)"
    r"|posterior.*\.npz|budget\..*|\.unfinished-.*",
    re.IGNORECASE,
)
DERIVED = ("truth.toml", "compensation.json")  # names that belong beside a derived recording
RESULTS = "results.json"  # name of what another job's report wrote; a job may keep it in a folder of its own

# names of what another job's report wrote and this one may go by
_REPORTED = re.compile(r"results\.json|posterior.*\.npz|certificate.*\.pdf", re.IGNORECASE)
# windows takes these for devices, with any ending
_DEVICE = re.compile(r"(con|prn|aux|nul|conin\$|conout\$|(com|lpt)[0-9¹²³])(\..*)?", re.IGNORECASE)
_COPY = "Copy the file into the folder and name it there: a job must be complete by itself"
_FORBIDDEN = frozenset('<>:"|?*')  # on Windows


def inside(folder: Path, name: str, where: str, *, written: bool = False) -> Path:
    """Path of a file that a job names; ``written`` by a command, it lies beside the recording that it derived."""
    check_name(name, where, written=written)
    try:
        path = (folder / name).resolve()
        within = path.is_relative_to(folder.resolve())
    except (OSError, RuntimeError, ValueError) as error:
        reason = error.strerror if isinstance(error, OSError) else "its links lead back to themselves"
        raise CmmUqError(f"file {name!r} cannot be read: {reason}", where=where,
                         fix="Copy the file itself into the folder") from None  # fmt: skip
    if not within:
        raise CmmUqError(f"file {name!r} is not inside the job folder", where=where, fix=_COPY)
    return path


def check_name(name: str, where: str, *, written: bool = False) -> None:
    """Refuse a name that no file of a job can have; see :func:`inside`."""
    if problem := _name_problem(name, written):
        raise CmmUqError(problem[0], where=where, fix=problem[1])


def check_distinct(names: Iterable[str], where: str) -> None:
    """Refuse two names that some systems take for one."""
    seen: dict[str, str] = {}
    for name in names:
        other = seen.setdefault(unicodedata.normalize("NFC", name).casefold(), name)
        if other != name:
            raise CmmUqError(f"the files {other!r} and {name!r} are one on Windows and macOS", where=where,
                             fix="Rename one of them")  # fmt: skip


def sha256(inputs: Mapping[str, bytes]) -> dict[str, str]:
    """SHA-256 of every input, by its name."""
    return {name: hashlib.sha256(content).hexdigest() for name, content in inputs.items()}


def device_name(name: str) -> bool:
    """Whether Windows takes the name for a device."""
    return _DEVICE.fullmatch(name) is not None


def _name_problem(name: str, written: bool) -> tuple[str, str] | None:
    rename = "Rename the file"
    if PurePosixPath(name).is_absolute() or PureWindowsPath(name).drive or name.startswith("\\"):
        return f"file {name!r} is an absolute name", "Name it relative to job.toml, and keep it beside it"
    if not name or name.startswith("../"):
        return f"file {name!r} is not inside the job folder", _COPY
    if "\\" in name:
        return f"file {name!r} has a backslash in it", "Separate folders by /"
    if len(name) > FILE_NAME.most:
        return f"file {name!r} has a name of {len(name)} characters: {FILE_NAME.most} are the most", rename
    if any(unicodedata.category(c)[0] == "C" or c in _FORBIDDEN for c in name):
        return f"file {name!r} has a character in it that not every system takes in a name", rename
    parts = name.split("/")
    if any(part in ("", ".", "..") for part in parts):
        return f"file {name!r} is no plain name", "Name it relative to job.toml, without . and .."
    if any(device_name(part) or part != part.rstrip(". ") or part != part.lstrip() for part in parts):
        return f"file {name!r} is a name that Windows does not take", rename
    # what a command wrote belongs to a job with its recording, or as the results of another in a folder
    along = parts[-1] in DERIVED or (len(parts) > 1 and _REPORTED.fullmatch(parts[-1]))
    if _WRITTEN.fullmatch(parts[-1]) and not (written and along):
        return f"file {name!r} has a name that cmm-uq writes itself", rename
    return None


@dataclass(frozen=True)
class FilesInFolder:
    """Files beside a job.toml, by the names that it has for them."""

    toml: Path

    def has(self, name: str, *, written: bool = False) -> bool:
        return os.path.lexists(inside(self.toml.parent, name, str(self.toml), written=written))

    def job_file(self, limit: Limit, fix: str) -> bytes:
        return content_of(self.toml, limit, fix)

    def content(self, name: str, limit: Limit, fix: str, *, written: bool = False) -> bytes:
        return content_of(inside(self.toml.parent, name, str(self.toml), written=written), limit, fix)


@dataclass(frozen=True)
class FilesInMemory:
    """Files of a job that lies in no folder, by name."""

    files: Mapping[str, bytes]
    toml: Path = Path("job.toml")

    def has(self, name: str, *, written: bool = False) -> bool:
        return name in self.files

    def job_file(self, limit: Limit, fix: str) -> bytes:
        return self._content(self.toml.name, limit, fix)

    def content(self, name: str, limit: Limit, fix: str, *, written: bool = False) -> bytes:
        check_name(name, str(self.toml), written=written)
        return self._content(name, limit, fix)

    def _content(self, name: str, limit: Limit, fix: str) -> bytes:
        if name not in self.files:
            raise CmmUqError("no such file", where=name, fix=fix)
        content = self.files[name]
        if len(content) > limit.most:
            raise CmmUqError(f"is larger than the {limit.most} {limit.unit} that are read of such a file", where=name,
                             fix="Give less of it")  # fmt: skip
        return content


JobFiles = FilesInFolder | FilesInMemory
