"""What labels count: lines and runs of lengths; of places see :mod:`~cmm_uq.jobs.importing.grouping`.

A label is a column of names or numbers, a title, a head above a column, a sheet, or a part of a name (``POS1_BALL2_M3``).
Words say what most of them count; figures say the rest: what differs where the same length is met again is a repeat, what the
nominal length fixes counts lengths. Nothing is taken where two observations would be one.
"""

from __future__ import annotations

import re
import unicodedata
from collections import Counter
from collections.abc import Collection, Sequence
from functools import lru_cache
from itertools import pairwise

import numpy as np

from cmm_uq.base.points import Ints
from cmm_uq.base.values import dataclass
from cmm_uq.jobs.importing.header import plain_words, unspaced, words_of

LINE, RUN, POINT = "line", "run", "point"
_MARKS = {"+": 1, "-": -1, "−": -1, "↑": 1, "↓": -1, "→": 1, "←": -1}
# first letters of words for both senses, forward first: in English, German, French and Italian, Spanish
_PAIRS = tuple({forward: 1, back: -1} for forward, back in ("FB", "FR", "VR", "HR", "AR", "IV"))
_TOKEN = re.compile(r"[^\W_]+")
_GLUED = re.compile(r"(?<=\d)(?=[^\W\d_])|(?<=[^\W\d_])(?=\d)")
_PAIRED = re.compile(r"(?<=[^\W\d_]\d)(?=[^\W\d_]\d)")  # as in L1R1_P2
_SHORTENED = re.compile(r"[^\W\d_]{3,}(?=\.)")
_DATED = 8  # digits of a date
_CAMEL = re.compile(r"(?<=[a-zäöüéèà])(?=[A-Z])")
_COUNTED = re.compile(r"[^\W\d_\u3040-\u9fff\uac00-\ud7a3]+|[\u3040-\u9fff\uac00-\ud7a3]+|\d+")
_NEXT = re.compile(r"\W{0,3}|_|\W{0,2}n(?:o|r)?\W{1,2}|\W?no\W?", re.IGNORECASE)  # between a word and its number
_BEFORE = re.compile(r"(?<![\d.,])第?(\d+)\s?(?:[.ªº°]|st|nd|rd|th|er|e|ère)?\s?$", re.IGNORECASE)
_OF_ALL = re.compile(r"\s?(?:/|\b(?:of|von|de|di|sur|van|av|z|из)\b)\s?\d+")
_OF_SEVERAL = re.compile(r"(?<![\d.,/])(\d{1,2})\s?(?:/|\b(?:of|von|de|di|sur|van|av|z|из)\b)\s?(\d{1,2})(?![\d.,/])")
_DATE = re.compile(r"\b\d{1,4}([./-])\d{1,2}\1\d{2,4}\b|\b\d{1,2}:\d\d(?::\d\d)?\b")
_PRINTED = re.compile(r"[.,:]\d")
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
    last = {value: value[-1:] if value[-2:-1] == " " else "" for value in {*values}}  # as of ``Run 1 F``
    for letters in ({value: re.sub(r"[\d\W]", "", value).upper() for value in last}, last):
        if (pair := next((own for own in _PAIRS if {*own} == {*letters.values()}), None)) is not None:
            return [pair[letters[value]] for value in values]
    known = {value: way_of(value) for value in {*values}}
    first, *others = known.values()
    if len(others) == 1 and not first * others[0]:  # of two the one says the other
        known = {value: way or -(first + others[0]) for value, way in known.items()}
    return [known[value] for value in values] if {*known.values()} == {1, -1} else None


@lru_cache(maxsize=4096)
def way_of(value: str) -> int:
    """Sense of travel that a label names; 0 where it names none."""
    text = value.strip(" ()[]").replace("->", "→").replace("<-", "←")
    words, short = plain_words(text), plain_words(" ".join(_SHORTENED.findall(text)))
    own = {_MARKS[c] for c in text if c in "↑↓→←"}
    ends = (text[-1:], text[:1] if not text[1:2].isdigit() else "")
    own |= set() if own else {_MARKS[c] for c in ends if c in _MARKS}
    for name, sense in (("forward", 1), ("backward", -1)):
        asian = [one for one in words_of("ways")[name] if len(one) > 1 and unspaced(one)]
        known = words_of("ways")[name]
        begun = any(one.startswith(word) for word in short for one in known)
        if begun or any(word in known or any(one in word for one in asian) for word in words):
            own.add(sense)
    return own.pop() if len(own) == 1 else 0


