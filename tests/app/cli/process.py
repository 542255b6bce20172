"""The command as a user runs it: in this process, or in one of its own where that matters."""

from __future__ import annotations

import io
import subprocess
import sys
import warnings
from contextlib import chdir, redirect_stderr, redirect_stdout
from pathlib import Path
from unittest import mock

from cmm_uq.app import cli

COMMAND = [sys.executable, "-m", "cmm_uq"]


def run(*arguments: object, cwd: Path | None = None) -> subprocess.CompletedProcess[str]:
    """Run it to its end, with everything that it says, without the second that a process spends on imports.

    Not seen here: signals, what streams and terminals do, and what another order of hashes would change.
    """
    line = ["cmm-uq", *map(str, arguments)]
    out, err = (io.TextIOWrapper(io.BytesIO(), encoding="utf-8", write_through=True) for _ in range(2))
    with (
        redirect_stdout(out), redirect_stderr(err), chdir(cwd or Path.cwd()),
        mock.patch.object(sys, "argv", line), warnings.catch_warnings(action="ignore"),
    ):  # fmt: skip
        code = cli.run_command()
    told = [stream.buffer.getvalue().decode() for stream in (out, err)]
    return subprocess.CompletedProcess(line, code, *told)


def run_apart(*arguments: object, cwd: Path | None = None) -> subprocess.CompletedProcess[str]:
    """The same as a process of its own."""
    return subprocess.run([*COMMAND, *map(str, arguments)], capture_output=True, text=True, check=False, cwd=cwd,
                          encoding="utf-8")  # fmt: skip
