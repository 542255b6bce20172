"""A DCC read and written: every element is of the schema, in its order and of its type; what is not is told with its place.

Beyond the schema: lists of one length, square matrices, dates in order, ids. Of schema 3.2.1 everything is read. Of other
versions 3, what they have beyond it is left out; :func:`unread` lists it. A second opinion gives the XML schema of PTB, by the
xmlschema package, where a folder has it: it is not part of this package (LGPL).
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator, Mapping, Sequence
from functools import cache
from itertools import islice
from pathlib import Path
from typing import Any, cast

from cmm_uq.base.errors import CmmUqError, Gathered, suggestion
from cmm_uq.jobs.dcc.certificate import CLASSES, VERSION, Certificate, Element, Field, Simple
from cmm_uq.jobs.dcc.tree import NAMESPACES, Node, parsed, serialised

Problem = tuple[str, str]  # what is wrong, and how to mend it
ROOT = "dcc:digitalCalibrationCertificate"
_IGNORED = ("xsi:schemaLocation", "xsi:noNamespaceSchemaLocation", "xsi:type")


def ids_and_references(root: Node) -> Iterator[tuple[Node, Problem]]:
    """Ids that are there twice, and references to what is not there."""
    first: dict[str, Node] = {}
    for node in root.walk():
        name = node.attributes.get("id") if node.tag.startswith(("dcc:", "si:")) else None
        if name is not None and first.setdefault(name, node) is not node:
            yield node, (f"id {name!r} is that of line {first[name].line} too", "Every id is there once")
    for node in root.walk():
        for reference in node.attributes.get("refId", "").split() if node.tag.startswith("dcc:") else ():
            if reference not in first:
                yield node, (f"refId {reference!r} is the id of nothing", "Name an id of this certificate")


def _list(values: Element) -> Iterator[Problem]:
    count = len(values.values)
    lists: dict[str, Any] = {"units": values.units, "labels": values.labels, "times": values.times}
    lists |= getattr(getattr(values.uncertainty, "stated", values.uncertainty), "__dict__", {})
    for name, entries in lists.items():
        if len(entries) not in (0, 1, count):
            yield f"{count} values have {len(entries)} {name}", "One for each, or one for all"
    if values.region is not None and len(values.region.columns) != count:
        yield f"{count} values have a covariance matrix of {len(values.region.columns)}", "A row and a column for each"


def _region(region: Element) -> Iterator[Problem]:
    columns = [[one.value for one in column.covariances] for column in region.columns]
    if any(len(column) != len(columns) for column in columns):
        yield "the covariance matrix is not square", "A row and a column for each value"
    elif columns != [list(row) for row in zip(*columns, strict=True)]:
        yield "the covariance matrix is not symmetric", "The covariance of two is the same both ways"


def _interval(interval: Element) -> Iterator[Problem]:
    if interval.low > interval.high:
        yield f"the interval {interval.low} to {interval.high} is empty", "The lower end first"


def _core(core: Element) -> Iterator[Problem]:
    if core.begin > core.end:
        yield f"the measurement began on {core.begin} and ended on {core.end}", "The first day first"
    if missing := sorted(set(core.mandatory_languages) - set(core.languages)):
        yield f"the mandatory language {missing[0]!r} is not used", "Name it among the used ones"


_CHECKS: Mapping[str, Callable[[Element], Iterator[Problem]]] = {
    "RealList": _list, "EllipsoidalRegion": _region, "RectangularRegion": _region, "Interval": _interval, "CoreData": _core,
}  # fmt: skip
"""What is wrong with a part by itself."""


def read(data: bytes, where: str) -> Certificate:
    root = _root(data, where)
    reader = _Reader(where, strict=root.attributes.get("schemaVersion") == VERSION)
    certificate = reader.read(root, Certificate)
    for node, (problem, fix) in ids_and_references(root):
        reader.wrong(node, problem, fix)
    reader.gathered.refuse()
    return certificate


def unread(data: bytes, where: str) -> tuple[str, ...]:
    """XPaths of what a certificate of another version of the schema has, and is left out by :func:`read`."""
    reader = _Reader(where, strict=False)
    reader.read(_root(data, where), Certificate)
    reader.gathered.refuse()
    return tuple(reader.unread)


def _root(data: bytes, where: str) -> Node:
    root = parsed(data, where)
    if root.tag != ROOT:
        problem = f"is no DCC: its root is {root.tag}"
        raise CmmUqError(problem, where=f"{where}, line {root.line}", fix=f"A DCC is a {ROOT}")
    return root


class _Reader:
    """Reads classes from elements; what is wrong is gathered."""

    def __init__(self, where: str, *, strict: bool) -> None:
        self.where, self.strict = where, strict
        self.gathered, self.problems = Gathered(), 0
        self.unread: list[str] = []

    def wrong(self, node: Node, problem: str, fix: str) -> None:
        self.problems += 1
        self.gathered.tell(problem, where=f"{self.where}, line {node.line}, {node.xpath}", fix=fix)

    def read(self, node: Node, cls: type[Element]) -> Any:
        """An element as a class; None where something of it is wrong."""
        before, children = self.problems, self._sorted(node, cls)
        self._attributes(node, cls)
        values = {name: self._value(node, field, children[name]) for name, field in cls.FIELDS.items()}
        if self.problems > before:
            return None
        part = cls(**{name: value for name, value in values.items() if value is not None})
        for problem, fix in _CHECKS[cls.__name__](part) if cls.__name__ in _CHECKS else ():
            self.wrong(node, problem, fix)
        return part

    def _sorted(self, node: Node, cls: type[Element]) -> dict[str, list[Node]]:
        """Children by the field that they belong to, in the order of the schema."""
        places = {tag: name for name, field in cls.FIELDS.items() for tag in field.outer}
        foreign = next((name for name, field in cls.FIELDS.items() if field.kind == "foreign"), None)
        children: dict[str, list[Node]] = {name: [] for name in cls.FIELDS}
        order, last = list(cls.FIELDS), -1
        for child in node.children:
            name = places.get(child.tag)
            if name is None and (not places or child.tag == "ds:Signature"):
                name = foreign
            if name is None:
                self._unknown(child, list(places))
                continue
            if order.index(name) < last and not cls.UNORDERED:
                self.wrong(child, f"{child.tag} stands behind what has to follow it", "The order is that of the schema")
            last = max(last, order.index(name))
            children[name].append(child)
        if node.children and node.text.strip():
            self.wrong(node, f"{node.tag} has text between its elements", "Elements only")
        return children

    def _value(self, node: Node, field: Field, children: Sequence[Node]) -> Any:
        """Of one field; None for the default."""
        if field.kind == "attribute":
            text = node.attributes.get(field.tag)
            return None if text is None else self._simple(node, field, text, f"@{field.tag}")
        if field.kind == "content":
            return self._simple(node, field, node.text)
        if field.kind == "foreign":
            return tuple(children)
        elements = list(self._inner(field, children))
        if field.required and not elements and not any(child.tag in field.outer for child in node.children):
            self.wrong(node, f"{node.tag} has no {' or '.join(field.outer)}", "The schema asks for it")
        if field.repeated:
            return tuple(self._element(child, field) for child in elements)
        self._once(elements)
        return self._element(elements[0], field) if elements else None

    def _inner(self, field: Field, children: Sequence[Node]) -> Iterator[Node]:
        """The elements of a field, out of the element that they stand in together."""
        if not field.within:
            yield from children
            return
        self._once(children)
        for outer in children:
            for child in outer.children:
                if child.tag in field.tags:
                    yield child
                else:
                    self._unknown(child, list(field.tags))
            if not any(child.tag in field.tags for child in outer.children):
                self.wrong(outer, f"{outer.tag} is empty", f"It holds {', '.join(field.tags)}")

    def _once(self, children: Sequence[Node]) -> None:
        if len(children) > 1:
            self.wrong(children[1], f"{children[1].tag} is there {len(children)} times", "Once, or not at all")

    def _element(self, child: Node, field: Field) -> Any:
        if field.simple is None:
            return self.read(child, CLASSES[field.tags[child.tag]])
        for inner in child.children:
            self._unknown(inner, [])
        return self._simple(child, field, child.text)

    def _simple(self, node: Node, field: Field, text: str, which: str = "") -> Any:
        simple = cast("Simple", field.simple)
        try:
            return simple.read(text)
        except (ValueError, KeyError, OverflowError):
            self.wrong(node, f"{which or node.tag} {text[:60]!r} is not {simple.what}", "As the schema has it")
            return None

    def _attributes(self, node: Node, cls: type[Element]) -> None:
        known = [field.tag for field in cls.FIELDS.values() if field.kind == "attribute"]
        for name in [name for name in node.attributes if name not in (*known, *_IGNORED)]:
            if self.strict:
                fix = suggestion(name, known) if known else "Take it out"
                self.wrong(node, f"{node.tag} has no attribute {name}", fix)
            else:
                self.unread.append(f"{node.xpath}/@{name}")
        if "schemaVersion" in known and "schemaVersion" not in node.attributes:
            self.wrong(node, f"{node.tag} has no attribute schemaVersion", "The schema asks for it")

    def _unknown(self, node: Node, known: list[str]) -> None:
        if self.strict or not known:
            self.wrong(node, f"{node.tag} has no place here", suggestion(node.tag, known) if known else "Text only")
        else:
            self.unread.append(node.xpath)


def written(certificate: Certificate) -> bytes:
    root = Node(ROOT, {})
    root.attributes["xsi:schemaLocation"] = f"https://ptb.de/dcc https://ptb.de/dcc/v{certificate.version}/dcc.xsd"
    _fill(root, certificate)
    for node, (problem, fix) in ids_and_references(root):
        raise CmmUqError(problem, where=node.xpath, fix=fix)
    return serialised(root)


def _fill(node: Node, element: Element) -> None:
    name = type(element).__name__
    for problem, fix in _CHECKS[name](element) if name in _CHECKS else ():
        raise CmmUqError(problem, where=node.xpath, fix=fix)
    for field in element.FIELDS.values():
        value = getattr(element, field.name)
        if value is None or (value == () and not field.required):
            continue
        if field.kind == "attribute":
            node.attributes[field.tag] = _text(node, field, value)
        elif field.kind == "content":
            node.text = _text(node, field, value)
        elif field.kind == "element":
            _place(node, field, value if field.repeated else (value,))
        else:
            node.children += value


def _place(node: Node, field: Field, values: tuple[Any, ...]) -> None:
    if not values:
        raise CmmUqError(f"{node.tag} has no {field.name}", where=node.xpath, fix="The schema asks for one")
    outer = _added(node, field.outer[0]) if field.within else node
    for value in values:
        if field.simple is not None:
            inner = _added(outer, field.tag)
            inner.text = _text(inner, field, value)
        elif tag := next((tag for tag, name in field.tags.items() if name == type(value).__name__), None):
            _fill(_added(outer, tag), value)
        else:
            problem, fix = f"{type(value).__name__} is no {field.name}", f"Known: {', '.join(field.tags)}"
            raise CmmUqError(problem, where=outer.xpath, fix=fix)


def _added(parent: Node, tag: str) -> Node:
    node = Node(tag, {}, parent=parent)
    parent.children.append(node)
    return node


def _text(node: Node, field: Field, value: Any) -> str:
    simple = cast("Simple", field.simple)
    text = simple.write(value)
    try:
        valid = simple.read(text) == value
    except (ValueError, KeyError, OverflowError):
        valid = False
    if not valid:
        raise CmmUqError(f"{text[:60]!r} is not {simple.what}", where=node.xpath, fix="The schema of DCC asks for it")
    return text


_MOST = 20  # problems that are told
_IMPORT = re.compile(r'namespace="([^"]+)"\s+schemaLocation="([^"]+)"')


def checked_by_schema(data: bytes, folder: Path, where: str) -> None:
    """Refuse a certificate that the schema of its version refuses.

    The folder has it as ``dcc-3.2.1.xsd`` and ``SI_Format-2.1.0.xsd``, and further versions beside them; what it imports is
    looked up there, and xmldsig-core in the xmlschema package: nothing is fetched.
    """
    version = parsed(data, where).attributes.get("schemaVersion", "")
    schema = _schema(folder, version, where)
    import defusedxml.ElementTree

    root, fix = defusedxml.ElementTree.fromstring(data), f"The schema of DCC {version} asks for it"
    errors = [
        CmmUqError(str(error.reason), where=f"{where}, {error.path}", fix=fix)
        for error in islice(schema.iter_errors(root), _MOST)
    ]
    if errors:
        errors[0].also = tuple(errors[1:])
        raise errors[0]


@cache
def _schema(folder: Path, version: str, where: str) -> Any:
    try:
        import xmlschema
    except ImportError:
        fix = "pip install xmlschema, or leave --schema out"
        raise CmmUqError("the package xmlschema is not installed", where="--schema", fix=fix) from None
    file = folder / f"dcc-{version}.xsd"
    if not re.fullmatch(r"3\.\d+\.\d+", version) or not file.is_file():
        fix = f"Put PTB's dcc.xsd there; {where} is of that version"
        raise CmmUqError(f"no schema of DCC {version}", where=str(file), fix=fix)
    # the newest schema of D-SI in the folder, and the schema of XML signatures that the xmlschema package has
    places = {NAMESPACES["si"]: max(folder.glob("SI_Format-*.xsd"), default=None)}
    places[NAMESPACES["ds"]] = Path(xmlschema.__file__).parent / "schemas" / "DSIG" / "xmldsig-core-schema.xsd"
    text = file.read_text(encoding="utf-8")
    for space, location in _IMPORT.findall(text):
        schema = _of_version(folder, space, location) or places.get(space)
        if schema is None:
            fix = "Put it into the same folder"
            raise CmmUqError(f"imports {location}, which is not beside it", where=str(file), fix=fix)
        text = text.replace(f'"{location}"', f'"{schema.as_uri()}"')
    beside = {"http://qudt.org/vocab/": str(folder / "qudt.xsd")} if (folder / "qudt.xsd").is_file() else None
    try:
        return xmlschema.XMLSchema(text, base_url=str(folder), locations=beside, allow="local", defuse="always")
    except xmlschema.XMLSchemaException as error:
        problem, fix = str(error).strip().partition("\n")[0], "What it imports has to be in the same folder"
        raise CmmUqError(f"cannot be used: {problem}", where=str(file), fix=fix) from None


def _of_version(folder: Path, space: str, location: str) -> Path | None:
    """The file of an imported schema by the version in its address."""
    version = re.search(r"v(\d+\.\d+\.\d+)", location)
    if space != NAMESPACES["si"] or version is None:
        return None
    file = folder / f"SI_Format-{version[1]}.xsd"
    return file if file.is_file() else None
