"""What a message says: where it begins and ends, its values by quantity, or in words what is wrong with it."""

from __future__ import annotations

import re
import struct
from collections.abc import Callable, Mapping, Sequence
from functools import cache
from math import isclose, isfinite
from types import MappingProxyType

from cmm_uq.base.errors import CmmUqError, suggestion
from cmm_uq.base.files.table import unit_of
from cmm_uq.base.messages import Text, Verbatim, number, say, semicolons
from cmm_uq.base.units import pint_units
from cmm_uq.base.values import dataclass, field
from cmm_uq.laboratory.live.instruments import profile as profiles


@dataclass(frozen=True)
class FramedMessage:
    raw: bytes
    body: bytes  # without terminator, first and last byte
    whole: bool = True  # whether it is a message; else bytes between messages, or a message without its end
    overlong: bool = False  # whether it is part of a message that is longer than any may be


class Framer:
    """Messages out of a stream of bytes; no byte is lost, none is in two messages.

    A line that is too long is none up to its terminator: what its end looks like is nothing that the instrument said.
    """

    def __init__(self, frame: profiles.MessageFrame) -> None:
        self._terminator, self._start, self._stop = map(profiles.bytes_of, (frame.terminator, frame.start, frame.stop))
        self._length, self._longest = frame.length, frame.longest
        self._waiting = bytearray()
        self._looked = 0
        self._overlong: bytes | None = None  # of a line that is too long, the last bytes that were taken

    def feed(self, received: bytes) -> list[FramedMessage]:
        self._waiting += received
        return list(iter(self._next, None))

    def rest(self) -> FramedMessage | None:
        """What waits for its end and will not get it; afterwards nothing waits."""
        return self._no_message(len(self._waiting), overlong=self._overlong is not None) if self._waiting else None

    @property
    def waiting(self) -> bytes:
        return bytes(self._waiting)

    def _next(self) -> FramedMessage | None:
        if self._start and (place := self._waiting.find(self._start)):
            before = len(self._waiting) if place < 0 else place
            return self._no_message(min(before, self._longest)) if place > 0 or before >= self._longest else None
        size = self._size()
        if size is None and len(self._waiting) < self._longest:
            return None
        if size is None or size > self._longest:
            taken = self._no_message(self._longest, overlong=True)
            if self._terminator:
                self._overlong = taken.raw[1 - len(self._terminator) or len(taken.raw) :]
            return taken
        if self._overlong is not None:
            self._overlong = None
            return self._no_message(size, overlong=True)
        raw = self._taken(size)
        return FramedMessage(raw, raw[len(self._start) : len(raw) - len(self._terminator or self._stop)])

    def _size(self) -> int | None:
        """Bytes of the message that waits; ``None`` where its end has not come."""
        if self._length:
            return self._length if len(self._waiting) >= self._length else None
        end, before = self._terminator or self._stop, self._overlong or b""
        if before and (place := (before + self._waiting[: len(end)]).find(end)) >= 0:
            return place + len(end) - len(before)
        place = self._waiting.find(end, max(self._looked, len(self._start)))
        if place < 0:
            # What was looked at once need not be looked at again, but an end may have begun in its last bytes.
            self._looked = max(0, len(self._waiting) - len(end) + 1)
            return None
        return place + len(end)

    def _taken(self, size: int) -> bytes:
        raw = bytes(self._waiting[:size])
        del self._waiting[:size]
        self._looked = 0
        return raw

    def _no_message(self, size: int, *, overlong: bool = False) -> FramedMessage:
        raw = self._taken(size)
        return FramedMessage(raw, raw, whole=False, overlong=overlong)


_PINT: Mapping[str, str] = MappingProxyType({
    "K/h": "kelvin/hour", "1/K": "1/kelvin", "µm/m": "micrometer/meter", "mm/s": "millimeter/second", "″": "arcsecond",
    "µm": "micrometer", "°": "degree", "°C": "degC", "K": "kelvin", "h": "hour", "%": "percent",
})  # fmt: skip
"""Units of the ends of names as pint spells them, where it does otherwise."""


class NoValueError(Exception):
    """A number that is none; what is wrong with it, in words."""

    def __init__(self, why: Text) -> None:
        self.why = why
        super().__init__(why)


def number_of(text: str, decimal: str) -> float:
    """A number in a message; blanks between sign and digits are passed over."""
    plain = "".join(text.split())
    if decimal == ",":
        plain = plain.replace(".", "?").replace(",", ".")  # a point would be one of thousands, or of another setting
    try:
        return float(plain.replace("_", "?"))  # which Python allows between digits
    except ValueError:
        raise NoValueError(say("{text} is no number", text=Verbatim(repr(text)))) from None


