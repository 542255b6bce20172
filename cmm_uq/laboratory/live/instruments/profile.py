"""How an instrument speaks, as a TOML file says it: line, framing, what to send, what answers mean, and whence it is known."""

from __future__ import annotations

import re
import struct
from functools import partial
from typing import Annotated, Literal, Self

from pydantic import AfterValidator, Field, model_validator

from cmm_uq.base.errors import printable
from cmm_uq.base.files.table import AnyFloat, Column, JobTable, Unit
from cmm_uq.laboratory.live.instruments.linear import NotLinearError, Use, check_linear

NAMES = (
    "NUL", "SOH", "STX", "ETX", "EOT", "ENQ", "ACK", "BEL", "BS", "HT", "LF", "VT", "FF", "CR", "SO", "SI", "DLE",
    "DC1", "DC2", "DC3", "DC4", "NAK", "SYN", "ETB", "CAN", "EM", "SUB", "ESC", "FS", "GS", "RS", "US",
)  # fmt: skip
"""Of the characters 0 to 31 (ISO/IEC 646)."""

_CODES = {name: bytes([code]) for code, name in enumerate(NAMES)} | {"DEL": b"\x7f"}
_SHOWN = {code[0]: f"<{name}>" for name, code in _CODES.items()}
_WRITTEN = re.compile(r"<(?:([A-Z]{2,3}\d?)|0x([0-9A-Fa-f]{2}))>")


def bytes_of(text: str) -> bytes:
    """The bytes that are meant; what stands in angle brackets and is no name is taken as it is written."""
    found, place = b"", 0
    for written in _WRITTEN.finditer(text):
        code = bytes.fromhex(written[2]) if written[2] else _CODES.get(written[1], written[0].encode())
        found += _plain(text[place : written.start()]) + code
        place = written.end()
    return found + _plain(text[place:])


def shown(data: bytes) -> str:
    """Bytes as :func:`bytes_of` reads them again, on one line that a terminal shows."""
    return "".join(_SHOWN.get(byte) or (printable(chr(byte)) if byte < 0x80 else f"<0x{byte:02X}>") for byte in data)


def _plain(text: str) -> bytes:
    try:
        return text.encode("latin-1")
    except UnicodeEncodeError as error:
        raise ValueError(f"{text[error.start]!r} is no single byte: write each byte as <0x41>") from None


MOST_FIELDS = 200  # of a message
ANSWER_WITHIN_S = 2.0  # usual time for an answer


def _codes(text: str) -> str:
    bytes_of(text)
    return text


NUMBER = r"[-+]?\s*+\d++(?:\.\d*+)?(?:[Ee][-+]?\d++)?"  # A number in a line
_NUMBER_BEFORE = r"[-+]?\s*\d+\.?\d*(?:[Ee][-+]?\d+)?"  # in profiles that earlier versions of `instruments new` wrote


def _pattern(text: str, use: Use = "search") -> str:
    if _NUMBER_BEFORE in text:  # nothing behind a repeat of theirs needs what it read
        text = re.sub(r"\\s\*(?![+?])", r"\\s*+", text.replace(_NUMBER_BEFORE, NUMBER))
    try:
        re.compile(text)
        check_linear(text, use)
    except NotLinearError:
        raise
    except (re.error, RecursionError, OverflowError) as error:
        raise ValueError(f"is no regular expression: {error}") from None
    return text


Bytes = Annotated[str, Field(max_length=500), AfterValidator(_codes)]
"""Bytes as manuals write them, with ``<CR>`` and ``<0x41>``."""

_Expression = Annotated[str, Field(min_length=1, max_length=10_000)]
Pattern = Annotated[_Expression, AfterValidator(_pattern)]
WholePattern = Annotated[_Expression, AfterValidator(partial(_pattern, use="fullmatch"))]
Separator = Annotated[_Expression, AfterValidator(partial(_pattern, use="split"))]
Seconds = Annotated[float, Field(gt=0, le=86400)]


class Connection(JobTable):
    """``[connection]``: the serial line; a socket has no such settings, and a device server has its own."""

    baud: Annotated[int, Field(gt=0, le=4_000_000)] = 9600
    """Bits per second."""
    data_bits: Literal[5, 6, 7, 8] = 8
    """Data bits of a character."""
    parity: Literal["none", "even", "odd", "mark", "space"] = "none"
    """Parity."""
    stop_bits: Literal[1, 2] = 1
    """Stop bits."""
    flow: Literal["none", "xon-xoff", "rts-cts", "dsr-dtr"] = "none"
    """Flow control."""
    dtr: bool = True
    """Whether the line DTR is on: some cables are fed by it."""
    rts: bool = True
    """Whether the line RTS is on."""


