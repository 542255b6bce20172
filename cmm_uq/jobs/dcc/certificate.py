r"""The elements of a digital calibration certificate (DCC 3.2.1) and of its quantities (D-SI 2.1), as one table.

Of D-SI 2.2 only what it says anew of uncertainty is read: ``measurementUncertaintyUnivariate`` of a value and of a list; those
classes end in MU. A class stands in a line: its fields in the order of the schema, those of its base before them, ``id``,
``ref_id`` and ``ref_type`` behind all others. A field is an element of its name in camelCase, or of the tags behind ``=``: one
of several, in an element that they stand in together (``identifications/identification``). ``@`` is an attribute, ``=.`` the
text of the element itself, ``=*`` elements of other namespaces. Then what it holds, a class or a simple type: ``?`` may be
left out, ``*`` many times or never, ``+`` once or more; ``decimal[]`` is a list in one element. ``!``: elements in any order.

Every class is an attribute of this module. Classes are made without :mod:`dataclasses`, which would take longer to make them
than it takes to write a certificate. Numbers are :class:`~decimal.Decimal`, so that a certificate keeps the digits it was
printed with; units are in D-SI, ``\micro\metre``.
"""

from __future__ import annotations

import datetime as dt
import math
import re
import tomllib
from base64 import b64decode, b64encode
from collections.abc import Callable, Mapping
from decimal import Decimal, InvalidOperation
from pathlib import Path
from typing import TYPE_CHECKING, Any, ClassVar, Literal, NoReturn, Self

from cmm_uq.base.files.limits import NUMERAL
from cmm_uq.base.values import dataclass

VERSION = "3.2.1"  # of the schema that is written
_CLASSES = tomllib.loads(Path(__file__).with_name("classes.toml").read_text(encoding="utf-8"))
# the signatures are XAdES, as they stand: what they are worth is the business of cmm_uq.certificate.sign
D_SI, DCC = (_CLASSES["classes"][name].format(VERSION=VERSION, **_CLASSES["parts"]) for name in ("d_si", "dcc"))


@dataclass(frozen=True, eq=False)
class Simple:
    """What the text of an element or an attribute may be: ``what`` follows "is not", ``read`` raises ValueError."""

    what: str
    plural: str
    read: Callable[[str], Any]
    write: Callable[[Any], str] = str


def _matching(what: str, pattern: str, plural: str = "") -> Simple:
    form = re.compile(pattern)

    def read(text: str) -> str:
        if form.fullmatch(text) is None:
            raise ValueError(text)
        return text

    return Simple(what, plural, read)


def _one_of(*words: str, plural: str = "") -> Simple:
    return _matching(f"one of {', '.join(words)}", "|".join(words), plural)


def _listed(simple: Simple) -> Simple:
    """A list of them, with spaces between."""
    return Simple(
        f"a list of {simple.plural}", "", lambda text: tuple(simple.read(part) for part in text.split()),
        lambda values: " ".join(simple.write(value) for value in values),
    )  # fmt: skip


def _number(what: str, plural: str, pattern: str, form: str = "") -> Simple:
    number = re.compile(pattern)

    def read(text: str) -> Decimal:
        text = text.strip()
        try:
            value = Decimal(text) if len(text) <= NUMERAL.most and number.fullmatch(text) else Decimal("NaN")
        except InvalidOperation:
            raise ValueError(text) from None
        if not math.isfinite(float(value)):
            raise ValueError(text)
        return value

    return Simple(what, plural, read, lambda value: format(value, form))


_BOOLEANS = {"true": True, "1": True, "false": False, "0": False}
_UNSIGNED = r"((\d*\.\d+)|(\d+\.\d*)|(\d+\.?))([Ee][-+]?\d+)?"
_SIMPLE: Mapping[str, Simple] = {
    "string": Simple("a text", "words", str),
    "text": _matching("a text without spaces at its ends", r"\S(?s:.*\S)?", "words"),
    "country": _matching("a country of ISO 3166-1, two capital letters", "[A-Z]{2}"),
    "language": _matching("a language of ISO 639-1, two small letters", "[a-z]{2}"),
    "name": _matching("a name that XML takes as an id", r"[^\W\d][\w.\-]*", "ids"),
    "version": _matching("version 3 of the schema", r"3\.[\s\S]*"),
    "decimal": _number("a number", "numbers", rf"[-+]?{_UNSIGNED}"),
    "uncertainty": _number("a number, 0 or more", "numbers, 0 or more", rf"\+?{_UNSIGNED}"),
    "factor": _number(
        "a coverage factor, 1 or more", "coverage factors, 1 or more", r"\+?(([1-9]\d*\.\d*)|([1-9]\d*))", "f"
    ),
    "probability": _number("a probability", "probabilities", r"\+?((0(\.\d*)?)|(1(\.0*)?))", "f"),
    "bool": Simple("true or false", "true and false", lambda text: _BOOLEANS[text.strip()], lambda value: str(value).lower()),
    "bytes": Simple("base64", "", lambda text: b64decode("".join(text.split()), validate=True),
                    lambda data: b64encode(data).decode()),
    "date": Simple("a date", "", lambda text: dt.date.fromisoformat(text.strip()[:10]), dt.date.isoformat),
    "datetime": Simple("a date with time", "dates with times", lambda text: dt.datetime.fromisoformat(text.strip()),
                       dt.datetime.isoformat),
    "issuer": _one_of("manufacturer", "calibrationLaboratory", "customer", "owner", "other"),
    "place": _one_of("laboratory", "customer", "laboratoryBranch", "customerBranch", "other"),
    "change": _one_of("amended", "substituted"),
    "software_type": _one_of("application", "bios", "driver", "editor", "firmware", "library", "os", "other"),
    "state": _one_of("beforeAdjustment", "afterAdjustment", "beforeRepair", "afterRepair"),
    "conformity": _one_of("pass", "fail", "conditionalPass", "conditionalFail", "noPass", "noFail",
                          plural="states of conformity"),
}  # fmt: skip
_MISSING = object()  # in place of a default


