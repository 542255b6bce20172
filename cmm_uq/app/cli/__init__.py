"""The command ``cmm-uq``: from arguments to an exit code, with heavy imports only where they are used.

Exit codes: 0 done; 2 bad input; 3 output impossible; 4 done, and not conforming or inconsistent (with ``--strict``);
130 after SIGINT, 143 after SIGTERM; 1 done, and something needs a person (``report --scheduled``, ``schedule test``).
``verify`` alone: 1 something is wrong with the certificate, 3 not all of it could be checked.
"""

from __future__ import annotations

import errno
import gc
import os
import sys
import warnings

from cmm_uq.base.output.interruption import done, watch, written
from cmm_uq.base.unused import lighten

THREADS = ("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS", "MKL_NUM_THREADS")
"""Matrices here are small: more threads cost more than they gain, and how many there are would show in the last digits."""

NEW_OBJECTS = 1_000_000
"""Between two looks for what refers to itself: by default every 700, a fifteenth of a report's time for a megabyte."""


def main() -> None:
    """Run the command; whatever happens ends with one line and a documented exit code, never with a traceback."""
    from cmm_uq.app.cli.terminal import NO_OUTPUT, any_character, closed, tell

    watch()
    for variable in THREADS:
        os.environ.setdefault(variable, "1")
    os.environ.setdefault("PYDANTIC_DISABLE_PLUGINS", "1")  # it would read what every installed package offers
    if not sys.warnoptions:
        warnings.simplefilter("ignore")  # what matters is an error or a warning of the report, not a line of a library
    lighten()
    any_character()
    gc.set_threshold(NEW_OBJECTS)
    code = run_command()
    try:
        if sys.stdout is not None:
            sys.stdout.flush()
    except (OSError, ValueError):
        code = code or NO_OUTPUT
        tell(closed(), code)
        os.dup2(os.open(os.devnull, os.O_WRONLY), 1)  # or the interpreter would complain once more at its end
    done()
    gc.freeze()  # or Python looks through all that there is before it ends, for a tenth of a report
    sys.exit(code)


def run_command() -> int:
    """Exit code of the subcommand; what stops it is told on standard error."""
    from cmm_uq.app.cli.terminal import BAD_INPUT, NO_OUTPUT, tell
    from cmm_uq.base.errors import CmmUqError, OutputError
    from cmm_uq.base.plugins import told_with_package

    code = NO_OUTPUT
    try:
        from cmm_uq.app.cli.commands import run

        return run()
    except CmmUqError as refusal:
        error, code = refusal, NO_OUTPUT if isinstance(refusal, OutputError) else BAD_INPUT
    except MemoryError:
        fix = "Split it, or use a machine with more memory"
        error = CmmUqError("the memory does not suffice for this input", fix=fix)
    except Exception as fault:
        if (of_package := told_with_package(fault)) is not None:
            error, code = of_package, BAD_INPUT
        elif isinstance(fault, PermissionError) and fault.filename:  # asked about; who writes refuses in its own words
            where, fix = str(fault.filename), "Mend the permissions of it and of its folders"
            error, code = CmmUqError("cannot be read: Permission denied", where=where, fix=fix), BAD_INPUT
        elif isinstance(fault, OSError) and fault.errno == errno.ENAMETOOLONG:  # whatever option it was of
            where = str(fault.filename or "")
            error, code = CmmUqError("is too long a name", where=where, fix="Give a shorter one"), BAD_INPUT
        else:
            state = f"The files are written in {', '.join(map(str, written()))}" if written() else "Nothing was written"
            problem = f"a fault of the program: {type(fault).__name__}: {fault}"
            error = CmmUqError(problem, fix=f"{state}; please report it with the input")
    tell(error, code)
    return code
