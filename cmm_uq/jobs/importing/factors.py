"""What labels count: lines and runs of lengths; of places see :mod:`~cmm_uq.jobs.importing.grouping`.

A label is a column of names or numbers, a title, a head above a column, a sheet, or a part of a name (``POS1_BALL2_M3``).
Words say what most of them count; figures say the rest: what differs where the same length is met again is a repeat, what the
nominal length fixes counts lengths. Nothing is taken where two observations would be one.
"""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from cmm_uq.base.points import Ints
from cmm_uq.jobs.importing.format import NotReadError
from cmm_uq.jobs.importing.header import plain_words, unspaced, words_of

LINE, RUN, POINT = "line", "run", "point"
_MARKS = {"+": 1, "-": -1, "−": -1, "↑": 1, "↓": -1, "→": 1, "←": -1}
_TOKEN = re.compile(r"[^\W_]+")
_GLUED = re.compile(r"(?<=\d)(?=[^\W\d_])|(?<=[^\W\d_])(?=\d)")
_CAMEL = re.compile(r"(?<=[a-zäöüéèà])(?=[A-Z])")
LETTERS = {*"ABCDEFGHabcdefgh"}  # of balls
# in names, ahead of their numbers
_SHORT = {"m": LINE, "p": POINT, "b": POINT, "k": POINT, "r": RUN, "w": RUN, "l": LINE, "bar": LINE, "stab": LINE,
          "barre": LINE, "barra": LINE}  # fmt: skip


@dataclass(frozen=True)
class Label:
    """What stands beside each observation, and the words that say what it counts."""

    words: str
    values: tuple[str, ...]
    sort: str = "column"  # or title, head, sheet, part


Counted = tuple[Label, Ints, str | None]  # a label, the number of its value for each observation, and what it counts


def ways_of(values: Sequence[str]) -> list[int] | None:
    """Sense of travel that labels name, +1 or −1; ``None`` where one of them names none, or all the same."""
    found: list[int] = []
    for value in values:
        text, words = value.strip(" ()[]"), plain_words(value)
        own = {_MARKS[c] for c in text if c in "↑↓→←"}
        ends = (text[-1:], text[:1] if not text[1:2].isdigit() else "")
        own |= set() if own else {_MARKS[c] for c in ends if c in _MARKS}
        for name, sense in (("forward", 1), ("backward", -1)):
            asian = [one for one in words_of("ways")[name] if len(one) > 1 and unspaced(one)]
            if any(word in words_of("ways")[name] or any(one in word for one in asian) for word in words):
                own.add(sense)
        if len(own) != 1:
            return None
        found += own
    return found if len({*found}) > 1 else None


def counted(label: Label, *, lengths: bool) -> str | None:
    """What a label counts, by the words above it, else by those in it."""
    if label.sort == "column" and (of := hint(label.words, lengths=lengths)) and (of != RUN or _counting(label.values)):
        return of
    if label.sort == "title" and not label.words:
        every = {hint(value, lengths=lengths) for value in {*label.values}}
        return every.pop() if len(every) == 1 else None
    if label.sort == "part" and {*label.values} <= LETTERS:
        return POINT
    words = (label.words, label.values[0]) if label.sort in ("title", "part") else label.values[:1]
    found = next((found for text in words if (found := hint(text, lengths=lengths))), None)
    alike = label.sort == "head" and _counting(label.values)
    return RUN if alike and found not in (LINE, POINT) else found


def _counting(values: Sequence[str]) -> bool:
    """Whether labels are alike but for their number."""
    return len({re.sub(r"\d+", "0", value) for value in values}) == 1


def hint(text: str, *, lengths: bool) -> str | None:
    """What words say that a label counts."""
    of, columns = words_of("lengths"), words_of("columns")
    run, line, point = of["run"] | columns["repeat"], of["line"], columns["point"] | (of["face"] if lengths else set())
    if not lengths:
        run, line = run - (columns["measurement"] - columns["repeat"]), line | columns["measurement"]
    words = plain_words(text)
    fits = [
        (len(one) if one == word else len(one) - 0.5, -k, name)
        for k, word in enumerate(words)
        for name, those in ((LINE, line), (POINT, point), (RUN, run))
        for one in those
        if one == word or (len(one) > 1 and unspaced(one) and one in word)
    ]
    exact = [fit for fit in fits if fit[0] == int(fit[0])]
    if fits:
        return max(exact, key=lambda fit: fit[1])[2] if exact else max(fits)[2]
    return _SHORT.get(words[0]) if words and all(word.isdigit() for word in words[1:]) else None


