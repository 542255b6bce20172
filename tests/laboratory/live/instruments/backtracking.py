"""A matcher that backtracks as Python's does, written over the same parsed tree, which counts what it tries to read."""

from __future__ import annotations

import re
from collections.abc import Iterator
from re import _parser  # type: ignore[attr-defined]
from typing import Any


class Counting:
    def __init__(self, pattern: str, text: str) -> None:
        self.tree, self.text, self.attempts = _parser.parse(pattern), text, 0

    def fullmatch(self) -> bool:
        return any(end == len(self.text) for end in self._sequence(list(self.tree), 0))

    def search(self, start: int = 0) -> tuple[int, int] | None:
        for place in range(start, len(self.text) + 1):
            for end in self._sequence(list(self.tree), place):
                return place, end
        return None

    def split(self) -> list[str]:
        """Where no match is empty."""
        parts, place = [], 0
        while found := self.search(place):
            parts.append(self.text[place : found[0]])
            place = found[1]
        return [*parts, self.text[place:]]

    def _sequence(self, nodes: list[Any], place: int) -> Iterator[int]:
        if not nodes:
            yield place
            return
        for end in self._node(nodes[0], place):
            yield from self._sequence(nodes[1:], end)

    def _node(self, node: Any, place: int) -> Iterator[int]:
        kind, value = str(node[0]), node[1]
        if kind in ("LITERAL", "NOT_LITERAL", "ANY", "IN"):
            yield from self._character(kind, value, place)
        elif kind == "SUBPATTERN":
            yield from self._sequence(list(value[3]), place)
        elif kind == "BRANCH":
            for branch in value[1]:
                yield from self._sequence(list(branch), place)
        elif kind in ("MAX_REPEAT", "MIN_REPEAT"):
            low, high, body = value
            yield from self._repeat(int(low), high, list(body), place, 0, lazy=kind == "MIN_REPEAT")
        elif kind == "POSSESSIVE_REPEAT":
            low, high, body = value
            yield from _first(self._repeat(int(low), high, list(body), place, 0, lazy=False))
        elif kind == "ATOMIC_GROUP":
            yield from _first(self._sequence(list(value), place))
        elif kind == "AT":
            yield from [place] if place == 0 else []
        elif kind == "ASSERT_NOT":
            before = place + int(value[0])  # one character before
            held = before >= 0 and any(True for _ in self._sequence(list(value[1]), before))
            yield from [] if held else [place]
        else:
            raise AssertionError(kind)

    def _character(self, kind: str, value: Any, place: int) -> Iterator[int]:
        if place == len(self.text):
            return
        self.attempts += 1
        code = ord(self.text[place])
        read = {"ANY": lambda: code != 10, "LITERAL": lambda: code == value, "NOT_LITERAL": lambda: code != value,
                "IN": lambda: any(item == code for _, item in value)}[kind]()  # fmt: skip
        if read:
            yield place + 1

    def _repeat(self, low: int, high: Any, body: list[Any], place: int, done: int, *, lazy: bool) -> Iterator[int]:
        if lazy and done >= low:
            yield place
        if str(high) == "MAXREPEAT" or done < int(high):
            for end in self._sequence(body, place):
                yield from self._repeat(low, high, body, end, done + 1, lazy=lazy)
        if not lazy and done >= low:
            yield place


def _first(ways: Iterator[int]) -> Iterator[int]:
    for way in ways:
        yield way
        return


def check_against_re(pattern: str, text: str) -> Counting:
    """The count of a search, once it has found what Python's own matcher finds."""
    counted = Counting(pattern, text)
    own = re.search(pattern, text)
    assert counted.search() == (None if own is None else own.span())
    return counted