def senses(labels: Sequence[Label], targets: Sequence[float]) -> list[int] | None:
    """Sense of travel by the label that names both as often at nearly each target, else whose targets rise and fall."""
    letters = (label.values for label in labels if label.sort == "column" and not any(map(str.isdigit, label.values)))
    for own in (*map(ways_of, (label.values for label in labels)), *(_turns(values, targets) for values in letters)):
        if own is not None:
            both = Counter[float]()
            for target, way in zip(targets, own, strict=True):
                both[target] += way
            few = max(map(abs, both.values())) < 2  # one of them left out
            if sum(n == 0 for n in both.values()) >= (0.5 if few else 0.8) * len(both):
                return own
    return None


def _turns(values: Sequence[str], targets: Sequence[float]) -> list[int] | None:
    """Sense of travel where the targets of the one label rise in turn and those of the other fall."""
    steps: dict[str, set[bool | None]] = {value: set() for value in values}
    for k, (value, after) in enumerate(pairwise(values)):
        if value == after:
            steps[value].add(targets[k] < targets[k + 1] if targets[k] != targets[k + 1] else None)
    rises = sorted(map(list, steps.values()), key=str)
    return [1 if True in steps[value] else -1 for value in values] if rises == [[False], [True]] else None


def counted(label: Label, *, lengths: bool) -> str | None:
    """What a label counts, by the words above it, else by those in it; nothing where these are verdicts."""
    if {" ".join(plain_words(value)) for value in {*label.values}} <= words_of("rows")["summary"]:
        return None
    if label.sort == "column" and counting(label.values) and hint(label.values[0], lengths=lengths) == RUN:
        return RUN  # below the head of what stands beside, as of directions
    if label.sort == "column" and (of := hint(label.words, lengths=lengths)) and (of != RUN or counting(label.values)):
        return of
    if label.sort == "title" and not label.words:
        every = {hint(value, lengths=lengths) for value in {*label.values}}
        return _counting_title(label, every.pop() if len(every) == 1 else None)
    if label.sort == "part" and {*label.values} <= LETTERS:
        return POINT
    words = (label.words, label.values[0]) if label.sort in ("title", "part") else label.values[:1]
    found = next((found for text in words if (found := hint(text, lengths=lengths))), None)
    alike = label.sort == "head" and counting(label.values)
    return RUN if alike and found not in (LINE, POINT) else _counting_title(label, found)


def _counting_title(label: Label, of: str | None) -> str | None:
    """What a label counts; a title, or a part of one, runs only by numbers."""
    numbered = of != RUN or (counting(label.values) and all("0" in numberless(value) for value in label.values))
    return of if label.sort not in ("title", "part") or numbered else None


def counting(values: Sequence[str]) -> bool:
    """Whether labels are alike but for their number."""
    return len({*map(numberless, values)}) == 1


def states_of(values: Collection[str]) -> set[str]:
    """States of the machine that labels name: as it was found, and as it was left."""
    plain = {f" {' '.join(word for word in plain_words(value) if not word.isdigit())} " for value in values}
    return {
        of for of, words in words_of("states").items() if any(f" {one} " in text for one in words for text in plain)
    }


def counts_ways(values: Sequence[str]) -> bool:
    """Whether labels are of runs there and back, each a word for its sense and perhaps a number, as ``Hin 1``."""
    return len({*map(way_of, values)} - {0}) == 2 and all(way_of(v) and len(plain_words(v)) < 3 for v in values)


def numberless(text: str) -> str:
    """A text with one figure for each number, of whatever form, as I, II and IV."""
    return re.sub(r"\d+|\b(?:I{1,3}|IV|VI{1,3}|IX)\b", "0", unicodedata.normalize("NFKC", text))


@lru_cache(maxsize=16_384)
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
        for one in (those if unspaced(word) else those & {word})
        if one == word or (len(one) > 1 and unspaced(one) and word.endswith(one))  # what is meant stands last
    ]
    exact = [fit for fit in fits if fit[0] == int(fit[0])]
    if fits:
        return max(exact, key=lambda fit: fit[1])[2] if exact else max(fits)[2]
    return _SHORT.get(words[0]) if words and all(word.isdigit() for word in words[1:]) else None


