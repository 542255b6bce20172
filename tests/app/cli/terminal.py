"""The command on a terminal: a pseudo-terminal of a given width, and all that it shows."""

from __future__ import annotations

import contextlib
import os
import re
import select
import subprocess
import time
from collections.abc import Mapping
from pathlib import Path

from tests.app.cli.process import COMMAND
from tests.conftest import ROOT

PATIENCE_S = 120.0


def on_terminal(
    *arguments: object, columns: int = 80, cwd: Path | None = None, environment: Mapping[str, str] | None = None
) -> tuple[int, str]:
    """Exit code, and what it wrote to the terminal."""
    import pty

    master, slave = pty.openpty()
    own = {key: value for key, value in os.environ.items() if key not in ("NO_COLOR", "COLUMNS", "LINES")}
    given = {"TERM": "xterm-256color", "COLUMNS": str(columns), "PYTHONPATH": str(ROOT), **(environment or {})}
    with subprocess.Popen([*COMMAND, *map(str, arguments)], stdin=slave, stdout=slave, stderr=slave, cwd=cwd,
                          env=own | given) as process:  # fmt: skip
        os.close(slave)
        shown = everything(master, time.monotonic() + PATIENCE_S)
    os.close(master)
    return process.returncode, shown.replace("\r\n", "\n")


def everything(master: int, deadline: float) -> str:
    """What a terminal shows until nothing writes to it any more."""
    return until(master, r"(?!)", deadline)


def until(master: int, wanted: str, deadline: float) -> str:
    """What a terminal shows until it has what is wanted, or nothing writes to it any more."""
    shown = b""
    with contextlib.suppress(OSError):  # of Linux, when the last program has closed it
        while time.monotonic() < deadline and not re.search(wanted, shown.decode(errors="replace")):
            if select.select([master], [], [], 0.1)[0]:
                chunk = os.read(master, 65536)
                if not chunk:
                    break
                shown += chunk
    return shown.decode(errors="replace")
