r"""Whether a regular expression reads any line in a time that grows with its length alone, proved from its structure.

Python's matcher tries one way after another. A *run* is such a way up to some character: a start, and which place of the
pattern read each character since (Glushkov's automaton; Weideman et al., CIAA 2016, LNCS 9705). No way is tried twice, so the
steps for a line are at most the runs alive after each of its characters, summed over the line, times the followers of a place.
If no text ever keeps more than *b* runs alive, *n* characters cost no more than *b·n* times a constant of the pattern. That is
what is proved, by going through all vectors of numbers of runs by place that any text may lead to (a message is ISO 8859-1:
256 characters, in fewer classes): where they are finitely many, none with more than :data:`MOST_RUNS`, the pattern is linear.
Two repeats that share a character, with nothing between that must be read, add a run with each; so does one within another.

What the matcher does beside reading counts for at least as much as it is. Where it begins: a ``fullmatch`` at the first
character; a ``search`` at every one until an attempt has matched, so runs of all starts are added up, and a leading repeat
behind which it may fail is not linear without ``^``, or what must stand there, before it; a ``split`` anew behind each match
besides, and it is linear only if nothing was read beyond that: once a run may end, all that may go on without end may end.
``^`` and a look at the one character before are conditions on it; ``$``, ``\b`` and other looks let everything pass, and end
nothing for sure. A possessive repeat of single characters, ``\s*+``, is left only before a character that it does not read;
other possessive parts and atomic groups count as if they gave back, which is more than they do. A look ahead is of limited
length and proved by itself. A repeat without end of what may be empty, backreferences and conditions are refused.
"""

from __future__ import annotations

import heapq
import re
from collections import Counter
from collections.abc import Iterable, Iterator
from functools import cache
from itertools import count
from re import _compiler, _parser  # type: ignore[attr-defined]
from typing import Any, Literal, NamedTuple

MOST_RUNS = 100  # alive at a time
_MOST_PLACES, _MOST_EDGES, _MOST_STEPS, _MOST_AHEAD = 4_000, 100_000, 500_000, 100
_CHARACTERS = 256
_START = 1 << _CHARACTERS  # a set of characters is a number with their bits; the beginning of the text is one more
_ANY = _START - 1
_SHOWN = 40  # characters of a pattern that a message shows
Use = Literal["fullmatch", "search", "split"]


class NotLinearError(ValueError):
    """What part of a pattern costs more, and the remedy."""


class _GrowsError(NotLinearError):
    """With every further one of a character there are more runs."""


class _Pass(NamedTuple):
    """On what condition the matcher gets through without reading."""

    before: int = _START | _ANY  # sets of characters that stand before and come next
    after: int = _ANY
    sure: bool = True  # whether nothing else may hinder it

    def then(self, other: _Pass) -> _Pass:
        return _Pass(self.before & other.before, self.after & other.after, self.sure and other.sure)


_Ends = Counter[tuple[int, _Pass]]


class _Part(NamedTuple):
    """Ways through a part of a pattern: without reading, and the places that read its first and last character."""

    empty: Counter[_Pass]
    first: _Ends
    last: _Ends

    def or_nothing(self) -> _Part:
        return self._replace(empty=self.empty + Counter([_Pass()]))


_NOTHING = _Part(Counter([_Pass()]), Counter(), Counter())


