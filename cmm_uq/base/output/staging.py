"""Locks that the system releases when their process ends, however it ends.

A set of files on its way: staged beside its place, then put there.

``.unfinished-X`` is staged by the process that holds the lock ``.unfinished-X.lock``. Renamed to ``.placing`` it has the
output folder for itself; from the moment its ``journal.json`` stands there, the set will be put in place, if need be by the
next command. Before that moment nothing in the folder has changed. A :class:`Ledger` that is told of a set knows of it from
before that moment, and has it from when all of it is in place.
"""

from __future__ import annotations

import contextlib
import os
import re
import secrets
import shutil
import time
from collections.abc import Iterable, Iterator, Mapping
from functools import partial
from hashlib import file_digest, sha256
from pathlib import Path
from typing import Protocol

from cmm_uq.base.errors import CmmUqError, OutputError
from cmm_uq.base.output import interruption, manifest
from cmm_uq.base.output.manifest import JOURNAL, MANIFEST, NEW, Journal, Manifest, Owner, journal_for, place, writing_to
from cmm_uq.base.values import dataclass


def locked(path: Path, *, create: bool) -> int | None:
    """Descriptor that holds the lock of a file until it is closed; ``None`` where another process does, or it is gone."""
    try:
        descriptor = os.open(path, os.O_RDWR | (os.O_CREAT | os.O_EXCL if create else 0), 0o600)
    except (FileNotFoundError, FileExistsError):
        if create:
            raise
        return None
    with contextlib.suppress(OSError):  # another process may have removed it in between
        if _lock(descriptor) and os.path.samestat(path.stat(), os.fstat(descriptor)):
            return descriptor
    os.close(descriptor)
    return None


def _lock(descriptor: int) -> bool:
    try:
        if os.name == "nt":
            import msvcrt

            msvcrt.locking(descriptor, msvcrt.LK_NBLCK, 1)  # type: ignore[attr-defined,unused-ignore]
        else:
            import fcntl

            fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except OSError:
        return False
    return True


STAGE, LOCK, PLACING = ".unfinished-", ".lock", ".placing"
_STAGED = re.compile(rf"{re.escape(STAGE)}([0-9a-f]{{12}})(?:{re.escape(LOCK)})?")
_MENDED = "Free the disk, mend the permissions, or choose another --out"
PATIENCE_S = 5.0
"""How long to wait for another process that is putting its files into the same folder: renames take milliseconds."""


class InDoubtError(OutputError):
    """A ledger cannot say whether it has a set: its files stay, and the next command settles it."""


class Ledger(Protocol):
    """What is to know of every set that is in place, and of no other.

    What a kill left between a set and its ledger is told by the set: it is in place where :data:`MANIFEST` has the hash that
    was intended, once :func:`finish_interrupted` was there and it :func:`is_pending` no more.
    """

    def intend(self, token: str, folder: Path, manifest: str) -> None:
        """Note that a set is to be put in place: the token of its stage, and the SHA-256 of its manifest."""

    def commit(self, token: str) -> None:
        """Have the set, all of which is in place. What is raised takes its files back, unless it is :class:`InDoubtError`."""

    def forget(self, token: str) -> None:
        """The set was not put in place."""


