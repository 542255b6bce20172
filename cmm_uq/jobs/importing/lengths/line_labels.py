"""Which labels name lines and which count runs of lengths: by words, else by what tells all of them apart."""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Sequence

import numpy as np

from cmm_uq.base.points import Floats, Ints
from cmm_uq.jobs.importing import factors
from cmm_uq.jobs.importing.factors import LINE, POINT, RUN, Counted, Label, codes, counted, counting, fixes, hint
from cmm_uq.jobs.importing.format import NotReadError
from cmm_uq.jobs.importing.header import plain_words, words_of
from cmm_uq.jobs.importing.lengths.axis_runs import letter_in
from cmm_uq.jobs.importing.lengths.places import says_figures

_PLACED = re.compile(r"\w+ \([^()]*;[^()]*\)|^[XYZ] = \S+$", re.M)  # figures of columns of starts, ends and directions
_FEW = 4  # references that may differ by chance


def lengths_of(references: Floats) -> Ints:
    """A number for each length; of references that were measured anew in each row those near each other are of one."""
    own = codes([None if np.isnan(one) else one for one in references])
    if len(own) < _FEW or np.isnan(references).any():
        return own
    order = np.argsort(references)
    steps = np.diff(references[order]) > np.maximum(0.04, 0.002 * np.abs(references[order][1:]))
    near = np.empty(len(own), dtype=np.int64)
    near[order] = np.concatenate([[0], np.cumsum(steps)])
    again = {*np.bincount(own).tolist()}  # of one row each, with as many runs beside each other
    return near if len(again) == 1 and 2 * (near.max() + 1) <= own.max() + 1 else own


def lines_and_runs(
    labels: Sequence[Label], reference: Ints, place: str, stated: Sequence[str] = ()
) -> tuple[list[str], Ints, list[str]]:
    """Name of the line and number of the run of each length, and by what labels; ``stated``: what may say where it lies."""
    count, several, found = len(reference), bool(reference.max(initial=0) > 0), factors.varying(labels, lengths=True)
    of_lines = {f[0].sort for f in found if f[2] == LINE and not (several and fixes(reference, f[1]))}
    for k, (label, own, _) in enumerate(found if {"title", "column", "sheet"} & of_lines else ()):
        numbered = counting(label.values) and label.values[0][1:2].isdigit()
        numbered |= factors.counts_ways(label.values)
        numbered |= bool({"title", "sheet"} & of_lines) and all(value[-1:].isdigit() for value in label.values)
        if label.sort == "head" and numbered:
            found[k] = label, own, RUN  # M1, M2 are measurements of the line that is named, and so are H1, R1, H2, R2
    found = [(f[0], f[1], RUN if _measurements(f, found) else f[2]) for f in found]
    found = [(f[0], f[1], LINE if f[2] is None and _says_places(f[0]) else f[2]) for f in found]
    lying = codes([*map(str, map(_PLACED.findall, stated))]) if stated else reference
    found = [(f[0], f[1], LINE if stated and _is_of(f, lying) else f[2]) for f in found]
    above = [f for f in found if f[0].sort in ("title", "sheet", "block") and not fixes(f[1], reference)]
    # numbers of the lengths of each line, though they are called positions
    found = [(f[0], f[1], POINT) if f[0].sort == "column" and _counts_them(f, above, reference) else f for f in found]
    plain = [f for f in found if not (several and (fixes(reference, f[1]) or f[1].max() + 1 == count))]
    run = _one_run(labels, [f for f in plain if f[2] == RUN], place)
    line: list[Counted] = []
    called = [f for f in plain if f[2] == LINE]
    for one in sorted(called, key=lambda f: (several and fixes(f[1], reference), f[0].sort == "part", -f[1].max())):
        if not line or not fixes(factors.together(reference, *(f[1] for f in line)), one[1]):
            line.append(one)
    lined = any(f[2] == LINE for f in found)
    try:
        line, run = _told_apart(reference, [f for f in plain if f[2] in (None, POINT)], line, run, place, lined=lined)
    except NotReadError:
        each = factors.together(reference, lying, *([run[1]] if run else []))
        if called or not several or fixes(reference, lying) or each.max() + 1 < count:
            raise
        said = Label("", tuple(" ".join(_PLACED.findall(text)) for text in stated))
        line = [(said, lying, LINE)]  # by where it lies, or its direction, alone
    line = _of_rings(found, line)
    # else one length on each line, which are named and not counted
    line = line or [f for f in found if f[2] == LINE and not (several and _digits(f[0]))][:1]
    _refuse_unnamed(found, line)
    _refuse_lengths(reference, line, place)
    key = factors.together(reference, *(f[1] for f in line))
    each = key if run is None else factors.together(key, run[1])
    if each.max() + 1 < count if run is not None else len({*Counter(key.tolist()).values()}) > 1:
        what = "lengths of one line and one run have the same nominal length"
        fix = 'Say what tells them apart: columns = { line = "…", repeat = "…" }'
        raise NotReadError(what, where=place, fix=fix)
    if run is not None and counts_on(run[1], key):
        run = None  # a serial number, from line to line
    names = [" ".join(dict.fromkeys(parts)) for parts in zip(*(f[0].values for f in line), strict=True)]
    titles = [one for one in labels if one.sort == "title" and counted(one, lengths=True) == LINE]
    titled = [one.values[0] for one in labels if one.values[0] and (one.sort == "sheet" or one in titles)]
    numbers = factors.in_turn(key) if run is None else factors.numbered_runs(run[0].values)
    used = [f[0].words for f in (*line, *([run] if run else []))]
    return names or [titled[-1] if titled else "1"] * count, numbers, used