class MessageFrame(JobTable):
    """``[frame]``: where a message begins and ends: a terminator; or a length; or a first byte with a last one or a length."""

    terminator: Bytes = ""
    """Bytes that end a message: `<CR><LF>`."""
    start: Bytes = ""
    """Byte that begins a message: `<STX>`."""
    stop: Bytes = ""
    """Byte that ends a message which has a first one: `<ETX>`."""
    length: Annotated[int, Field(ge=0, le=65536)] = 0
    """Bytes of a message, the first one included; without a first byte only for instruments that are asked."""
    longest: Annotated[int, Field(ge=1, le=1_000_000)] = 4096
    """Bytes after which a message that has not ended is given up; a line to its terminator, which ends no message then."""

    @model_validator(mode="after")
    def _one_of(self) -> Self:
        if sum((bool(self.terminator), bool(self.stop), bool(self.length))) != 1:
            raise ValueError("needs one of terminator, stop and length")
        for key in ("start", "stop"):
            if len(bytes_of(getattr(self, key))) > 1:
                raise ValueError(f"{key} is one byte")
        if bool(self.stop) > bool(self.start) or (self.terminator and self.start):
            raise ValueError("start goes with stop or with length")
        return self


class Poll(JobTable):
    """One question, and what its answer looks like where that differs from the others."""

    send: Bytes
    """What is sent."""
    pattern: Pattern | None = None
    """Regular expression of its answer, with a group for each quantity; that of `[parse]` where it is left out."""
    messages: Annotated[int, Field(ge=1, le=MOST_FIELDS)] = 1
    """Messages with values that it is answered with; one more is that of no question, and is not used."""


class Send(JobTable):
    """``[send]``: what the instrument is sent; nothing where it speaks by itself."""

    start: Annotated[list[Bytes], Field(max_length=50)] = []
    """Sent once after the port was opened, and again when the instrument came back or fell silent."""
    poll: Annotated[list[Poll], Field(max_length=MOST_FIELDS)] = []
    """Questions, asked one after the other; without any the instrument is only listened to."""
    every_s: Seconds = 1.0
    """Time from one round of questions to the next."""
    stop: Annotated[list[Bytes], Field(max_length=50)] = []
    """Sent before the port is closed."""
    answer_within_s: Seconds = ANSWER_WITHIN_S
    """Time after which a question without an answer is said to be one."""
    silent_after_s: Seconds | None = None
    """Time without a message after which an instrument that speaks by itself is said to be silent; never where left out."""
    unasked: bool = False
    """Whether it also sends values by itself, as by a DATA key, although it is asked; else such a value is not used."""

    @model_validator(mode="after")
    def _one_question(self) -> Self:
        if self.unasked and len(self.poll) != 1:
            problem = "unasked is for an instrument with one question: of several, nobody knows which it answers"
            raise ValueError(problem)
        return self


class Parse(JobTable):
    """``[parse]``: what a message says. One of: a pattern; fields with a separator; binary fields of fixed length."""

    pattern: Pattern | None = None
    """Regular expression that is searched in the message; each named group is a quantity."""
    separator: Separator | None = None
    """Regular expression of what stands between fields: `,` or `[,;\\s]+`."""
    struct: str | None = None
    """Binary fields of the message without its first and last byte, in the notation of Python's struct: `<hhf`."""
    fields: Annotated[list[str], Field(max_length=MOST_FIELDS)] = []
    """Quantities in the order of the fields; an empty name passes a field over."""
    fewer: bool = False
    """Whether a message may have fewer fields than are named."""
    decimal: Literal[".", ","] = "."
    """Decimal sign of numbers in text."""
    ignore: Annotated[list[WholePattern], Field(max_length=50)] = []
    """Messages that say nothing: prompts, echoes, empty lines; the whole message fits one of these."""

    @model_validator(mode="after")
    def _one_of(self) -> Self:
        if sum(way is not None for way in (self.pattern, self.separator, self.struct)) != 1:
            raise ValueError("needs one of pattern, separator and struct")
        if (self.pattern is None) != bool(self.fields):
            raise ValueError("fields go with separator or struct, and both need them")
        if self.struct is not None:
            try:
                count = len(struct.unpack(self.struct, bytes(struct.calcsize(self.struct))))
            except struct.error as error:
                raise ValueError(f"struct: {error}") from None
            if count != len(self.fields):
                raise ValueError(f"struct has {count} fields, and fields names {len(self.fields)}")
        return self


