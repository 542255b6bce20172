"""Problems that stand, and since when: so that each is told once, and told again when it comes back after it was mended."""

from __future__ import annotations

import contextlib
import hashlib
from pathlib import Path

from cmm_uq.base.errors import OutputError
from cmm_uq.base.output.new_file import write_new
from cmm_uq.laboratory.schedule.state import PRIVATE


class Problems:
    """Problems of jobs and folders, a small file each.

    Parameters
    ----------
    out : folder of the reports.
    """

    def __init__(self, out: Path) -> None:
        self.folder = out / PRIVATE / "problems"
        try:
            self._known = {path.name for path in self.folder.iterdir()}
        except OSError:
            self._known = set()

    def since(self, about: str, problem: str, now: str) -> str:
        """The moment at which a problem was first met; now, where it is new.

        Parameters
        ----------
        about : job id, or folder.
        problem : in words.
        now : this moment.
        """
        path = self.folder / f"{_short(about)}-{_short(problem)}"
        with contextlib.suppress(OSError, OutputError):  # a full disk: it will be new again
            self.folder.mkdir(parents=True, exist_ok=True)
            write_new(path, now.encode())
            self._known.add(path.name)
        try:
            return path.read_text(encoding="utf-8")
        except (OSError, UnicodeDecodeError):
            return now

    def mended(self, about: str) -> None:
        """Forget what was wrong with a job or a folder."""
        short = _short(about)
        for name in [name for name in self._known if name.startswith(f"{short}-")] if self._known else ():
            self._known.discard(name)
            with contextlib.suppress(OSError):
                (self.folder / name).unlink()


def _short(text: str) -> str:
    return hashlib.sha256(text.encode("utf-8", "surrogateescape")).hexdigest()[:16]