@dataclass(frozen=True)
class Field:
    """A field of a class: ``tags`` of its elements with the class of each, ``outer`` of the element that they stand in."""

    name: str
    kind: Literal["attribute", "element", "content", "foreign"]
    tags: Mapping[str, str]
    outer: tuple[str, ...]
    within: bool
    simple: Simple | None
    repeated: bool
    default: Any

    @property
    def required(self) -> bool:
        return self.default is _MISSING

    @property
    def tag(self) -> str:
        return next(iter(self.tags))


class Element:
    """A frozen record of a certificate; ``UNORDERED``: whether its elements have no order."""

    FIELDS: ClassVar[Mapping[str, Field]]
    UNORDERED: ClassVar[bool]

    def __init__(self, *positional: Any, **named: Any) -> None:
        values = {name: field.default for name, field in self.FIELDS.items()}
        values |= dict(zip(self.FIELDS, positional, strict=False)) | named
        lacking = [name for name, value in values.items() if value is _MISSING]
        if lacking or len(values) > len(self.FIELDS):
            unknown = values.keys() - self.FIELDS.keys()
            raise TypeError(f"{type(self).__name__} takes no {sorted(unknown)} and needs {lacking}")
        self.__dict__.update(values)

    if TYPE_CHECKING:

        def __getattr__(self, name: str) -> Any: ...

    def __setattr__(self, name: str, value: Any) -> NoReturn:
        raise AttributeError(f"{type(self).__name__} is frozen")

    def __eq__(self, other: object) -> bool:
        return type(self) is type(other) and self.__dict__ == other.__dict__

    def __hash__(self) -> int:
        return hash((type(self), *self.__dict__.values()))

    def __repr__(self) -> str:
        changed = (f"{name}={v!r}" for name, v in self.__dict__.items() if v != self.FIELDS[name].default)
        return f"{type(self).__name__}({', '.join(changed)})"

    def __str__(self) -> str:
        """Of texts in several languages, that in English, else without a language, else the first; paragraphs in lines."""
        if "contents" not in self.FIELDS:
            return repr(self)
        parts = [part for part in self.contents if type(part).__name__ == "LanguageText"]
        texts = (
            [part.text for part in parts if part.language == language]
            for language in ("en", None, *(part.language for part in parts[:1]))
        )
        return "\n".join(next(filter(None, texts), []))

    def with_changes(self, **changes: Any) -> Self:
        return type(self)(**{**self.__dict__, **changes})


def _field(text: str, space: str) -> Field:
    match = re.fullmatch(r"(@?)(\w+)(?:=(\S+))?\s*([\w|]*)(\[\])?([?*+]?)(\S*)", text)
    if match is None:
        raise ValueError(text)
    at, name, tag, types, many, count, stated = match.groups()
    head, *rest = name.split("_")
    tag = tag or head + "".join(word.capitalize() for word in rest)
    if tag == "*":
        return Field(name, "foreign", {}, (), False, None, False, ())
    simple = _SIMPLE.get(types)
    simple = _listed(simple) if simple is not None and many else simple
    default = _MISSING if count in ("", "+") else () if many or count == "*" else stated or None
    if at or tag == ".":
        return Field(name, "attribute" if at else "content", {tag: ""}, (), False, simple, False, default)
    outer, _, inner = tag.rpartition("/")
    tags = [each if ":" in each else f"{space}:{each}" for each in inner.split("|")]
    classes = [""] if simple else types.split("|")
    within = (f"{space}:{outer}",) if outer else tuple(tags)
    places = dict(zip(tags, classes, strict=True))
    return Field(name, "element", places, within, bool(outer), simple, count in ("+", "*"), default)


def _classes() -> dict[str, type[Element]]:
    classes: dict[str, type[Element]] = {"": Element}
    Element.FIELDS = {}
    last = ("id", "ref_id", "ref_type")
    for space, table in (("si", D_SI), ("dcc", DCC)):
        for row in re.split(r"\n(?! )", table.strip()):
            name, _, fields = row.partition(":")
            name, _, base = name.rstrip(")!").partition("(")
            own = [_field(" ".join(each.split()), space) for each in fields.split(";") if each.strip()]
            every = {**classes[base].FIELDS, **{field.name: field for field in own}}
            ordered = {key: field for key, field in every.items() if key not in last}
            ordered |= {key: every[key] for key in last if key in every}
            kinds = {"FIELDS": ordered, "UNORDERED": "!" in row.partition(":")[0], "__module__": __name__}
            classes[name] = type(name, (classes[base],), kinds)
    return classes


CLASSES: Mapping[str, type[Element]] = _classes()


def __getattr__(name: str) -> Any:
    if name not in CLASSES:
        raise AttributeError(name)
    return CLASSES[name]