@dataclass(eq=False)
class Stage:
    """Where a command writes before its files are put in place; see :func:`staged`."""

    folder: Path
    owner: Owner
    inputs: tuple[Path, ...]
    force: bool
    token: str
    made: list[Path]
    descriptor: int = -1

    @property
    def stage(self) -> Path:
        return self.folder / f"{STAGE}{self.token}"

    @property
    def lock(self) -> Path:
        """The file whose lock says that this process lives."""
        return self.folder / f"{STAGE}{self.token}{LOCK}"

    def room(self, name: str) -> Path:
        """Where a file that is too large for memory is written, to be named to :meth:`write`."""
        self._check(name)
        return self.stage / NEW / name

    def write(
        self, contents: Mapping[str, bytes], large: Iterable[str] = (), *, ledger: Ledger | None = None
    ) -> dict[str, Path]:
        """Put a set of files in place, the manifest last; the path of each is given back, the manifest's too.

        ``contents`` of each file by its name inside the folder, ``large`` ones by their names where they were written into
        their :meth:`room`; the ``ledger`` has the set if it is put in place, and only then. A ``CmmUqError`` says that
        something that is not this owner's stands in the way; an ``OutputError`` that the disk is full, or that the place or
        the ledger cannot be written to; what stood there before is untouched.
        """
        with writing_to(self.folder, _MENDED):
            hashes = {name: sha256(content).hexdigest() for name, content in contents.items()}
            sizes = {name: len(content) for name, content in contents.items()}
            for name in large:
                hashes[name], sizes[name] = _synced_file(self.stage / NEW / name)
            whole = {**contents, MANIFEST: Manifest(self.owner, hashes).as_json(sizes)}
            for name, content in whole.items():
                self._check(name)
                with interruption.changing():
                    for folder in [*Path(name).parents][-2::-1]:  # none above: a stage that was removed stays so
                        (self.stage / NEW / folder).mkdir(exist_ok=True)
                    _write(self.stage / NEW / name, content)
            with interruption.placing(self.folder, self):
                if ledger is not None:
                    ledger.intend(self.token, self.folder.absolute(), sha256(whole[MANIFEST]).hexdigest())
                try:
                    self._commit(hashes, ledger)
                except BaseException:
                    # a set that could neither be put in place nor be taken back is left to the next command in the folder
                    if ledger is not None and _token(self.folder / PLACING) != self.token:
                        ledger.forget(self.token)
                    raise
        self.made.clear()
        return {name: self.folder / name for name in (*hashes, MANIFEST)}

    def _check(self, name: str) -> None:
        if not manifest.plain_name(name):
            raise CmmUqError(f"{name!r} cannot be the name of an output", where=str(self.folder))

    def _commit(self, hashes: Mapping[str, str], ledger: Ledger | None) -> None:
        placing = self._alone()
        try:
            journal = journal_for(
                self.folder, self.owner, hashes, inputs=self.inputs, force=self.force, token=self.token
            )
            _write(placing / f"{JOURNAL}.part", journal.as_json())
            (placing / f"{JOURNAL}.part").replace(placing / JOURNAL)
            synced(placing)
        except BaseException:
            _drop(self.folder, self.token)
            raise
        _finish(self.folder, placing, journal, ledger)

    def _alone(self) -> Path:
        """The stage renamed to ``.placing``, which only one process can have."""
        placing, deadline = self.folder / PLACING, time.monotonic() + PATIENCE_S
        while True:
            try:
                self.stage.rename(placing)
            except OSError as error:
                if not os.path.lexists(placing):
                    raise
                if not _token(placing):
                    raise CmmUqError("is not this program's and stands in its way", where=str(placing),
                                     fix="Remove it, or choose another folder with --out") from error  # fmt: skip
                finish_interrupted(self.folder)
                if time.monotonic() > deadline:
                    problem, fix = "another cmm-uq is writing here", "Wait until it is done"
                    raise OutputError(problem, where=str(self.folder), fix=fix) from error
                time.sleep(0.02)
            else:
                return placing

    def discard(self) -> None:
        """Remove what is staged, and the folders that were made for it and stayed empty."""
        shutil.rmtree(self.stage, ignore_errors=True)
        if self.descriptor >= 0:
            with contextlib.suppress(OSError):
                self.lock.unlink()
            with contextlib.suppress(OSError):
                os.close(self.descriptor)
            self.descriptor = -1
        for folder in self.made:
            with contextlib.suppress(OSError):
                folder.rmdir()


@contextlib.contextmanager
def staged(
    folder: Path, owner: Owner, *, inputs: Iterable[Path] = (), force: bool = False, expected: Iterable[str] = ()
) -> Iterator[Stage]:
    """Room for a set of files beside its place, gone afterwards; fails at once where it could not be put in place."""
    given = tuple(inputs)
    with writing_to(folder, _MENDED):
        made = [parent for parent in (folder, *folder.parents) if not parent.exists()]
    place = Stage(folder, owner, given, force, "", made)
    with interruption.staged(place):
        try:
            with writing_to(folder, _MENDED):
                if folder.exists() and not folder.is_dir():
                    fix = "Choose another folder with --out"
                    raise CmmUqError("is a file, not a folder", where=str(folder), fix=fix)
                with interruption.changing():
                    folder.mkdir(parents=True, exist_ok=True)
                finish_interrupted(folder)
                journal_for(folder, owner, dict.fromkeys(expected, ""), inputs=given, force=force)
                with interruption.changing():
                    # the lock before the folder: a stage whose lock nobody holds is nobody's
                    while place.descriptor < 0:
                        place.token = secrets.token_hex(6)
                        place.descriptor = locked(place.lock, create=True) or -1
                    (place.stage / NEW).mkdir(parents=True)
                    _write(place.stage / "token", place.token.encode())
            yield place
        finally:
            place.discard()


