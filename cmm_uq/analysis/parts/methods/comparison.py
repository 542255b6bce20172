"""Methods beside each other: their figures, Eₙ between their values, and why they differ, as far as figures say it."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from itertools import combinations
from math import hypot, sqrt

from scipy.special import gammaincinv

from cmm_uq.analysis.parts.budget import VarianceShares
from cmm_uq.analysis.parts.in_words import FAMILIES, family_of
from cmm_uq.analysis.parts.methods.method import (
    ComparedCharacteristic,
    Method,
    MethodComparison,
    MethodFigure,
    MethodPair,
    MethodResult,
    MethodStatement,
    Seen,
)
from cmm_uq.analysis.parts.result import StatedCharacteristic
from cmm_uq.base.messages import Text, Verbatim, listed, number, say
from cmm_uq.base.units import ARCSECOND, MICROMETRE, unit
from cmm_uq.maths.uncertainty.quantity import significant

MATTERS = 0.05  # share of the variance from which on a cause is told by name
CHANCE = 0.05  # probability at which a scatter counts as another than the one that is expected
NEAR = 3.0  # scatters below which a zone counts as nearly nothing

METHODS: Mapping[Method, Text] = {
    "virtual": say("the virtual measurements"), "calibrated_part": say("the calibrated part"),
    "orientations": say("several orientations"),
}  # fmt: skip


def compare_methods(
    stated: Sequence[StatedCharacteristic], shares: VarianceShares, methods: Sequence[MethodResult]
) -> MethodComparison | None:
    """Other methods beside the virtual measurement; ``None`` where there are none."""
    if not methods:
        return None
    found = []
    for one in stated:
        figures = [(other, figure) for other in methods if (figure := other.of(one.name)) is not None]
        if not figures:
            continue
        virtual = MethodStatement("virtual", one.value, one.u, one.U, one.error)
        all_stated = (
            virtual,
            *(MethodStatement(other.method, figure.value, figure.u, figure.U) for other, figure in figures),
        )
        pairs = tuple(_pairs(all_stated))
        by_family = family_shares(shares, one.name)
        why = [words for other, figure in figures for words in _why(virtual, other, figure, by_family)]
        why += [_apart(pair) for pair in pairs if abs(pair.normalised) > 1]
        found.append(ComparedCharacteristic(one.name, all_stated, pairs, tuple(why)))
    return MethodComparison(tuple(methods), tuple(found))


def family_shares(shares: VarianceShares, name: str) -> dict[str, float]:
    """Share of the variance of a characteristic by family of causes; they add up to one."""
    column = shares.characteristics.index(name)
    found: dict[str, float] = {}
    for line, share in zip(shares.causes, shares.total[:, column].clip(0).tolist(), strict=True):
        found[family_of(line)] = found.get(family_of(line), 0.0) + share
    whole = sum(found.values())
    return {family: share / whole for family, share in found.items()} if whole else {}


def _pairs(stated: Sequence[MethodStatement]) -> Iterable[MethodPair]:
    for one, other in combinations(stated, 2):
        expanded = hypot(one.U, other.U)
        if one.value is not None and other.value is not None and expanded:
            yield MethodPair(one.method, other.method, (one.value - other.value) / expanded)


def _why(
    virtual: MethodStatement, method: MethodResult, figure: MethodFigure, shares: Mapping[str, float]
) -> Iterable[Text]:
    """Sentences on why one method's uncertainty is another than the virtual measurement's."""
    if not virtual.u:
        return
    name = METHODS[method.method]
    grouped = _grouped(method.seen, shares)
    yield say("By {method} u is {ratio} times that of the virtual measurements.", method=name,
              ratio=number(figure.u / virtual.u, ".2f"))  # fmt: skip
    if figure.single is not None and figure.single > figure.u:
        yield say("That is u of the mean of all its measurements; one of them alone would have {single}.",
                  single=small(figure.single, angle=figure.angle))  # fmt: skip
    bias = abs((figure.systematic or 0.0) - virtual.error)
    if bias > virtual.U and method.method == "calibrated_part":
        yield say("Its systematic error differs from the mean error of the virtual measurements by {bias}, more than their U: "
                  "the machine is not as its certificate states it, or the calibrated value is wrong.",
                  bias=small(bias, angle=figure.angle))  # fmt: skip
    for seen, words in (("unseen", _unseen), ("systematic", _systematic), ("corrected", _corrected)):
        if (share := sum(grouped.get(seen, {}).values())) >= MATTERS:
            yield words(name, _named(grouped[seen]), _percent(share), figure)
    yield from _zone(name, method, figure)
    yield from _scatter(name, virtual, figure, sum(grouped.get("varied", {}).values()))


def _zone(name: Text, method: MethodResult, figure: MethodFigure) -> Iterable[Text]:
    """What errors do to the width of a zone, which is a size without direction."""
    if not figure.zone:
        return
    if method.method == "calibrated_part":
        if abs(figure.systematic or 0.0) > figure.u:
            yield say("{name} is the width of a zone: its systematic error is that of a part which deviates as the calibrated "
                      "part does, in size and direction, and is wrong for another.", name=Verbatim(figure.name))  # fmt: skip
    elif figure.value is not None and figure.value < NEAR * figure.scatter:
        yield say("{name} is the width of a zone and nearly nothing: errors make it larger on average, by a part of its "
                  "scatter that {method} does not take off.", name=Verbatim(figure.name), method=name)  # fmt: skip


def _grouped(seen: Mapping[str, Seen], shares: Mapping[str, float]) -> dict[str, dict[str, float]]:
    """Shares by how a method takes hold of them, then by family."""
    found: dict[str, dict[str, float]] = {}
    for family, share in shares.items():
        found.setdefault(seen.get(family, "unseen"), {})[family] = share
    return found


def _named(families: Mapping[str, float]) -> Text:
    """Families that matter, the largest first; the largest alone where only all together do."""
    order = sorted(families, key=lambda family: -families[family])
    kept = [family for family in order if families[family] >= MATTERS] or order[:1]
    return listed([say("{family:small}", family=FAMILIES[family]) for family in kept])


def _unseen(name: Text, families: Text, share: Text, figure: MethodFigure) -> Text:
    return say("{method:capital} does not show {families}: {share} % of the variance of the virtual measurements.",
               method=name, families=families, share=share)  # fmt: skip


def _systematic(name: Text, families: Text, share: Text, figure: MethodFigure) -> Text:
    bias = small(abs(figure.systematic or 0.0), angle=figure.angle)
    told = say(
        "{method:capital} has {families}, {share} % of the variance of the virtual measurements, in its systematic error of "
        "{bias}, which is the same in all repeats and holds for this place and this strategy alone.",
        families=families, share=share, method=name, bias=bias,
    )  # fmt: skip
    return told if figure.corrected else say("{told} It is not corrected, and is added to U.", told=told)


def _corrected(name: Text, families: Text, share: Text, figure: MethodFigure) -> Text:
    return say(
        "Standards correct {method} for {families}, {share} % of the variance of the virtual measurements: by {bias}.",
        families=families, share=share, method=name,
        bias=small(abs(figure.systematic or 0.0), angle=figure.angle),
    )  # fmt: skip


def _scatter(name: Text, virtual: MethodStatement, figure: MethodFigure, share: float) -> Iterable[Text]:
    """What scattered, beside what the virtual measurement expects to scatter."""
    expected = sqrt(share) * virtual.u
    if share < MATTERS or not expected:
        return
    ratio, dof = (figure.scatter / expected) ** 2, figure.scatter_dof
    tails = CHANCE / 2, 1 - CHANCE / 2
    low, high = (2 * float(gammaincinv(0.5 * dof, tail)) / dof for tail in tails)  # quantiles of χ² over its mean
    told = say("What varied between its measurements would scatter by {expected} by the virtual measurements; it scattered by "
               "{seen}",
               expected=small(expected, angle=figure.angle), seen=small(figure.scatter, angle=figure.angle))  # fmt: skip
    if ratio > high:
        yield say(
            "{told}, more than chance explains: something acts that the virtual measurements do not know.", told=told
        )
    elif ratio < low:
        yield say(
            "{told}, less than chance explains: some of it stays the same in all repeats, or the virtual "
            "measurements are cautious.",
            told=told,
        )
    else:
        yield say("{told}, which chance explains.", told=told)


def _apart(pair: MethodPair) -> Text:
    return say(
        "{one:capital} and {other} differ by more than their uncertainties allow (Eₙ = {value}): one of them leaves "
        "something out.",
        one=METHODS[pair.one], other=METHODS[pair.other], value=number(abs(pair.normalised), ".2f"),
    )  # fmt: skip


def small(value: float, *, angle: bool) -> Text:
    """A small length in µm, or a small angle in seconds."""
    if angle:
        return say("{value}{unit}", value=significant(value / ARCSECOND), unit=unit("″"))
    return say("{value} {unit}", value=significant(value / MICROMETRE), unit=unit("µm"))


def _percent(share: float) -> Text:
    return number(100 * share, ".0f")