def counts_on(repeat: Ints, key: Ints) -> bool:
    """Whether numbers of repeats go on from one thing to the next: more than twice as many as anything was measured."""
    return len(np.unique(repeat)) > 2 * int(np.unique(key, return_counts=True)[1].max(initial=1))


def _of_rings(found: Sequence[Counted], line: list[Counted]) -> list[Counted]:
    """Labels of lines, with the one of rings: diameters of one ring lie about its centre, those of the next elsewhere."""
    rings = (
        f for f in found if f[0].sort == "column" and not words_of("rows")["rings"].isdisjoint(plain_words(f[0].words))
    )
    more = [f for f in rings if line and not fixes(factors.together(*(g[1] for g in line)), f[1])]
    return [*more[:1], *line]


def _measurements(one: Counted, others: Sequence[Counted]) -> bool:
    """Whether parts of names such as M1 and M2 count measurements, for something else that crosses them names the lines."""
    numbered = one[0].sort == "part" and all(value[:1] in "mM" and value[1:].isdigit() for value in one[0].values)
    lines = (f[1] for f in others if numbered and f[2] == LINE and len(f[0].values[0]) > len("M1"))
    return any(not fixes(own, one[1]) and not fixes(one[1], own) for own in lines)


def _says_places(label: Label) -> bool:
    """Whether titles or cells are of lines, for they say where one lies, or parts of names, for each says an axis."""
    values = {*label.values}
    if label.sort == "part":
        return len(axes := {*map(letter_in, values)}) > 1 and "" not in axes
    lettered = label.sort == "column" and len(values & {*"XYZ"}) > 1  # whatever the word above them
    return label.sort in ("title", "column") and (lettered or any(map(says_figures, values)))


def _is_of(one: Counted, lying: Ints) -> bool:
    """Whether each value of a column stands beside one place, and each place beside one value."""
    return one[2] != RUN and one[0].sort == "column" and fixes(one[1], lying) and fixes(lying, one[1])


def _counts_them(column: Counted, above: Sequence[Counted], reference: Ints) -> bool:
    """Whether a column numbers the lengths below each title, of lines where a word calls it a line itself."""
    label, own, of = column
    numbers = of == LINE or (of is None and _digits(label))
    titles = [f[1] for f in above if of is None or (f[2] == LINE and f[0].sort != "block")]
    return numbers and any(fixes(factors.together(one, own), reference) for one in titles)


def _refuse_unnamed(found: Sequence[Counted], line: Sequence[Counted]) -> None:
    """Titles and names of several lengths that are numbered, and whose word is not known, may be of lines."""
    pages = words_of("rows")["page"]
    for label, own, of in found if not line else ():
        shared = label.sort == "title" or (label.sort == "column" and not _digits(label) and 2 * own.max() < len(own))
        if shared and of is None and counting(label.values) and pages.isdisjoint(plain_words(label.values[0])):
            fix = 'Say so with a word for a line ahead of each number, as in "Line 1"'
            raise NotReadError(f"titles such as {label.values[0]!r} may name lines", fix=fix)


def _refuse_lengths(reference: Ints, line: Sequence[Counted], place: str) -> None:
    """Names of which each is of one length, while lengths are several, may be those of the lengths."""
    named = any(f[0].sort in ("part", "block") or f[2] is None for f in line)
    if named and reference.max() + 1 >= _FEW and fixes(factors.together(*(f[1] for f in line)), reference):
        fix = 'Write it as a table with a column "line" that names the line of each length'
        raise NotReadError(f"{line[0][0].values[0]!r} may name a length, and not a line", where=place, fix=fix)


