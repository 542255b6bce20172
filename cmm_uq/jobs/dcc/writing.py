"""A DCC written: the same certificate gives the same bytes, and nothing is written that ``reading`` refuses."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from cmm_uq.base.errors import CmmUqError
from cmm_uq.jobs.dcc.certificate import Certificate
from cmm_uq.jobs.dcc.fields import Attribute, Choice, Content, Element, Field, ForeignElements, Many, Simple, fields_of
from cmm_uq.jobs.dcc.reading import ROOT, ids_and_references, problems_of
from cmm_uq.jobs.dcc.tree import Node, serialised


def written(certificate: Certificate) -> bytes:
    root = Node(ROOT, {})
    version = certificate.version
    root.attributes["xsi:schemaLocation"] = f"https://ptb.de/dcc https://ptb.de/dcc/v{version}/dcc.xsd"
    _fill(root, certificate)
    for node, (problem, fix) in ids_and_references(root):
        raise CmmUqError(problem, where=node.xpath, fix=fix)
    return serialised(root)


def _fill(node: Node, value: Element) -> None:
    for problem, fix in problems_of(value):
        raise CmmUqError(problem, where=node.xpath, fix=fix)
    for field in fields_of(type(value)):
        found = getattr(value, field.name)
        if found is None or (found == () and not field.required):
            continue
        _place(node, field, found)


def _place(node: Node, field: Field, found: Any) -> None:
    place = field.place
    if isinstance(place, Attribute):
        node.attributes[place.tag] = _text(node, place.simple, found)
    elif isinstance(place, Content):
        node.text = _text(node, place.simple, found)
    elif isinstance(place, ForeignElements):
        node.children += found
    else:
        values: Sequence[Any] = found if field.repeated else (found,)
        if not values:
            raise CmmUqError(f"{node.tag} has no {field.name}", where=node.xpath, fix="The schema asks for one")
        outer = _added(node, field.outer[0]) if isinstance(place, Many) and place.within else node
        for value in values:
            _element(outer, field, value)


def _element(parent: Node, field: Field, value: Any) -> None:
    place = field.place
    simple = None if isinstance(place, Choice | Attribute | Content | ForeignElements) else place.simple
    if simple is not None:
        node = _added(parent, next(iter(field.tags)))
        node.text = _text(node, simple, value)
        return
    tag = next((tag for tag, cls in field.tags.items() if cls is type(value)), None)
    if tag is None:
        raise CmmUqError(
            f"{type(value).__name__} is no {field.name}", where=parent.xpath, fix=f"Known: {', '.join(field.tags)}"
        )
    _fill(_added(parent, tag), value)


def _added(parent: Node, tag: str) -> Node:
    node = Node(tag, {}, parent=parent)
    parent.children.append(node)
    return node


def _text(node: Node, simple: Simple, value: Any) -> str:
    text = simple.write(value)
    try:
        kept = simple.read(text) == value
    except (ValueError, KeyError, OverflowError):
        kept = False
    if not kept:
        raise CmmUqError(f"{text[:60]!r} is not {simple.what}", where=node.xpath, fix="The schema of DCC asks for it")
    return text
