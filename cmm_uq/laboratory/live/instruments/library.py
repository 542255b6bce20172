"""Profiles by name: those that are ready, and users' own beside a job."""

from __future__ import annotations

from functools import cache
from importlib.resources import files
from pathlib import Path

from cmm_uq.base.errors import CmmUqError, suggestion
from cmm_uq.base.files.content import content_of
from cmm_uq.base.files.limits import JOB_BYTES, TEXT
from cmm_uq.base.files.toml_file import checked
from cmm_uq.laboratory.live.instruments.parsing import check_profile
from cmm_uq.laboratory.live.instruments.profile import ProfileFile

ENDING = ".toml"


def ready() -> tuple[str, ...]:
    """Names of the profiles that come with the program."""
    return tuple(sorted(path.name.removesuffix(ENDING) for path in _folder().iterdir() if path.name.endswith(ENDING)))


def profile_named(name: str, folder: Path = Path()) -> ProfileFile:
    """A profile.

    Parameters
    ----------
    name : of a ready one, or a file's.
    folder : in which the file lies.

    Raises
    ------
    CmmUqError : there is none, or it contradicts itself.
    """
    if name.endswith(ENDING):
        return read_profile(folder / name)
    if name not in ready():
        fix = f"{suggestion(name, ready())} A profile of your own ends in .toml"
        raise CmmUqError(f"there is no profile {name!r}", fix=fix)
    return _ready(name)


def read_profile(path: Path) -> ProfileFile:
    """A profile of a user's own.

    Raises
    ------
    CmmUqError : it cannot be read, or contradicts itself.
    """
    content = content_of(path, JOB_BYTES, "Name a profile: cmm-uq instruments list shows those that are ready")
    return profile_of(content, path)


@cache
def _ready(name: str) -> ProfileFile:
    file = _folder() / f"{name}{ENDING}"
    return profile_of(file.read_bytes(), Path(file.name))


def profile_of(content: bytes, path: Path) -> ProfileFile:
    """A profile of a file's bytes; see :func:`read_profile`."""
    found = checked(content, path, ProfileFile, most_word=TEXT.most)
    check_profile(found, str(path))
    return found


def _folder() -> Path:
    return Path(str(files("cmm_uq") / "laboratory" / "live" / "instruments" / "profiles"))