def parts_of(label: Label) -> list[Label]:
    """The parts of names that are alike but for words and numbers; else what is ahead of a last number, and that number."""
    for names in (label.values, tuple(_CAMEL.sub(" ", _GLUED.sub(" ", value)) for value in label.values)):
        tokens = [[(m[0], m.start(), m.end()) for m in _TOKEN.finditer(name)] for name in names]
        found: list[Label] = []
        if len({*map(len, tokens)}) > 1 or len(tokens[0]) < 2:
            continue
        before = ""
        for k, column in enumerate(zip(*tokens, strict=True)):
            values = tuple(token[0] for token in column)
            if len({*values}) > 1:
                halves = _halves(Label(before, values, "part"))
                if before and len(halves) == 1 and not {*values} <= LETTERS:  # with the word ahead of it
                    values = tuple(name[own[k - 1][1] : own[k][2]] for name, own in zip(names, tokens, strict=True))
                    halves = [Label(before, values, "part")]
                found += halves
            before = values[0] if len({*values}) == 1 and not values[0].isdigit() else ""
        if len(found) > 1 or (found and names is not label.values and found[0].values != label.values):
            return found
    last = [m for value in label.values if (m := re.fullmatch(r"(.*?([^\W\d_]*))[\W_]*(\d+)\D*", value))]
    if len(last) < len(label.values):
        return []
    words = {m[2] for m in last}
    of = word if len(words) == 1 and hint(word := words.pop(), lengths=True) == RUN else label.words
    names = tuple(m[1] for m in last)
    return [Label(label.words, names, "part"), Label(of, tuple(m[3] for m in last), "part")]


def _halves(label: Label) -> list[Label]:
    """A part such as ``1A`` or ``A1`` as its number and its letter."""
    for form in (r"(.*\d)([A-Za-z])", r"([A-Za-z])(\d+)"):
        halves = [re.fullmatch(form, value) for value in label.values]
        own = [tuple(m[k] for m in halves if m) for k in (1, 2)]
        if all(halves) and len({*own[0]}) > 1 < len({*own[1]}):
            return [Label(label.words if k == 0 else "", values, "part") for k, values in enumerate(own)]
    return [label]


def codes(values: Sequence[object]) -> Ints:
    known: dict[object, int] = {}
    return np.array([known.setdefault(value, len(known)) for value in values], dtype=np.int64)


def fixes(a: Ints, b: Ints) -> bool:
    """Whether the one says the other."""
    return len({*zip(a.tolist(), b.tolist(), strict=True)}) == len({*a.tolist()})


def together(*every: Ints) -> Ints:
    return codes([*zip(*(one.tolist() for one in every), strict=True)])


def varying(labels: Sequence[Label], *, lengths: bool) -> list[Counted]:
    """Labels, and parts of names, that differ and are there for all, without those that say the same again."""
    seen: dict[bytes, Counted] = {}
    names = (label for label in labels if label.sort in ("column", "head", "title") and len({*label.values}) > 1)
    for label in (*labels, *(part for name in names for part in parts_of(name))):
        own = codes(label.values)
        if own.max(initial=0) and "" not in label.values:
            before, of = seen.get(own.tobytes()), counted(label, lengths=lengths)
            if before is None or (before[2] is None and of is not None):
                seen[own.tobytes()] = label, own, of
    return [*seen.values()]


def in_turn(key: Ints) -> Ints:
    """1, 2, … of each key."""
    seen: Counter[int] = Counter()
    out = []
    for one in key.tolist():
        seen[one] += 1
        out.append(seen[one])
    return np.array(out, dtype=np.int64)


def numbered_runs(values: Sequence[str]) -> Ints:
    """Numbers of runs: those that their labels have, else as they come."""
    numbers = [re.findall(r"\d+", value) for value in values]
    if all(len(one) == 1 for one in numbers) and len({*values}) == len({one[0] for one in numbers}):
        return np.array([int(one[0]) for one in numbers])
    return codes(values) + 1