class _Automaton:
    def __init__(self, nodes: Any, flags: int) -> None:
        self.sets: list[int] = []  # of characters, by place
        self.edges: Counter[tuple[int, int, _Pass]] = Counter()
        self._parts = 0
        self.whole = self._sequence(nodes, flags)

    def _sequence(self, nodes: Any, flags: int) -> _Part:
        part = _NOTHING
        self._parts += 1
        if self._parts > _MOST_PLACES:
            raise NotLinearError("is too large to be checked: make it shorter, or its counted repeats smaller")
        for node in nodes:
            part = self._joined(part, self._part(node, flags))
        return part

    def _joined(self, a: _Part, b: _Part) -> _Part:
        self._link(a.last, b.first)
        first, last = a.first + _with(b.first, a.empty), b.last + _with(a.last, b.empty)
        return _Part(_products(a.empty, b.empty), first, last)

    def _link(self, last: _Ends, first: _Ends) -> None:
        for (p, out), m in last.items():
            for (q, into), n in first.items():
                self.edges[p, q, out.then(into)] += m * n
        if len(self.edges) > _MOST_EDGES:
            raise NotLinearError("is too large to be checked: make it shorter")

    def _part(self, node: Any, flags: int) -> _Part:
        kind, value = str(node[0]), node[1]
        match kind:
            case "LITERAL" | "NOT_LITERAL" | "ANY" | "IN":
                return self._place(_characters(repr(node), node, flags))
            case "SUBPATTERN":
                return self._sequence(value[3], (flags | value[1]) & ~value[2])
            case "BRANCH":
                parts = [self._sequence(branch, flags) for branch in value[1]]
                return _Part(*(sum(each, Counter()) for each in zip(*parts, strict=True)))
            case "ATOMIC_GROUP":
                if len(value) == 1 and str(value[0][0]) == "MAX_REPEAT":
                    return self._repeat(value[0][1], flags, possessive=True)
                return self._sequence(value, flags)
            case "MAX_REPEAT" | "MIN_REPEAT" | "POSSESSIVE_REPEAT":
                return self._repeat(value, flags, possessive=kind[0] == "P")
            case "AT":
                begins = str(value).startswith("AT_BEGINNING")
                lines = flags & re.MULTILINE and str(value) == "AT_BEGINNING"
                before = _START | (1 << ord("\n") if lines else 0)
                return _passed(_Pass(before) if begins else _Pass(sure=False))
            case "FAILURE":  # of (?!), in some versions
                return _Part(Counter(), Counter(), Counter())
            case "ASSERT" | "ASSERT_NOT":
                return self._look(kind == "ASSERT", value, flags)
        raise NotLinearError(
            "has a backreference or a condition, which no structure bounds: write what is meant instead"
        )

    def _place(self, characters: int) -> _Part:
        self.sets.append(characters)
        end = Counter([(len(self.sets) - 1, _Pass())])
        return _Part(Counter(), end, end)

    def _repeat(self, counted: Any, flags: int, *, possessive: bool) -> _Part:
        low, high, nodes = counted
        endless = str(high) == "MAXREPEAT"
        part = _NOTHING
        for _ in range(int(low) - endless):
            part = self._joined(part, self._sequence(nodes, flags))
        if not endless:
            more = _NOTHING
            for _ in range(int(high) - int(low)):
                more = self._joined(self._sequence(nodes, flags), more).or_nothing()
            return self._joined(part, more)
        place, loop = len(self.sets), self._sequence(nodes, flags)
        if loop.empty:
            raise NotLinearError("repeats without end what may be empty: let it read a character in each round")
        self._link(loop.last, loop.first)
        loop = loop if low else loop.or_nothing()
        if possessive and len(self.sets) == place + 1 and loop.last == Counter([(place, _Pass())]):
            leaves = Counter([_Pass(after=_ANY & ~self.sets[place])])
            loop = _Part(leaves if loop.empty else Counter(), loop.first, _with(loop.last, leaves))
        return self._joined(part, loop)

    def _look(self, wanted: bool, looked: Any, flags: int) -> _Part:
        """What stands before, of one character, exactly; anything else as if it held."""
        direction, nodes = looked
        if nodes.getwidth()[1] > _MOST_AHEAD:
            raise NotLinearError("looks ahead without limit: let it read what it looks at, or look at few characters")
        inner = _Automaton(nodes, flags)
        _Texts(inner, "fullmatch").most()
        single = len(inner.sets) == 1 and not inner.whole.empty and inner.whole.first == Counter([(0, _Pass())])
        if direction < 0 and single:
            read = inner.sets[0]
            return _passed(_Pass(read if wanted else (_START | _ANY) & ~read))
        return _passed(_Pass(sure=False))


