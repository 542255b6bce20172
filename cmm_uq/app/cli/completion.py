"""What a shell completes: job folders and model files a few folders deep, none of which is read, and kinds of new jobs."""

from __future__ import annotations

import os
from collections.abc import Iterator

JOB_FILE = "job.toml"

DEEP = 3
"""Folders below the one that is typed."""

MOST = 5000
"""Entries that are looked at: completion must be quick in any folder."""


def job_folders(incomplete: str) -> list[str]:
    """Folders with a ``job.toml`` that begin as typed; the shell completes any path where there are none."""
    return sorted({folder for folder, name in _files(incomplete) if name == JOB_FILE and folder.startswith(incomplete)})


def toml_files(incomplete: str) -> list[str]:
    """Files in TOML that begin as typed and are no job."""
    found = (os.path.join(folder, name) for folder, name in _files(incomplete) if name.endswith(".toml"))  # noqa: PTH118
    return sorted(path for path in found if path.startswith(incomplete) and not path.endswith(JOB_FILE))


def kinds(incomplete: str) -> list[str]:
    """What a new job can be, those of other packages too."""
    from cmm_uq.app.cli.deferred import defer_scipy

    defer_scipy()
    from cmm_uq.app.commands.jobs.folder import BUDGET, PLAN
    from cmm_uq.app.commands.jobs.new import known
    from cmm_uq.app.commands.new_part import PART

    return [name for name in (*known(), PLAN, PART, BUDGET) if name.startswith(incomplete)]


def profiles(incomplete: str) -> list[str]:
    """Ready profiles of instruments, and files in TOML."""
    from cmm_uq.laboratory.live.instruments.library import ready

    return [*(name for name in ready() if name.startswith(incomplete)), *toml_files(incomplete)]


def _files(incomplete: str) -> Iterator[tuple[str, str]]:
    """Folder and name of the files below the folder that is typed, each folder as it would be typed."""
    start = os.path.dirname(incomplete)  # noqa: PTH120 - a Path would drop the "./" that was typed
    todo, seen = [(start, 0)], 0
    while todo and seen < MOST:
        folder, depth = todo.pop(0)
        try:
            entries = sorted(os.scandir(folder or "."), key=lambda entry: entry.name)
        except OSError:
            continue
        for entry in entries:
            seen += 1
            if entry.name.startswith("."):
                continue
            if entry.is_file():
                yield folder, entry.name
            elif depth < DEEP and entry.is_dir():
                todo.append((os.path.join(folder, entry.name), depth + 1))  # noqa: PTH118