def _told_apart(
    reference: Ints, others: Sequence[Counted], line: list[Counted], run: Counted | None, place: str, *, lined: bool
) -> tuple[list[Counted], Counted | None]:
    """Labels of lines and runs, with those that no word explains and that are needed to tell lengths apart."""
    count, rank = len(reference), {s: k for k, s in enumerate(("title", "sheet", "head", "block", "part", "column"))}

    def apart(*more: Ints) -> int:
        """How many of the lengths are told apart."""
        return int(factors.together(reference, *(f[1] for f in line), *([run[1]] if run else []), *more).max()) + 1

    def order(f: Counted) -> tuple[bool, bool, int, int]:
        return f[2] == POINT, run is not None and fixes(f[1], run[1]), rank[f[0].sort], int(f[1].max())

    columns = [f for f in others if f[0].sort == "column"]
    more = [g[1] for g in (*columns, *([run] if run else []))]  # which may say what another says, and more
    others = [f for f in others if f not in columns or not any(g.max() > f[1].max() and fixes(g, f[1]) for g in more)]
    named = [f for f in others if f[0].sort in ("column", "part") and not _digits(f[0])]
    for one in sorted(others, key=order):
        # whether it numbers lengths, each time that they were measured
        rows = bool(line) and _digits(one[0]) and reference.max() > 0 and fixes(one[1], reference)
        if rows or apart() == count or apart(one[1]) == apart():
            continue
        if one[0].sort == "part" and line and run is None:
            if {*one[0].values} <= {*"abcdefgh"}:
                fix = "Number runs in a column"
                raise NotReadError("letters in names may be of runs or lines", where=place, fix=fix)
            if one[2] is None and not _digits(one[0]) and _crossed(one, line):
                what = f"{one[0].values[0]!r} in names may count runs, or lines"
                fix = 'Say so with a word for a run ahead of each number, as in "Run 1"'
                raise NotReadError(what, where=place, fix=fix)
        whole = run is not None and apart(one[1]) == (reference.max() + 1) * (one[1].max() + 1) * (run[1].max() + 1)
        unsaid = any(f[2] is None for f in line) and one[2] is None and one[0].sort == "column"
        if run is None and (named or lined) and _digits(one[0]):
            run = one
        elif (
            (line and not (unsaid and run is None))
            or whole
            or (reference.max() == 0 and one[1].max() + 1 == count and not _digits(one[0]))  # a name for each
            or not (one[0].sort == "column" or (one[0].sort == "part" and _digits(one[0])))
        ):
            line.append(one)
        else:
            fix = f'Say by which column: columns = {{ line = "{one[0].words}" }}'
            raise NotReadError("nothing says which lengths lie on one line", where=place, fix=fix)
    return line, run


def _crossed(one: Counted, lines: Sequence[Counted]) -> bool:
    """Whether labels that are alike but for their number come again on all lines."""
    key = factors.together(*(f[1] for f in lines))
    pairs = int(factors.together(key, one[1]).max()) + 1
    return counting(one[0].values) and pairs == (int(key.max()) + 1) * (int(one[1].max()) + 1)


def _one_run(labels: Sequence[Label], runs: Sequence[Counted], place: str) -> Counted | None:
    """The label that counts runs; an error where two do, each in its own way."""
    if unnamed := [label.words for label in labels if label.sort == "unnamed"]:
        raise NotReadError("no line is named", where=unnamed[0], fix="Complete the row")
    run = min(runs, key=lambda f: f[1].max(), default=None)
    heads = next((len({*f[0].values}) for f in runs if f[0].sort == "head"), 0)
    columned = (one for one in labels if one.sort == "column" and any(map(str.isdigit, "".join(one.values))))
    numbering = [one for one in columned if counting(one.values)]
    columns = [one.words for one in numbering if hint(one.words, lengths=True) == RUN]
    if (heads and columns) or (run is not None and any(not fixes(run[1], f[1]) for f in runs)):
        what = f"{(columns or [runs[0][0].words])[0]!r} counts runs, and so do {heads or 'other'} columns"
        raise NotReadError(what, where=place, fix="Name one of them alone: columns")
    return run


def _digits(label: Label) -> bool:
    return all(value.strip().isdigit() for value in label.values)
