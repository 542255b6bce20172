"""Errors that a user can act on: what is wrong, where, and how to mend it.

Everything that bad input can cause is raised as :class:`CmmUqError`; the command line prints it without a traceback and
ends with exit code 2.
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


def suggestion(word: str, known: Iterable[str]) -> str:
    """Answer to an unknown name: the nearest known one, else all of them."""
    names = sorted(known)
    near = get_close_matches(word, names, n=1, cutoff=0.6)
    return f"Did you mean {near[0]!r}?" if near else f"Known: {', '.join(names)}"
