"""A DCC written: the same certificate gives the same bytes, and nothing is written that ``reading`` refuses."""

from __future__ import annotations

from typing import Any

from cmm_uq.base.errors import CmmUqError
from cmm_uq.jobs.dcc.certificate import Certificate
from cmm_uq.jobs.dcc.fields import Attribute, Child, Content, Element, Field, Simple, fields_of
from cmm_uq.jobs.dcc.reading import ROOT, ids_and_references, problems_of
from cmm_uq.jobs.dcc.tree import Node, serialised


def written(certificate: Certificate) -> bytes:
    root = Node(ROOT, {})
    root.attributes["xsi:schemaLocation"] = f"https://ptb.de/dcc https://ptb.de/dcc/v{certificate.version}/dcc.xsd"
    _fill(root, certificate)
    for node, (problem, fix) in ids_and_references(root):
        raise CmmUqError(problem, where=node.xpath, fix=fix)
    return serialised(root)


def _fill(node: Node, element: Element) -> None:
    for problem, fix in problems_of(element):
        raise CmmUqError(problem, where=node.xpath, fix=fix)
    for field in fields_of(type(element)):
        value, place = getattr(element, field.name), field.place
        if value is None or (value == () and not field.required):
            continue
        if isinstance(place, Attribute):
            node.attributes[place.tag] = _text(node, place.simple, value)
        elif isinstance(place, Content):
            node.text = _text(node, place.simple, value)
        elif isinstance(place, Child):
            _place(node, field, place, value if field.repeated else (value,))
        else:
            node.children += value


def _place(node: Node, field: Field, place: Child, values: tuple[Any, ...]) -> None:
    if not values:
        raise CmmUqError(f"{node.tag} has no {field.name}", where=node.xpath, fix="The schema asks for one")
    outer = _added(node, field.outer[0]) if place.within else node
    for value in values:
        if field.simple is not None:
            inner = _added(outer, next(iter(field.tags)))
            inner.text = _text(inner, field.simple, value)
        elif tag := next((tag for tag, cls in field.tags.items() if cls is type(value)), None):
            _fill(_added(outer, tag), value)
        else:
            problem, fix = f"{type(value).__name__} is no {field.name}", f"Known: {', '.join(field.tags)}"
            raise CmmUqError(problem, where=outer.xpath, fix=fix)


def _added(parent: Node, tag: str) -> Node:
    node = Node(tag, {}, parent=parent)
    parent.children.append(node)
    return node


def _text(node: Node, simple: Simple, value: Any) -> str:
    text = simple.write(value)
    try:
        valid = simple.read(text) == value
    except (ValueError, KeyError, OverflowError):
        valid = False
    if not valid:
        raise CmmUqError(f"{text[:60]!r} is not {simple.what}", where=node.xpath, fix="The schema of DCC asks for it")
    return text
