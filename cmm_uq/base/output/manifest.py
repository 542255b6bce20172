"""``manifest.json``: which command wrote a folder's files, for which job, and the hash of each.

It is the last file of a set to be put in place, so that a folder whose files agree with it is one set, whole.
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from cmm_uq import __version__

MANIFEST = "manifest.json"
SCHEMA = "cmm-uq/manifest/1"
LARGEST = 4 * 2**20  # bytes of a manifest beyond which it is somebody else's file: a set has a dozen files


@dataclass(frozen=True)
class Owner:
    """Who writes a set, for the job of an id and the origin of its recording; only the same owner may replace it."""

    command: str
    job: str
    origin: str = "measured"

    def __str__(self) -> str:
        measured = "" if self.origin == "measured" else f" ({self.origin})"
        return f"cmm-uq {self.command} for {self.job}{measured}"


@dataclass(frozen=True)
class Manifest:
    """Owner of a set, and SHA-256 of each of its files by name."""

    owner: Owner
    files: Mapping[str, str]

    def as_json(self, sizes: Mapping[str, int]) -> bytes:
        """The file's bytes; ``sizes`` in bytes by name."""
        data = {
            "schema": SCHEMA,
            "program": f"cmm-uq {__version__}",
            "command": self.owner.command,
            "job": {"id": self.owner.job, "origin": self.owner.origin},
            "files": {name: {"sha256": self.files[name], "bytes": sizes[name]} for name in sorted(self.files)},
        }
        return (json.dumps(data, indent=2, ensure_ascii=False) + "\n").encode()


def read_manifest(folder: Path) -> Manifest | None:
    """The manifest of a folder; ``None`` where there is none that this program wrote."""
    path = folder / MANIFEST
    try:
        if path.is_symlink() or not path.is_file() or path.stat().st_size > LARGEST:
            return None
        return parsed(json.loads(path.read_bytes()))
    except (OSError, ValueError, RecursionError):
        return None


def parsed(data: Any) -> Manifest | None:
    """The manifest in JSON data; ``None`` where it is not one."""
    try:
        if data["schema"] != SCHEMA:
            return None
        owner = Owner(str(data["command"]), str(data["job"]["id"]), str(data["job"]["origin"]))
        files = {str(name): str(entry["sha256"]) for name, entry in data["files"].items()}
    except (TypeError, KeyError, AttributeError):
        return None
    return Manifest(owner, files) if all(plain_name(name) for name in files) else None


def plain_name(name: str) -> bool:
    """Whether a name stays inside its folder, on any system."""
    parts = name.split("/")
    return not any(part in ("", ".", "..") for part in parts) and not any(c in name for c in "\\:\0")


def sha256_of(path: Path) -> str | None:
    """SHA-256 of a regular file, read in blocks; ``None`` where it is none, or cannot be read."""
    try:
        if path.is_symlink() or not path.is_file():
            return None
        with path.open("rb") as file:
            return hashlib.file_digest(file, "sha256").hexdigest()
    except OSError:
        return None