def finish_interrupted(folder: Path) -> None:
    """Complete or roll back what a process that is no more left in a folder; a stranger's files there are left alone."""
    try:
        names = [path.name for path in folder.iterdir() if path.name.startswith((STAGE, PLACING))]
    except (OSError, ValueError):
        return  # no folder, or none that can be read: whoever needs it will say so
    placing = folder / PLACING
    token = _token(placing) if PLACING in names else ""
    if token:
        with _of_the_dead(folder, token) as dead:
            journal = Journal.read(placing) if dead else None
            if journal is not None:
                with writing_to(folder, _MENDED):
                    _finish(folder, placing, journal)
            elif dead and _token(placing) == token:  # nobody was faster
                _drop(folder, token)
    for name in names:
        staged_by = _STAGED.fullmatch(name)
        if staged_by:
            _clear(folder, staged_by[1])


def is_pending(folder: Path, token: str) -> bool:
    """Whether a set is on its way in a folder still: its process lives, or somebody is just completing it."""
    with _of_the_dead(folder, token) as dead:
        lives = bool(token) and not dead
    return lives or _token(folder / PLACING) == token


def synced(folder: Path) -> None:
    """Have a folder's names on the disk, where the system can do that."""
    with contextlib.suppress(OSError, AttributeError):
        descriptor = os.open(folder, os.O_RDONLY | os.O_DIRECTORY)
        try:
            os.fsync(descriptor)
        finally:
            os.close(descriptor)


def replace_file(
    path: Path, content: bytes, fix: str = "Make room, or mend the folder's permissions", mode: int = 0o666
) -> None:
    """Write a file anew, and its folder: who reads it finds the old content or the new one, after a power cut too."""
    temporary = path.with_name(f".unfinished-{secrets.token_hex(6)}")
    with writing_to(path, fix):
        path.parent.mkdir(parents=True, exist_ok=True)
        try:
            with open(temporary, "xb", opener=partial(os.open, mode=mode)) as file:
                file.write(content)
                file.flush()
                os.fsync(file.fileno())
            temporary.replace(path)
        finally:
            temporary.unlink(missing_ok=True)
    synced(path.parent)


def _token(placing: Path) -> str:
    """Whose stage a folder is; empty where it is not one."""
    try:
        token = (placing / "token").read_text(encoding="ascii")
    except (OSError, ValueError):
        return ""
    return token if _STAGED.fullmatch(f"{STAGE}{token}") else ""


@contextlib.contextmanager
def _of_the_dead(folder: Path, token: str) -> Iterator[bool]:
    """Whether the process that staged something is no more; while that is acted upon nobody else does, nor takes its lock."""
    lock = folder / f"{STAGE}{token}{LOCK}"
    descriptor = locked(lock, create=False)
    try:
        yield descriptor is not None or not lock.exists()
    finally:
        if descriptor is not None:
            os.close(descriptor)


def _clear(folder: Path, token: str) -> None:
    """Remove the stage of a process that is no more, and its lock: under the lock, which may just be made."""
    lock = folder / f"{STAGE}{token}{LOCK}"
    with _of_the_dead(folder, token) as dead:
        if dead:
            shutil.rmtree(folder / f"{STAGE}{token}", ignore_errors=True)
            with contextlib.suppress(OSError):
                lock.unlink()
    if dead:
        with contextlib.suppress(OSError):
            lock.unlink()  # Windows removes no open file


def _finish(folder: Path, placing: Path, journal: Journal, ledger: Ledger | None = None) -> None:
    try:
        place(folder, placing, journal)
        synced(folder)
        if ledger is not None:
            ledger.commit(journal.token)
    except InDoubtError:
        raise
    except (OSError, CmmUqError):
        if manifest.rolled_back(folder, placing, journal):
            _drop(folder, journal.token)
        raise
    _drop(folder, journal.token)


def _drop(folder: Path, token: str) -> None:
    """Remove ``.placing``, first its name: half removed it is still known as this program's."""
    placing, stage = folder / PLACING, folder / f"{STAGE}{token}"
    with contextlib.suppress(OSError):
        (placing / JOURNAL).unlink(missing_ok=True)
    try:
        placing.rename(stage)
    except OSError:
        stage = placing
    shutil.rmtree(stage, ignore_errors=True)


def _write(path: Path, content: bytes) -> None:
    with path.open("wb") as file:
        file.write(content)
        file.flush()
        os.fsync(file.fileno())


def _synced_file(path: Path) -> tuple[str, int]:
    """SHA-256 and size of a file, once it is on the disk."""
    with path.open("rb+") as file:
        os.fsync(file.fileno())
        return file_digest(file, "sha256").hexdigest(), path.stat().st_size
