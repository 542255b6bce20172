"""What takes long to make, made once for all processes of a run of the tests, in its temporary folder."""

from __future__ import annotations

import os
import pickle
from collections.abc import Callable, Mapping
from functools import cache
from pathlib import Path


def shared(name: str, make: Callable[[], bytes]) -> bytes:
    """What another process of this run may have made already; two at once make the same."""
    folder = os.environ.get("CMM_UQ_TESTS_SHARE")
    if folder is None:
        return make()
    path = Path(folder) / name
    if not path.exists():
        own = path.with_suffix(f".{os.getpid()}")
        own.write_bytes(make())
        own.replace(path)
    return path.read_bytes()


def shared_files(make: Callable[[], Mapping[str, bytes]]) -> Callable[[], Mapping[str, bytes]]:
    """Files by name, made once for all processes, and read once in each."""

    @cache
    def files() -> Mapping[str, bytes]:
        name = f"{make.__module__}.{make.__name__}.pickle"
        found: dict[str, bytes] = pickle.loads(shared(name, lambda: pickle.dumps(dict(make()))))
        return found

    return files


def files_below(folder: Path) -> dict[str, bytes]:
    """Every file below a folder, by its path in it."""
    files = (path for path in sorted(folder.rglob("*")) if path.is_file())
    return {path.relative_to(folder).as_posix(): path.read_bytes() for path in files}


def put(folder: Path, files: Mapping[str, bytes]) -> Path:
    """Files in a folder."""
    for name, content in files.items():
        (folder / name).parent.mkdir(parents=True, exist_ok=True)
        (folder / name).write_bytes(content)
    return folder
