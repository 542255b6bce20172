"""The records compared with their chain, when somebody asks for it: one comparison at a time, beside the pages."""

from __future__ import annotations

import datetime as dt
import threading
from collections.abc import Callable
from dataclasses import dataclass

from cmm_uq.base.errors import CmmUqError
from cmm_uq.laboratory.records.facts import Finding
from cmm_uq.laboratory.records.store import Records

MOST = 100
"""Findings that are shown."""

AT_ONCE_S = 1.0
"""How long whoever asks waits for the result; a longer comparison goes on without him."""


@dataclass(frozen=True)
class Checked:
    """A comparison that has ended.

    Parameters
    ----------
    at : moment of its end.
    head : number and hash of the last entry.
    files : whether the files were compared too.
    findings : what is wrong, the first hundred.
    count : how many there are.
    failed : why it could not be done; empty where it was.
    """

    at: dt.datetime
    head: tuple[int, str]
    files: bool
    findings: tuple[Finding, ...] = ()
    count: int = 0
    failed: str = ""


class Checking:
    """Compares on request.

    Parameters
    ----------
    opened : opens the records, to be read.
    """

    def __init__(self, opened: Callable[[], Records]) -> None:
        self._opened, self._lock = opened, threading.Lock()
        self._running: threading.Thread | None = None
        self._since: dt.datetime | None = None
        self._last: Checked | None = None

    @property
    def last(self) -> Checked | None:
        """The comparison that ended last; ``None`` before the first."""
        return self._last

    @property
    def since(self) -> dt.datetime | None:
        """When the one that is under way began; ``None`` where none is."""
        return self._since

    def begin(self, *, files: bool) -> None:
        """Compare, unless that is under way already; returns when it is done, or after a second."""
        with self._lock:
            if self._since is None:
                self._since = dt.datetime.now(dt.UTC)
                self._running = threading.Thread(target=self._compare, args=(files,), name="verify", daemon=True)
                self._running.start()
        self.wait(AT_ONCE_S)

    def wait(self, seconds: float) -> None:
        """Until the comparison that is under way has ended, or so many seconds."""
        with self._lock:
            running = self._running
        if running is not None:
            running.join(seconds)

    def _compare(self, files: bool) -> None:
        head = (0, "")
        try:
            with self._opened() as records:
                head = records.head()
                findings = records.verify(files=files)
            found = Checked(dt.datetime.now(dt.UTC), head, files, tuple(findings[:MOST]), len(findings))
        except CmmUqError as error:
            found = Checked(dt.datetime.now(dt.UTC), head, files, failed=str(error))
        except Exception as error:  # whatever it is, the page says that nothing was compared
            found = Checked(dt.datetime.now(dt.UTC), head, files, failed=f"{type(error).__name__}: {error}")
        with self._lock:
            self._last, self._since = found, None