class ProfileQuantity(JobTable):
    """``[quantities.NAME]``: what is to be known of one quantity beside its name."""

    unit: Unit = ""
    """Unit that the instrument gives it in, as pint spells it: degF, inHg, inch; that of the name's ending where left out.
    An instrument that may be set to another, and does not say which, has it in the job: `units` of `[[acquire.source]]`."""
    unit_group: str = ""
    """Group of the pattern with the unit as the message says it, for instruments that may be set to several."""
    units: Annotated[dict[str, Unit], Field(max_length=50)] = {}
    """Units by what the message says: `C = "degC"`; any other is refused."""
    factor: AnyFloat = 1.0
    """What the number is multiplied with first: 0.0001 where the decimal point is not sent."""
    range: Annotated[list[AnyFloat], Field(min_length=2, max_length=2)] | None = None
    """Least and largest plausible value, in the unit of the name's ending; what lies outside is no value."""


class Ill(JobTable):
    """One ``[[ill]]``: what the instrument says when something is wrong."""

    pattern: Pattern
    """Regular expression that is searched in the message."""
    says: Annotated[str, Field(min_length=1, max_length=200)]
    """What it means."""


class Identify(JobTable):
    """``[identify]``: how the instrument says which one it is."""

    send: Bytes
    """What is sent."""
    pattern: Pattern
    """Regular expression that is searched in the answer's lines together, with groups maker, model, serial, firmware."""


class Example(JobTable):
    """One ``[[example]]``: a message and what it says; a profile that reads its own examples otherwise is refused."""

    received: Bytes
    """The message as it comes, with its framing."""
    values: Annotated[dict[str, AnyFloat], Field(max_length=MOST_FIELDS)] = {}
    """Its quantities."""
    ill: bool = False
    """Whether the message says that something is wrong."""
    answers: Annotated[int, Field(ge=0, lt=MOST_FIELDS)] = 0
    """Which question it answers, counted from 0."""


class ProfileFacts(JobTable):
    """``[facts]``: whence all this is known."""

    sources: Annotated[list[str], Field(max_length=50)] = []
    """Documents that say so, with title and address."""
    not_found: Annotated[list[str], Field(max_length=50)] = []
    """What no source was found for, and what is assumed instead."""
    tried: str = "not tried on real hardware"
    """What the profile was tried on."""


class Positions(JobTable):
    """``[ipp]``: what a CMM's I++ DME server is asked for."""

    every_s: Annotated[float, Field(ge=0, le=86400)] = 0.0
    """Time from one question for the position to the next; 0 listens to picked points alone."""
    user: bool = True
    """Whether the joystick is enabled, so that points can be picked by hand."""
    moves: bool = False
    """Whether positions are reported while the machine moves."""


class ProfileFile(JobTable):
    """A profile."""

    name: Annotated[str, Field(pattern=r"^[a-z0-9][a-z0-9.-]*$", max_length=60)]
    """Name by which jobs call it: small letters, digits, `.` and `-`."""
    title: Annotated[str, Field(min_length=1, max_length=200)]
    """What the instrument is."""
    maker: str = ""
    """Who makes it."""
    model: str = ""
    """Its model."""
    protocol: Literal["messages", "ipp"] = "messages"
    """Messages as the tables below say, or a CMM's I++ DME server."""
    connection: Connection = Connection()
    """The serial line."""
    frame: MessageFrame = MessageFrame(terminator="<CR><LF>")
    """Where a message begins and ends."""
    send: Send = Send()
    """What the instrument is sent."""
    parse: Parse | None = None
    """What a message says."""
    quantities: Annotated[dict[Column, ProfileQuantity], Field(max_length=MOST_FIELDS)] = {}
    """What is to be known of a quantity beside its name."""
    ill: Annotated[list[Ill], Field(max_length=100)] = []
    """What the instrument says when something is wrong."""
    identify: Identify | None = None
    """How the instrument says which one it is."""
    ipp: Positions = Positions()
    """What a CMM's I++ DME server is asked for."""
    example: Annotated[list[Example], Field(max_length=100)] = []
    """Messages with what they say."""
    facts: ProfileFacts = ProfileFacts()
    """Whence all this is known."""

    def named(self) -> set[str]:
        """Quantities that its messages may give."""
        if self.parse is None:
            return {"x_mm", "y_mm", "z_mm"}
        patterns = [self.parse.pattern, *(poll.pattern for poll in self.send.poll)]
        found = {group for pattern in patterns if pattern for group in re.compile(pattern).groupindex}
        units = {one.unit_group for one in self.quantities.values()}
        return (found | set(filter(None, self.parse.fields))) - units
