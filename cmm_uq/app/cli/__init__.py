"""The command ``cmm-uq``: one subcommand a file, heavy imports only where they are used.

Exit codes: 0 done; 2 bad input; 3 output impossible; 4 done, and not conforming or inconsistent (with ``--strict``);
130 after SIGINT, 143 after SIGTERM; 1 done, and something needs a person (``report --scheduled``, ``schedule test``).
``verify`` alone: 1 something is wrong with the certificate, 3 not all of it could be checked.
"""

from __future__ import annotations

import gc
import os
import sys
import warnings
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from cmm_uq.base.errors import CmmUqError

NEEDS_A_PERSON = 1
"""Exit code of a scheduled run after which a person has to look at something, and was told of it."""

BAD_INPUT = 2
"""Exit code of everything that the user can mend."""

NO_OUTPUT = 3
"""Exit code where the input is sound and the output is impossible: disk, permissions, a closed pipe, a fault in here."""

NOT_CONFORMING = 4
"""Exit code of a strict run that found a machine not conforming, or a recording that contradicts its model."""

NOT_VERIFIED, NOT_WHOLLY_CHECKED = 1, 3
"""Exit codes of a verification that found something wrong, and of one that could not check everything."""

THREADS = ("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS", "MKL_NUM_THREADS")
"""Matrices here are small: more threads cost more than they gain, and how many there are would show in the last digits."""

_NEW_OBJECTS = 1_000_000
"""Between two looks for what refers to itself: by default every 700, a fifteenth of a report's time for a megabyte."""


def main() -> None:
    """Run the command; whatever happens ends with one line and a documented exit code, never with a traceback."""
    from cmm_uq.app.cli.encoding import any_character
    from cmm_uq.app.cli.lighter import lighten
    from cmm_uq.base.output.interruption import done, watch

    watch()
    for variable in THREADS:
        os.environ.setdefault(variable, "1")
    if not sys.warnoptions:
        warnings.simplefilter("ignore")  # what matters is an error or a warning of the report, not a line of a library
    lighten()
    any_character()
    gc.set_threshold(_NEW_OBJECTS)
    code = _ended()
    try:
        if sys.stdout is not None:
            sys.stdout.flush()
    except (OSError, ValueError):
        from cmm_uq.app.cli.ending import tell
        from cmm_uq.app.cli.printing import closed

        code = code or NO_OUTPUT
        tell(closed(), code)
        os.dup2(os.open(os.devnull, os.O_WRONLY), 1)  # or the interpreter would complain once more at its end
    done()
    gc.freeze()  # or Python looks through all that there is before it ends, for a tenth of a report
    sys.exit(code)


def _ended() -> int:
    """Exit code of the subcommand."""
    from cmm_uq.app.cli.ending import tell
    from cmm_uq.base.errors import CmmUqError, OutputError

    code = NO_OUTPUT
    try:
        from cmm_uq.app.cli.commands import run

        return run()
    except CmmUqError as error:
        told, code = error, NO_OUTPUT if isinstance(error, OutputError) else BAD_INPUT
    except MemoryError:
        told = CmmUqError(
            "the memory does not suffice for this input", fix="Split it, or use a machine with more memory"
        )
    except Exception as error:
        told, code = _of_a_fault(error)
    tell(told, code)
    return code


def _of_a_fault(error: Exception) -> tuple[CmmUqError, int]:
    """A fault of another package or of this program, and the exit code."""
    from cmm_uq.base.errors import CmmUqError
    from cmm_uq.base.output.interruption import written
    from cmm_uq.base.plugins import told_with_package

    if (told := told_with_package(error)) is not None:
        return told, BAD_INPUT
    there = ", ".join(map(str, written()))
    state = f"The files are written in {there}" if there else "Nothing was written"
    problem = f"a fault of the program: {type(error).__name__}: {error}"
    return CmmUqError(problem, fix=f"{state}; please report it with the input"), NO_OUTPUT