def _passed(way: _Pass) -> _Part:
    return _Part(Counter([way]), Counter(), Counter())


def _products(a: Counter[_Pass], b: Counter[_Pass]) -> Counter[_Pass]:
    found: Counter[_Pass] = Counter()
    for one, m in a.items():
        for other, n in b.items():
            found[one.then(other)] += m * n
    return found


def _with(ends: _Ends, ways: Counter[_Pass]) -> _Ends:
    found: _Ends = Counter()
    for (place, one), m in ends.items():
        for other, n in ways.items():
            found[place, one.then(other)] += m * n
    return found


_KNOWN: dict[tuple[str, int], int] = {}


def _characters(key: str, node: Any, flags: int) -> int:
    """The characters that a node reads, by the engine itself."""
    if (key, flags) not in _KNOWN:
        one = _compiler.compile(_parser.SubPattern(_parser.State(), [node]), flags)
        _KNOWN[key, flags] = sum(1 << code for code in range(_CHARACTERS) if one.fullmatch(chr(code)))
    return _KNOWN[key, flags]


_Follow = dict[int, list[tuple[int, int, int]]]  # by character: place, what may stand before, ways


class _Texts:
    """All that texts do to the runs of an automaton."""

    def __init__(self, automaton: _Automaton, use: Use) -> None:
        whole, self._sets, self._use = automaton.whole, automaton.sets, use
        self._ends = {place for (place, way) in whole.last if way.sure and way.before == _START | _ANY}
        passes = {way for _, way in whole.first} | {way for _, _, way in automaton.edges}
        before = {way.before for way in passes}
        self._bits = list(_classes({*self._sets, *(way.after for way in passes), *before}).values())
        seen = _classes(before)  # of a character that was read, what a look at it tells
        self._seen = {bit: seen[_members(bit, before)] for bit in self._bits}
        into: list[list[tuple[int, _Pass, int]]] = [[] for _ in self._sets]
        for (p, q, way), ways in automaton.edges.items():
            into[p].append((q, way, ways))
        self._endless = _endless([{q for q, _, _ in follow} for follow in into])
        self._table = [self._by_character(follow) for follow in into]
        self._begins = self._by_character([(place, way, ways) for (place, way), ways in whole.first.items()])
        self._empty = any(way.sure and way.before & _START for way in whole.empty)

    def most(self) -> int:
        begin = (frozenset[tuple[int, int]](), _START, self._empty)
        known, number, waiting, most = {begin}, count(), [(0, 0, begin)], 0
        while waiting:  # those with many runs first: what has no bound shows it soon
            _, _, (runs, last, matched) = heapq.heappop(waiting)
            for bit in self._bits:
                for vector, flag in self._states(runs, last, bit, matched=matched):
                    state = frozenset(vector.items()), self._seen[bit], flag
                    most = max(most, total := sum(vector.values()))
                    if state not in known:
                        known.add(state)
                        heapq.heappush(waiting, (-total, next(number), state))
            if len(known) * len(self._bits) > _MOST_STEPS:
                raise NotLinearError("is too intricate to be checked: make it simpler")
        return most

    def _states(
        self, runs: frozenset[tuple[int, int]], last: int, bit: int, *, matched: bool
    ) -> Iterator[tuple[dict[int, int], bool]]:
        """Runs after one more character, and whether an attempt has matched by then."""
        anew, split = last == _START or (self._use != "fullmatch" and not matched), self._use == "split"
        following = self._step(runs, last, bit, anew=anew)
        over = matched or not self._ends.isdisjoint(following)
        beyond = split and over and not self._endless.intersection(following) <= self._ends
        if sum(following.values()) > MOST_RUNS or beyond:
            raise _GrowsError(chr(bit.bit_length() - 1))
        if following or not (split and matched):
            yield following, over
        if split and matched:  # the match has ended, and the next attempt begins
            following = self._step((), last, bit, anew=True)
            yield following, not self._ends.isdisjoint(following)

    def _step(self, runs: Iterable[tuple[int, int]], last: int, bit: int, *, anew: bool) -> dict[int, int]:
        found: dict[int, int] = {}
        for times, follow in [*((times, self._table[p]) for p, times in runs), *([(1, self._begins)] if anew else ())]:
            for place, before, ways in follow.get(bit, ()):
                if before & last:
                    found[place] = found.get(place, 0) + times * ways
        return found

    def _by_character(self, follow: Iterable[tuple[int, _Pass, int]]) -> _Follow:
        found: _Follow = {}
        for place, way, ways in follow:
            for bit in self._bits:
                if self._sets[place] & way.after & bit:
                    found.setdefault(bit, []).append((place, way.before, ways))
        return found


