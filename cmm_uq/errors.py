"""Errors that a user can act on: what is wrong, where, and how to mend it.

Everything that bad input can cause is raised as :class:`CmmUqError`; the command line prints it without a traceback and
ends with exit code 2. Where the input is sound and the system refuses the output, it is an :class:`OutputError`, exit code 3.
"""

from __future__ import annotations

from collections.abc import Iterable
from difflib import get_close_matches


class CmmUqError(Exception):
    """Something in the input (or the place to write to) that the user has to mend.

    Parameters
    ----------
    problem : what is wrong, one sentence without a full stop.
    where : file, with line, key or column.
    fix : what to do about it.
    """

    def __init__(self, problem: str, *, where: str | None = None, fix: str | None = None) -> None:
        self.problem, self.where, self.fix = problem, where, fix
        super().__init__(str(self))

    def __str__(self) -> str:
        located = f"{self.where}: {self.problem}" if self.where else self.problem
        return f"{located}. {self.fix}" if self.fix else located


class OutputError(CmmUqError):
    """The system refuses the output: a full disk, a missing permission, a closed pipe."""


LONGEST_LINE = 300


def one_line(text: str) -> str:
    """Text as one line of at most 300 characters, with what would break it escaped."""
    plain = "".join(c if c.isprintable() else c.encode("unicode_escape").decode() for c in text)
    half = LONGEST_LINE // 2
    return plain if len(plain) <= LONGEST_LINE else f"{plain[: half - 1]}…{plain[-half:]}"


def suggestion(word: str, known: Iterable[str]) -> str:
    """Answer to an unknown name: the nearest known one, else all of them."""
    names = sorted(known)
    near = get_close_matches(word, names, n=1, cutoff=0.6)
    return f"Did you mean {near[0]!r}?" if near else f"Known: {', '.join(names)}"