def value_of(name: str, raw: float, quantity: profiles.ProfileQuantity, said: str = "") -> float:
    unit = quantity.units.get(said) if quantity.unit_group else quantity.unit
    if unit is None:
        raise NoValueError(say("{name} comes in {unit}, which the profile does not know", name=Verbatim(name),
                               unit=Verbatim(repr(said))))  # fmt: skip
    found = conversion(unit, unit_of(name))(raw * quantity.factor)
    if not isfinite(found):
        raise NoValueError(say("{name} is {found}", name=Verbatim(name), found=number(found, "g")))
    if quantity.range is not None and not quantity.range[0] <= found <= quantity.range[1]:
        raise NoValueError(
            say("{name} is {found}, outside {low} to {high}", name=Verbatim(name), found=number(found, "g"),
                low=number(quantity.range[0], "g"), high=number(quantity.range[1], "g"))
        )  # fmt: skip
    return found


@cache
def conversion(given: str, wanted: str) -> Callable[[float], float]:
    """From one unit, as pint spells it, into another as printed; nothing to do where either is empty or both are the same."""
    target = _PINT.get(wanted, wanted)
    if given in ("", target):
        return float
    import pint

    registry = pint_units()
    try:
        registry.Quantity(1.0, given).to(target)
    except (pint.PintError, ValueError, TypeError, AttributeError, SyntaxError) as error:
        fix = f"Give a unit that can be {wanted}" if wanted else "End the quantity's name with its unit: temp_c, x_mm"
        raise CmmUqError(f"the unit {given!r} cannot be used: {error}", fix=fix) from None
    return lambda value: float(registry.Quantity(value, given).to(target).magnitude)


_SHOWN = 60  # bytes of a message that was not understood, as messages show them
_PLAIN = profiles.ProfileQuantity()
_NOTHING = profiles.Parse(pattern="(?!)")  # understands nothing


@dataclass(frozen=True)
class Understood:
    values: Mapping[str, float] = field(default_factory=dict)  # by quantity; empty where it says none
    status: Text | None = None  # what is wrong; ``None``: nothing
    answers: bool = False  # whether it is an answer: it has values, or says that something is wrong with the instrument
    unasked: bool = False  # whether it is one that no question is known of


class Parser:
    def __init__(self, profile: profiles.ProfileFile) -> None:
        self._profile, self._parse = profile, profile.parse or _NOTHING
        self._ignored = [re.compile(pattern) for pattern in self._parse.ignore]
        self._ill = [(re.compile(one.pattern), one.says) for one in profile.ill]
        usual, polls = self._parse.pattern, profile.send.poll
        texts = [poll.pattern or usual for poll in polls] or [usual]
        self._patterns = [None if text is None else re.compile(text) for text in texts]

    def read(self, message: FramedMessage, answers: int = 0) -> Understood:
        text = message.body.decode("latin-1")
        if message.overlong:
            most, seen = self._profile.frame.longest, _seen(message.raw)
            return Understood(
                status=say("a line of more than {most} characters is dropped, to its end: {seen}", most=most, seen=seen)
            )
        if any(pattern.fullmatch(text) for pattern in self._ignored):
            return Understood()
        if not message.whole:
            return Understood(status=say("part of a message, or noise: {seen}", seen=_seen(message.raw)))
        for pattern, says in self._ill:
            if pattern.search(text):
                why = say("the instrument says {seen}: {meaning}", seen=_seen(message.raw), meaning=Verbatim(says))
                return Understood(status=why, answers=True)
        values: dict[str, float] = {}
        wrong: list[Text] = []
        try:
            for name, sent, said in self._numbers(message.body, text, answers):
                try:  # each by itself: one open thermocouple does not spoil the others
                    raw = number_of(sent, self._parse.decimal) if isinstance(sent, str) else sent
                    values[name] = value_of(name, raw, self._profile.quantities.get(name, _PLAIN), said)
                except NoValueError as error:
                    wrong.append(error.why)
        except NoValueError as error:
            return Understood(status=error.why)
        return Understood(values, semicolons(wrong) if wrong else None, answers=bool(values))

    def begins(self, part: bytes) -> bool:
        """Whether the beginning of a message may hold some of a value: a digit, or a byte of a binary field."""
        text = part.decode("latin-1")
        said = part if self._parse.struct is not None else re.search(r"\d", text)
        return bool(said) and not any(pattern.fullmatch(text) for pattern in self._ignored)

    def _numbers(self, body: bytes, text: str, answers: int) -> Sequence[tuple[str, str | float, str]]:
        """Name, number as sent and unit as said of each quantity of a message."""
        names, layout, separator = self._parse.fields, self._parse.struct, self._parse.separator
        if layout is not None:
            if len(body) != struct.calcsize(layout):
                raise NoValueError(_not_understood(text))
            numbers = zip(names, struct.unpack(layout, body), strict=True)
            return [(name, float(value), "") for name, value in numbers if name and isinstance(value, (int, float))]
        if separator is not None:
            parts = re.split(separator, text.strip())
            if len(parts) > len(names) or (len(parts) < len(names) and not self._parse.fewer):
                raise NoValueError(
                    say("{seen} has {count} fields, not {wanted}", seen=_seen(text.encode("latin-1")), count=len(parts),
                        wanted=len(names))
                )  # fmt: skip
            return [(name, part, "") for name, part in zip(names, parts, strict=False) if name]
        pattern = self._patterns[answers % len(self._patterns)]
        found = pattern.search(text) if pattern else None
        if found is None:
            raise NoValueError(_not_understood(text))
        groups, quantities = found.groupdict(), self._profile.quantities
        units = {quantity.unit_group for quantity in quantities.values()}
        return [
            (name, sent, (groups.get(quantities.get(name, _PLAIN).unit_group) or "").strip())
            for name, sent in groups.items()
            if sent is not None and name not in units
        ]