def most_runs(text: str, use: Use) -> int:
    """Most runs that any text keeps alive at a time; :class:`NotLinearError` where there is no bound, or none is shown."""
    tree = _parser.parse(text)
    return _Texts(_Automaton(tree, tree.state.flags), use).most()


def _classes(sets: set[int]) -> dict[frozenset[int], int]:
    """A character, as its bit, of each class that no set tells apart; one that can be printed where there is one."""
    found: dict[frozenset[int], int] = {}
    for code in sorted(range(_CHARACTERS), key=lambda code: not 32 <= code < 127):
        found.setdefault(_members(1 << code, sets), 1 << code)
    return found


def _members(bit: int, sets: set[int]) -> frozenset[int]:
    return frozenset(one for one in sets if one & bit)


def _endless(follow: list[set[int]]) -> set[int]:
    """Places from which a loop can be reached: what is left when those without followers are taken away, again and again."""
    left = set(range(len(follow)))
    while gone := {place for place in left if follow[place].isdisjoint(left)}:
        left -= gone
    return left


_BEGIN = {
    "search": "from each place of the message anew: begin it with ^, or with what must stand before, as (?<![0-9.])",
    "split": "whether or not a separator ends there: begin it with what a separator must have",
}


@cache
def check_linear(text: str, use: Use) -> None:
    """Refuse a regular expression that is not shown to be linear: :class:`NotLinearError` says what part, and the remedy."""
    try:
        most_runs(text, use)
    except _GrowsError as error:
        part = _offending(text) if _grows(text, "fullmatch") else ""
        shown = part or text
        shown = f"'{shown if len(shown) <= _SHOWN else f'…{shown[-_SHOWN:]}'}'"
        remedy = _BEGIN.get(use, "")
        if part:
            remedy = (
                "in many ways: let something stand between its repeats that must be there, or have the first keep what it "
                "read, as \\s*+ and \\d++"
            )
        raise NotLinearError(f"{shown} reads many {str(error)!r} {remedy}") from None


def _grows(text: str, use: Use) -> bool:
    try:
        most_runs(text, use)
    except _GrowsError:
        return True
    except (NotLinearError, re.error):
        pass
    return False


def _offending(text: str) -> str:
    """A short part of a pattern that is not linear by itself: its beginning, halved to where it grows, and so its end."""

    def balanced(start: int, stop: int) -> str:
        groups = re.sub(r"\\.|\[\^?\]?[^\]]*\]", "", text[start:stop])
        return text[start:stop] + ")" * (groups.count("(") - groups.count(")"))

    def grows(start: int, stop: int) -> bool:
        return _grows(balanced(start, stop), "fullmatch")

    low, stop = 0, len(text)
    while stop - low > 1:
        middle = (low + stop) // 2
        near = next((end for end in range(middle, max(low, middle - 3), -1) if grows(0, end)), None)
        low, stop = (middle, stop) if near is None else (low, near)
    start, high = 0, stop
    while high - start > 1:
        middle = (start + high) // 2
        near = next((begin for begin in range(middle, max(start, middle - 3), -1) if grows(begin, stop)), None)
        start, high = (start, middle) if near is None else (near, high)
    return text[start:stop]