@lru_cache(maxsize=16_384)
def says_of(text: str, *tables: str) -> bool:
    """Whether a text says that deviations along an axis are angles, or something else of ``words.toml``."""
    known = [word for table in tables or ("unit", "motion", "motion_axes") for word in words_of("angles")[table]]
    plain = f" {' '.join(plain_words(text))} ".replace(" pitch error table ", " ").replace(" pitch error comp", " ")
    return any(f" {word} " in plain or (unspaced(word) and word in plain) for word in known)


def parts_of(label: Label) -> list[Label]:
    """The parts of names that are alike but for words and numbers; else what is ahead of a last number, and that number."""
    paired = all(_PAIRED.search(value) for value in label.values) and len(_TOKEN.findall(label.values[0])) > 1
    first = (lambda value: _PAIRED.sub(" ", value)) if paired else str
    for cut in (first, lambda value: _CAMEL.sub(" ", _GLUED.sub(" ", value))):
        if len(_TOKEN.findall(cut(label.values[0]))) < 2:
            continue
        names = tuple(map(cut, label.values))
        tokens = [[(m[0], *m.span()) for m in _TOKEN.finditer(name)] for name in names]
        found: list[Label] = []
        if len({*map(len, tokens)}) > 1:
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
        if len(found) > 1 or (found and cut is not first and found[0].values != label.values):
            return found
    last = [m for value in label.values if (m := re.fullmatch(r"(.*?[^\W\d_]*)[\W_]*(\d+)(\D*)", value))]
    if len(last) < len(label.values):
        return []
    after = len({m[3] for m in last}) > 1  # as ``Length 25 X axis``
    names = tuple(f"{m[1]}{m[3]}" if after else m[1] for m in last)
    return [Label(label.words, names, "part"), Label(label.words, tuple(m[2] for m in last), "part")]


def run_apart(label: Label, *, lengths: bool) -> list[Label]:
    """What texts name, and the number of the run that all of them say beside it, as ``Position 2, run 1 of 3``."""
    if label.sort == "column" and any(map(_counts_run, heads := _TOKEN.findall(label.words))) and len(heads) > 1:
        cells = [_TOKEN.findall(value) for value in label.values]  # each word of the head over a part, as ``Pos/Rep``
        if {*map(len, cells)} == {len(heads)}:
            each = zip(heads, zip(*cells, strict=True), strict=True)
            return [Label(word, tuple(own), "column") for word, own in each]
    found = [one for value in label.values if (one := _run_in(value))]
    if not found:
        several = [(value, m) for value in label.values if (m := _OF_SEVERAL.search(value))]
        found = [("run", _without(value, *m.span()), m[1]) for value, m in several]
        names, counts = ({own[k] for own in found} for k in (1, 2))
        if len({*found}) < len(names) * len(counts) or any(len(counts) != int(m[2]) for _, m in several):
            return []  # not each of 1/3, 2/3 and 3/3 of each name
    word, rest, numbers = zip(*found, strict=True) if len(found) == len(label.values) else ((), (), ())
    if not all(rest) or len({*rest}) < 2:
        return []
    if not lengths and hint(word[0], lengths=False) == LINE and hint(rest[0], lengths=True) != LINE:
        return []  # as measurements of balls are no runs
    named = Label("" if _counts_run(label.words) else label.words, rest, label.sort)
    names_, runs = codes(rest), codes(numbers)
    if fixes(names_, runs) and fixes(runs, names_):
        return [named]
    # what names each run anew, as the file of each does, is no line
    return [*(parts_of(named) if fixes(names_, runs) else [named]), Label("run", numbers, "part")]


@lru_cache(maxsize=4096)
def _run_in(text: str) -> tuple[str, str, str] | None:
    """The word for a run in a text, what else it says, and the number of the run; ``None`` where it has none."""
    text = _DATE.sub(" ", unicodedata.normalize("NFKC", text))
    own = [*_COUNTED.finditer(text)]
    for k, word in enumerate(own):
        if word[0].isdigit() or word[0] == "第" or (len(word[0]) < len("run") and not unspaced(word[0])):
            continue
        measured = not {*plain_words(word[0])}.isdisjoint(words_of("columns")["measurement"])
        if _counts_run(word[0]) or (measured and hint(word[0], lengths=True) != LINE):
            after = next((m for m in own[k + 1 : k + 3] if m[0].isdigit()), None)
            if after and _NEXT.fullmatch(text[word.end() : after.start()]) and not _PRINTED.match(text, after.end()):
                end = after.end() + (m.end() if (m := _OF_ALL.match(text[after.end() :])) else 0)
                return word[0], _without(text, word.start(), end), after[0]
            if (before := _BEFORE.search(text[: word.start()])) is not None:
                return word[0], _without(text, before.start(), word.end()), before[1]
    return None


