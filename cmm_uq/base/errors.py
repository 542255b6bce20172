"""Errors that a user can act on: what is wrong, where, and how to mend it.

Everything that bad input can cause is raised as :class:`CmmUqError`; the command line prints it without a traceback and
ends with exit code 2; where the input is sound and the system refuses the output, it is an :class:`OutputError`, exit code 3.
Whatever an input holds, its message is one line that a terminal shows as it is written.
"""

from __future__ import annotations

import unicodedata
from collections.abc import Iterable, Iterator, Sequence
from contextlib import contextmanager
from difflib import get_close_matches

LONGEST_MESSAGE = 300 - len("cmm-uq: ")  # characters of a message
_LISTED = 220  # characters of a list of known names; such a list is no longer read
_FAMILY = 9  # names that begin with the whole word, up to which all of them are suggested: three axes about three
MOST_GATHERED = 50  # problems that are said of one input
_COMPARED = 100  # characters of a word that is compared with the known names: none of them is longer
_ELLIPSIS = "…"
_UNSHOWN = frozenset({"Cc", "Cf", "Co", "Cs", "Zl", "Zp"})
"""Categories of characters that break the line, change its direction, steer a terminal, or cannot be encoded."""


class CmmUqError(Exception):
    """Something in the input (or the place to write to) that the user has to mend.

    problem : what is wrong, one sentence without a full stop.
    where : file, with line, key or column.
    fix : what to do about it.
    also : what else is wrong with the same input, where its reader went on.
    """

    def __init__(self, problem: str, *, where: str | None = None, fix: str | None = None) -> None:
        self.problem, self.where, self.fix = problem, where, fix
        self.also: tuple[CmmUqError, ...] = ()
        super().__init__(str(self))

    def __str__(self) -> str:
        given = (self.where or "", self.problem, self.fix or "")
        where, problem, fix = (printable(shortened(part, 2 * LONGEST_MESSAGE)) for part in given)
        separators = len(": ") * bool(where) + len(". ") * bool(fix)
        if len(where) + len(problem) + len(fix) + separators > LONGEST_MESSAGE:
            shares = _shares([len(where), len(problem), len(fix)], LONGEST_MESSAGE - separators)
            # of a place its end says most: the file's own name, line and key
            where = shortened(where, shares[0], end=0.75)
            problem, fix = shortened(problem, shares[1]), shortened(fix, shares[2])
        located = f"{where}: {problem}" if where else problem
        return f"{located}. {fix}" if fix else located


def printable(text: str) -> str:
    r"""The text with everything that is no visible character written as an escape, such as ``\n`` or ``\u202e``."""
    if text.isascii() and text.isprintable():
        return text
    shown = (c.encode("unicode_escape").decode() if unicodedata.category(c) in _UNSHOWN else c for c in text)
    return "".join(shown)


def shortened(text: str, most: int, *, end: float = 0.5) -> str:
    """The text, or its two ends with an ellipsis between, at most ``most`` characters."""
    if len(text) <= most:
        return text
    tail = int((most - 1) * end)
    return text[: most - 1 - tail] + _ELLIPSIS + text[len(text) - tail :]


class OutputError(CmmUqError):
    """The system refuses the output: a full disk, a missing permission, a closed pipe."""


class NotInstalledError(CmmUqError):
    """What is asked for needs a package of an extra, or a file of its own, that is not here; all else goes on."""


class Gathered:
    """What is wrong with an input, one thing beside the other, until nothing more can be said of it."""

    def __init__(self) -> None:
        self.problems: list[CmmUqError] = []

    @contextmanager
    def going_on(self) -> Iterator[None]:
        """Keep an error of this part, and go on behind it."""
        try:
            yield
        except CmmUqError as error:
            self.add(error)

    def add(self, error: CmmUqError) -> None:
        """Keep an error, with what was gathered in it."""
        if len(self.problems) < MOST_GATHERED:
            self.problems += [error, *error.also]

    def tell(self, problem: str, *, where: str | None = None, fix: str | None = None) -> None:
        self.add(CmmUqError(problem, where=where, fix=fix))

    def refuse(self) -> None:
        """Raise the first error with the others in it; nothing where there is none."""
        if self.problems:
            first, *others = self.problems
            first.also = tuple(others[: MOST_GATHERED - 1])
            raise first


def suggestion(word: str, known: Iterable[str]) -> str:
    """Answer to an unknown name: the nearest known one, else all of them, or as many as can be read."""
    names = sorted(known)
    family = [name for name in names if name.startswith(f"{word}_")] if word not in names else []
    family = [name for name in family if "_" not in name.removeprefix(f"{word}_")] or family
    if 1 < len(family) <= _FAMILY:
        return f"Did you mean {', '.join(map(repr, family))}?"
    editions = [name for name in names if name.startswith(f"{word}:")]
    near = editions[-1:] or (get_close_matches(word, names, n=1, cutoff=0.6) if len(word) <= _COMPARED else [])
    if near:
        return f"Did you mean {near[0]!r}?"
    listed = ", ".join(names)
    if len(listed) > _LISTED:
        shown = listed[:_LISTED].rpartition(", ")[0]
        count = shown.count(", ") + 1 if shown else 0
        listed = f"{shown} and {len(names) - count} more" if shown else f"{len(names)} names"
    return f"Known: {listed}"


def _shares(lengths: Sequence[int], total: int) -> list[int]:
    """Characters for each part: short ones stay whole, the others share what is left alike."""
    cut = [i for i, length in enumerate(lengths) if length]
    while True:
        whole = [i for i in range(len(lengths)) if i not in cut]
        share = (total - sum(lengths[i] for i in whole)) // len(cut)
        longer = [i for i in cut if lengths[i] > share]
        if longer == cut:
            break
        cut = longer
    return [share if i in cut else length for i, length in enumerate(lengths)]