def lines_and_runs(labels: Sequence[Label], reference: Ints, place: str) -> tuple[list[str], Ints, list[str]]:
    """Name of the line and number of the run of each length, and by what labels; an error asks where nothing says."""
    count, several, found = len(reference), bool(reference.max(initial=0) > 0), varying(labels, lengths=True)
    if any(f[0].sort == "title" and f[2] == LINE for f in found):  # then M numbers measurements of a line
        found = [(f[0], f[1], RUN if f[0].sort == "head" and _counting(f[0].values) else f[2]) for f in found]
    plain = [f for f in found if not (several and (fixes(reference, f[1]) or f[1].max() + 1 == count))]
    run = _one_run(labels, [f for f in found if f[2] == RUN and not (several and fixes(reference, f[1]))], place)
    line: list[Counted] = []
    for one in sorted((f for f in plain if f[2] == LINE), key=lambda f: (f[0].sort == "part", -f[1].max())):
        if not line or not fixes(together(*(f[1] for f in line)), one[1]):
            line.append(one)

    def apart(*more: Ints) -> int:
        """How many of the lengths are told apart."""
        return int(together(reference, *(f[1] for f in line), *([run[1]] if run else []), *more).max()) + 1

    rank = {sort: k for k, sort in enumerate(("title", "sheet", "head", "block", "part", "column"))}
    others = [f for f in plain if f[2] in (None, POINT)]
    for one in sorted(others, key=lambda f: (f[2] == POINT, rank[f[0].sort], f[1].max())):
        if apart() == count or apart(one[1]) == apart():
            continue
        whole = run is not None and apart(one[1]) == (reference.max() + 1) * (one[1].max() + 1) * (run[1].max() + 1)
        if run is None and any(f[2] == LINE for f in found) and _digits(one[0]):
            run = one
        elif line or whole or one[0].sort != "column":
            line.append(one)
        else:
            fix = f'Say by which column: columns = {{ line = "{one[0].words}" }}'
            raise NotReadError("nothing says which lengths lie on one line", where=place, fix=fix)
    # else one length on each line, which are named and not counted
    line = line or [f for f in found if f[2] == LINE and not (several and _digits(f[0]))][:1]
    key = together(reference, *(f[1] for f in line))
    if apart() < count if run is not None else len({*Counter(key.tolist()).values()}) > 1:
        what = "lengths of one line and one run have the same nominal length"
        fix = 'Say what tells them apart: columns = { line = "…", repeat = "…" }'
        raise NotReadError(what, where=place, fix=fix)
    names = [" ".join(dict.fromkeys(parts)) for parts in zip(*(f[0].values for f in line), strict=True)]
    titles = [one for one in labels if one.sort == "title" and counted(one, lengths=True) == LINE]
    titled = [one.values[0] for one in labels if one.values[0] and (one.sort == "sheet" or one in titles)]
    numbers = in_turn(key) if run is None else numbered_runs(run[0].values)
    used = [f[0].words for f in (*line, *([run] if run else []))]
    return names or [titled[-1] if titled else "1"] * count, numbers, used


def _one_run(labels: Sequence[Label], runs: Sequence[Counted], place: str) -> Counted | None:
    """The label that counts runs; an error where two do, each in its own way."""
    if unnamed := [label.words for label in labels if label.sort == "unnamed"]:
        raise NotReadError("no line is named", where=unnamed[0], fix="Complete the row")
    run = min(runs, key=lambda f: f[1].max(), default=None)
    heads = next((len({*f[0].values}) for f in runs if f[0].sort == "head"), 0)
    counting = [one for one in labels if one.sort == "column" and _counting(one.values)]
    columns = [one.words for one in counting if hint(one.words, lengths=True) == RUN]
    if (heads and columns) or (run is not None and any(not fixes(run[1], f[1]) for f in runs)):
        what = f"{(columns or [runs[0][0].words])[0]!r} counts runs, and so do {heads or 'other'} columns"
        raise NotReadError(what, where=place, fix="Name one of them alone: columns")
    return run


def _digits(label: Label) -> bool:
    return all(value.strip().isdigit() for value in label.values)
