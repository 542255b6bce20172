"""What a certificate must keep to beyond the schema: lists of one length, square matrices, dates in order, ids."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from types import MappingProxyType
from typing import Any

from cmm_uq.jobs.dcc.administrative import CoreData
from cmm_uq.jobs.dcc.fields import Part
from cmm_uq.jobs.dcc.quantities import Box, Ellipsoid, Interval, RealList, Region
from cmm_uq.jobs.dcc.tree import Node

Problem = tuple[str, str]
"""What is wrong, and how to mend it."""


def problems_of(part: Part) -> Iterator[Problem]:
    """What is wrong with a part by itself."""
    check = _CHECKS.get(type(part))
    if check is not None:
        yield from check(part)


def ids_and_references(root: Node) -> Iterator[tuple[Node, Problem]]:
    """Ids that are there twice, and references to what is not there."""
    first: dict[str, Node] = {}
    for node in root.walk():
        own = node.attributes.get("id") if node.tag.startswith(("dcc:", "si:")) else None
        if own is not None and own in first:
            yield node, (f"id {own!r} is that of line {first[own].line} too", "Every id is there once")
        elif own is not None:
            first[own] = node
    for node in root.walk():
        for reference in node.attributes.get("refId", "").split() if node.tag.startswith("dcc:") else ():
            if reference not in first:
                yield node, (f"refId {reference!r} is the id of nothing", "Name an id of this certificate")


def _list(values: RealList) -> Iterator[Problem]:
    count = len(values.values)
    lengths: dict[str, int] = {"units": len(values.units), "labels": len(values.labels), "times": len(values.times)}
    uncertainty: Any = getattr(values.uncertainty, "stated", values.uncertainty)
    if uncertainty is not None:
        lengths.update({name: len(getattr(uncertainty, name)) for name in uncertainty.FIELDS})
    for name, length in lengths.items():
        if length not in (0, 1, count):
            yield f"{count} values have {length} {name}", "One for each, or one for all"
    if values.region is not None and len(values.region.columns) != count:
        yield f"{count} values have a covariance matrix of {len(values.region.columns)}", "A row and a column for each"


def _region(region: Region) -> Iterator[Problem]:
    columns = [[one.value for one in column.covariances] for column in region.columns]
    if any(len(column) != len(columns) for column in columns):
        yield "the covariance matrix is not square", "A row and a column for each value"
    elif columns != [list(row) for row in zip(*columns, strict=True)]:
        yield "the covariance matrix is not symmetric", "The covariance of two is the same both ways"


def _interval(interval: Interval) -> Iterator[Problem]:
    if interval.low > interval.high:
        yield f"the interval {interval.low} to {interval.high} is empty", "The lower end first"


def _core(core: CoreData) -> Iterator[Problem]:
    if core.begin > core.end:
        yield f"the measurement began on {core.begin} and ended on {core.end}", "The first day first"
    if missing := sorted(set(core.mandatory_languages) - set(core.languages)):
        yield f"the mandatory language {missing[0]!r} is not used", "Name it among the used ones"


_CHECKS: Mapping[type[Part], Callable[[Any], Iterator[Problem]]] = MappingProxyType({
    RealList: _list, Ellipsoid: _region, Box: _region, Interval: _interval, CoreData: _core,
})  # fmt: skip