def _counts_run(word: str) -> bool:
    return hint(word, lengths=True) == RUN


def _without(text: str, start: int, end: int) -> str:
    rest = re.sub(r"[(\[【]\W*[)\]】]", " ", f"{text[:start]} {text[end:]}")
    return re.sub(r"^[^\w+(\[]+|[^\w+)\]-]+$|\s-+$", "", " ".join(rest.split()))


def _halves(label: Label) -> list[Label]:
    """A part such as ``1A`` or ``A1`` as its number and its letter."""
    for form in (r"(.*\d)([A-Za-z])", r"([A-Za-z])(\d+)"):
        if not re.fullmatch(form, label.values[0]):
            continue
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
    return len(np.unique(a * (int(b.max(initial=0)) + 1) + b)) == len(np.unique(a))


def together(first: Ints, *others: Ints) -> Ints:
    """A number for each of the values that there are together."""
    for one in others:
        first = np.unique(first * (int(one.max(initial=0)) + 1) + one, return_inverse=True)[1].astype(np.int64)
    return first


def varying(labels: Sequence[Label], *, lengths: bool) -> list[Counted]:
    """Labels, and parts of names, that differ and are there for all, without those that say the same again."""
    seen: dict[bytes, Counted] = {}
    every = list[Label]()
    for label in labels:
        split = run_apart(label, lengths=lengths) if label.sort in ("column", "head", "title", "sheet") else []
        every += split or [label]
    names = (label for label in every if label.sort in ("column", "head", "title") and len({*label.values}) > 1)
    names = (label for label in names if not all(map(str.isdecimal, label.values)))
    for label in (*every, *(part for name in names for part in parts_of(name))):
        own = codes(label.values)
        if own.max(initial=0) and "" not in label.values:
            of, (first, _, known) = counted(label, lengths=lengths), seen.get(own.tobytes(), (label, own, ""))
            plain = lengths and first.values[0].isdecimal() > label.values[0].isdecimal()
            better = known == "" or (known is None and (of is not None or plain))
            better |= label.sort == "head" and of == LINE and counting(first.values)
            if better or (known == POINT and label.sort == "column" and hint(label.words, lengths=lengths) == LINE):
                seen[own.tobytes()] = label, own, of
    found = [*seen.values()]
    if not lengths and any(f[2] == LINE and counted(f[0], lengths=True) == LINE for f in found):
        # beside placements measurements are runs
        found = [(f[0], f[1], RUN if f[2] == LINE and counted(f[0], lengths=True) != LINE else f[2]) for f in found]
    return found


def in_turn(key: Ints) -> Ints:
    """1, 2, … of each key."""
    seen: Counter[int] = Counter()
    out = []
    for one in key.tolist():
        seen[one] += 1
        out.append(seen[one])
    return np.array(out, dtype=np.int64)


def numbered_runs(values: Sequence[str]) -> Ints:
    """Numbers of runs: those that their labels have, else as they come, as of dates."""
    numbers = [re.findall(r"\d+", value) for value in values]
    plain = all(len(one) == 1 and len(one[0]) < _DATED for one in numbers)
    if plain and len({*values}) == len({one[0] for one in numbers}):
        return np.array([int(one[0]) for one in numbers])
    return codes(values) + 1


def counts_pages(text: str) -> bool:
    words = plain_words(text)
    return any(a in words_of("rows")["page"] and b.isdigit() for a, b in pairwise(words))


def begun(word: str) -> str:
    """How a title begins; all letters of axes alike."""
    return "x" if len(word) == 1 and word.isascii() else re.sub(r"^[xyz](?=[^\x00-\x7f])", "x", word.casefold())


def says_role(cell: object) -> bool:
    """Whether words call a column measured, a reference, nominal or a deviation."""
    words, of = {*plain_words(str(cell))}, words_of("lengths")
    return any(not words.isdisjoint(of[role]) for role in ("measured", "reference", "nominal", "deviation"))
