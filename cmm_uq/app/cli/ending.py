"""How a command says that it failed: one line on standard error, or one JSON object where JSON was asked for."""

from __future__ import annotations

import contextlib
import json
import os
import sys

from cmm_uq.app.cli.printing import columns, on_terminal, styled
from cmm_uq.base.errors import LONGEST_MESSAGE, CmmUqError, printable, shortened

NAME = "cmm-uq:"


def tell(error: CmmUqError, code: int) -> None:
    """What went wrong, on standard error; where nobody listens the exit code tells.

    Parameters
    ----------
    error : with its place and its fix.
    code : exit code of the process.
    """
    with contextlib.suppress(OSError, ValueError, AttributeError):
        if _json_wanted():
            told = {"problem": error.problem, "where": error.where, "fix": error.fix, "exit_code": code}
            print(json.dumps({"error": told}), file=sys.stderr, flush=True)  # noqa: T201
        else:
            _in_words(f"{NAME} {shortened(printable(str(error)), LONGEST_MESSAGE)}")


def _json_wanted() -> bool:
    """Also where the command line could not be read."""
    given = sys.argv[1:]
    return "--json" in given[: given.index("--")] if "--" in given else "--json" in given


def _in_words(text: str) -> None:
    """One line; on a terminal folded between words, its beginning in red."""
    if on_terminal(sys.stderr):
        from cmm_uq.app.cli.folding import folded

        text = "\n".join(folded(text, columns()))
        if styled(sys.stderr) and os.name != "nt":  # old consoles of Windows would show the codes
            text = text.replace(NAME, f"\x1b[1;31m{NAME}\x1b[0m", 1)
    print(text, file=sys.stderr, flush=True)  # noqa: T201