def _not_understood(text: str) -> Text:
    return say("not understood: {seen}", seen=_seen(text.encode("latin-1")))


def _seen(raw: bytes) -> Text:
    return Verbatim(f"{profiles.shown(raw[:_SHOWN])}{'…' if len(raw) > _SHOWN else ''}")


def check_unit(name: str, unit: str, where: str) -> None:
    """Refuse a unit that cannot be that of a quantity's name."""
    try:
        conversion(unit, unit_of(name))
    except CmmUqError as error:
        raise CmmUqError(error.problem, where=where, fix=error.fix) from None


def check_profile(profile: profiles.ProfileFile, where: str) -> None:
    """Refuse a profile that contradicts itself, or reads its own examples otherwise than they say."""
    if profile.protocol == "ipp":
        return
    if profile.parse is None:
        fix = "Give pattern, or fields with separator or struct"
        raise CmmUqError("is missing: it says what a message means", where=f"{where}: [parse]", fix=fix)
    if profile.frame.length and not profile.frame.start and not profile.send.poll:
        raise CmmUqError("is for instruments that are asked: nothing else ends a message that is cut",
                         where=f"{where}: [frame] length", fix="Give start, or [send] poll")  # fmt: skip
    named = profile.named()
    for name, quantity in profile.quantities.items():
        at = f"{where}: [quantities.{name}]"
        if name not in named:
            raise CmmUqError("is no group or field of a message", where=at, fix=suggestion(name, named))
        for unit in (quantity.unit, *quantity.units.values()):
            check_unit(name, unit, at)
    parser = Parser(profile)
    for place, example in enumerate(profile.example, 1):
        _check_example(profile, parser, example, f"{where}: [[example]] {place}")


def _check_example(profile: profiles.ProfileFile, parser: Parser, example: profiles.Example, at: str) -> None:
    framer, raw = Framer(profile.frame), profiles.bytes_of(example.received)
    messages = framer.feed(raw)
    if len(messages) != 1 or framer.waiting:
        raise CmmUqError(f"{profiles.shown(raw)} is {len(messages)} messages and {'a part' if framer.waiting else 'no rest'}",
                         where=at, fix="Mend [frame], or write the message with its framing")  # fmt: skip
    found = parser.read(messages[0], example.answers)
    same = found.values.keys() == example.values.keys() and all(
        isclose(found.values[name], value, rel_tol=1e-9) for name, value in example.values.items()
    )
    if bool(found.status) != example.ill or not same:
        seen, wanted = (", ".join(f"{name} = {value!r}" for name, value in each.items())
                        for each in (found.values, example.values))  # fmt: skip
        wanted = wanted or "what is wrong with the instrument"
        raise CmmUqError(f"{profiles.shown(raw)} is read as {seen or found.status or 'nothing'}, not as {wanted}", where=at,
                         fix="Mend [parse] and [quantities], or the example")  # fmt: skip
