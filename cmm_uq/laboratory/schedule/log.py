"""What a schedule did, a line each, in a file that is begun anew when it is large; several runs may write it at once."""

from __future__ import annotations

import contextlib
import logging
import logging.handlers
from dataclasses import dataclass
from pathlib import Path

from cmm_uq.base.errors import CmmUqError, printable
from cmm_uq.laboratory.schedule.locks import turn

_PATIENCE_S = 2.0
"""How long to wait for another run that writes its line."""


@dataclass(frozen=True)
class Log:
    """A file of lines.

    Parameters
    ----------
    path : of the file; ``None`` for no log.
    largest : bytes at which a new one is begun.
    kept : former ones, numbered.
    """

    path: Path | None
    largest: int
    kept: int

    def write(self, text: str) -> None:
        """One line; a log that cannot be written stops nothing."""
        if self.path is None:
            return
        with (
            contextlib.suppress(OSError, CmmUqError),
            turn(self.path.with_name(f".{self.path.name}.lock"), patience_s=_PATIENCE_S),
        ):
            # opened for each line, so that a file that another run has begun anew is not written on
            handler = logging.handlers.RotatingFileHandler(
                self.path, maxBytes=self.largest, backupCount=self.kept, encoding="utf-8", errors="backslashreplace",
                delay=True,
            )  # fmt: skip
            handler.handleError = _passed_over  # type: ignore[method-assign]
            try:
                handler.emit(logging.makeLogRecord({"msg": printable(text)}))
            finally:
                handler.close()


def _passed_over(record: logging.LogRecord) -> None:
    """A full disk."""
