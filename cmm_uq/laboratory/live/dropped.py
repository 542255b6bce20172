"""A folder that a machine's program drops results into: each file is read once, when it has stood still.

Stable is a file whose size and time of change are the same at two looks at least :data:`STILL_S` apart, and that did not
change within that time. What was there before the session began is read too, unless a session took it already.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from cmm_uq.base.errors import CmmUqError
from cmm_uq.base.files.content import content_of
from cmm_uq.base.files.limits import TABLE_BYTES
from cmm_uq.base.messages import Text, Verbatim, say
from cmm_uq.laboratory.live.instruments.source import Clock

STILL_S = 1.0
"""For which a file must not change."""

_UNFINISHED = (".tmp", ".part", ".crdownload", ".swp", "~")


@dataclass(frozen=True)
class Dropped:
    """A file that stands still.

    Parameters
    ----------
    path, content : of it.
    utc_ns : when it was last changed.
    """

    path: Path
    content: bytes
    utc_ns: int


class Watched:
    """A folder.

    Parameters
    ----------
    folder : that is looked into.
    clock : for the time between two looks.

    Attributes
    ----------
    trouble : what could not be read, to be said once.

    Raises
    ------
    CmmUqError : it is not there.
    """

    def __init__(self, folder: Path, clock: Clock) -> None:
        if not folder.is_dir():
            raise CmmUqError("is no folder", where=str(folder), fix="Make it, or mend folder in [acquire] of job.toml")
        self.folder, self._clock = folder, clock
        self._seen: dict[str, tuple[int, int, int]] = {}
        self._done: dict[str, tuple[int, int]] = {}
        self._readable = True
        self.trouble: list[Text] = []

    def look(self) -> list[Dropped]:
        """Files that stand still since the last looks, oldest first."""
        now, found = self._clock.monotonic_ns(), list[Dropped]()
        for path in self._files():
            try:
                state = path.stat()
            except OSError:
                continue
            size, changed = state.st_size, state.st_mtime_ns
            if self._done.get(path.name) == (size, changed):
                continue
            before = self._seen.get(path.name)
            if before is None or before[:2] != (size, changed):
                self._seen[path.name] = (size, changed, now)
            elif now - before[2] >= STILL_S * 1e9:
                self._done[path.name] = (size, changed)
                found += self._content(path, size, changed)
        return sorted(found, key=lambda one: (one.utc_ns, one.path.name))

    def again(self, path: Path) -> None:
        """A file could not be kept: read it again."""
        self._done.pop(path.name, None)

    def _files(self) -> list[Path]:
        try:
            found = [
                path for path in self.folder.iterdir()
                if path.is_file() and not path.name.startswith(".") and not path.name.endswith(_UNFINISHED)
            ]  # fmt: skip
            self._readable = True
            return found
        except OSError as error:
            if self._readable:
                self.trouble.append(say("the folder {folder} cannot be read: {why}", folder=Verbatim(str(self.folder)),
                                        why=Verbatim(str(error.strerror))))  # fmt: skip
            self._readable = False
            return []

    def _content(self, path: Path, size: int, changed: int) -> list[Dropped]:
        try:
            content = content_of(path, TABLE_BYTES, "Export it again")
        except CmmUqError as error:
            self.trouble.append(Verbatim(str(error)))
            return []
        if len(content) != size:  # it went on growing between the look and the reading
            del self._done[path.name]
            return []
        return [Dropped(path, content, changed)]
