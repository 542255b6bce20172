"""What a live source is, its readings by two clocks, and its port: serial, TCP, RFC 2217, VISA or a file, all read alike.

VISA (GPIB, USB-TMC) is by pyvisa, installed with ``cmm-uq[visa]``; there nothing is read before something was asked: many
instruments take a reading without a question for an error.
"""

from __future__ import annotations

import contextlib
import errno
import os
import re
import socket
import threading
import time
import warnings
from collections.abc import Callable, Iterator, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any, Protocol, cast
from urllib.parse import parse_qs

from cmm_uq.base.errors import CmmUqError
from cmm_uq.base.files.limits import check_file
from cmm_uq.base.messages import Text
from cmm_uq.base.values import dataclass, field
from cmm_uq.laboratory.live.instruments.profile import Connection

if TYPE_CHECKING:
    import serial


@dataclass(frozen=True)
class Moment:
    """A moment by both clocks, ns: the wall clock since 1970, which is set at times, and the monotonic one, which never is."""

    utc_ns: int
    monotonic_ns: int

    @classmethod
    def now(cls, clock: Clock) -> Moment:
        return cls(clock.utc_ns(), clock.monotonic_ns())


@dataclass(frozen=True)
class Reading:
    """One message of an instrument, as received and as understood; values by the quantity's name with its unit."""

    source: str  # the name in the job, unique
    number: int  # counts the messages of this source since it was opened, from 1
    utc_ns: int  # wall clock when its last byte arrived, ns since 1970
    monotonic_ns: int  # monotonic clock at the same moment, ns
    raw: bytes  # bytes as received, framing included
    values: Mapping[str, float]
    status: Text | None = None
    point: str | None = None  # for a CMM what was measured (``PtMeas``), else ``None``
    unasked: bool = False  # whether it is an answer that nobody is known to have asked for, which has no values


@dataclass(frozen=True)
class Identity:
    """Which instrument it is: what it says itself, and what the job says of it; ``None`` where nobody does."""

    name: str
    maker: str | None = None
    model: str | None = None
    serial: str | None = None
    firmware: str | None = None
    certificate: str | None = None
    units: Mapping[str, str] = field(default_factory=dict)  # by quantity, those that the instrument does not say
    units_stated: list[str] = field(default_factory=list)  # quantities whose units the job states, not assumed


@dataclass(frozen=True)
class Gap:
    source: str
    utc_ns: int
    monotonic_ns: int
    why: Text


@dataclass(frozen=True)
class Returned:
    source: str
    utc_ns: int
    monotonic_ns: int
    after_s: float


Event = Reading | Gap | Returned


class LiveSource(Protocol):
    name: str

    def identity(self) -> Identity:
        """Which instrument it is, as far as is known by now."""

    def events(self, stop: threading.Event) -> Iterator[Event]:
        """What happens, as it happens; it reconnects within 2 s and never raises for what the line does."""

    def close(self) -> None: ...


class Clock:
    """Time, as the system tells it; a test has one of its own."""

    def utc_ns(self) -> int:
        return time.time_ns()

    def monotonic_ns(self) -> int:
        return time.monotonic_ns()

    def sleep(self, s: float) -> None:
        time.sleep(s)


SYSTEM = Clock()
SECOND = 1_000_000_000  # ns
TICK_S = 0.05  # longest wait for bytes; whoever waits longer looks at the clock in between


class PortLostError(Exception):
    """The port is gone: unplugged, closed by the other side, or switched off."""


class Port(Protocol):
    def read(self, *, wait: bool = True) -> bytes:
        """What came, as soon as anything comes; empty where nothing did within :data:`TICK_S`, or at once without waiting."""

    def write(self, data: bytes) -> None: ...
    def close(self) -> None: ...


SCHEME = "visa://"  # begins the name of a port that VISA knows: ``visa://GPIB0::17::INSTR``


@contextlib.contextmanager
def _lost_on(failures: tuple[type[Exception], ...]) -> Iterator[None]:
    try:
        yield
    except failures as error:
        raise PortLostError(str(error)) from None


class VisaPort:
    def __init__(self, port: str, library: str = "") -> None:
        try:
            import pyvisa
        except ImportError:
            fix = 'Install it: pip install "cmm-uq[visa]"'
            raise CmmUqError("needs pyvisa, which is not installed", where=port, fix=fix) from None
        self._failures = (pyvisa.errors.VisaIOError, pyvisa.errors.InvalidSession, OSError, ValueError)
        self._timed_out = pyvisa.constants.StatusCode.error_timeout
        self._asked = False
        try:
            name = port.removeprefix(SCHEME)
            self._visa: Any = pyvisa.ResourceManager(library).open_resource(name, timeout=TICK_S * 1e3)
        except self._failures as error:
            fix = "Check address and cable; pyvisa-info says which VISA is there"
            raise CmmUqError(f"cannot be opened: {error}", where=port, fix=fix) from None

    def read(self, *, wait: bool = True) -> bytes:
        if not self._asked or not wait:
            time.sleep(TICK_S * wait)
            return b""
        try:
            received = bytes(self._visa.read_raw())
        except self._failures as error:
            if getattr(error, "error_code", None) == self._timed_out:
                return b""
            raise PortLostError(str(error)) from None
        self._asked = False
        return received

    def write(self, data: bytes) -> None:
        with _lost_on(self._failures):
            self._visa.write_raw(data)
        self._asked = self._asked or b"?" in data

    def close(self) -> None:
        with contextlib.suppress(*self._failures):
            self._visa.close()


FILE = "file:"
NETWORK = ("tcp://", "socket://")  # plain TCP, by two names
RFC2217 = "rfc2217://"
CONNECT_WITHIN_S = 1.0  # time for a connection over the network: twice of it is less than what a reconnection may take

KEPT_ALIVE = {"TCP_KEEPIDLE": 5, "TCP_KEEPINTVL": 1, "TCP_KEEPCNT": 3}
"""So that a connection whose other side was switched off is lost after 8 s, where nothing is sent that would show it."""

_CHUNK, _REPLAYED = 65536, 4096
ADDRESS = re.compile(r"(?P<scheme>\w+)://(?P<host>\[[0-9A-Fa-f:.]+\]|[^\s:/]+):(?P<port>\d{1,5})/?")


PortOpener = Callable[[], Port]  # opens a port, again and again


def opener(port: str, connection: Connection, *, tcp_port: int | None = None) -> PortOpener:
    if port.startswith("visa://"):
        return lambda: VisaPort(port)
    if "://" not in port:
        if not port.strip():
            raise CmmUqError("no port is named", fix='Give port = "/dev/ttyUSB0", "COM3" or "socket://host:port"')
        return lambda: SerialPort(port, connection)
    if tcp_port is not None and re.fullmatch(r"\w+://[^\s:/]+/?", port):
        port = f"{port.rstrip('/')}:{tcp_port}"
    address = ADDRESS.fullmatch(port)
    if address is None or not 0 < int(address["port"]) < 65536:
        raise CmmUqError("is no address", where=port, fix="Write it as socket://host:port")
    if port.startswith(NETWORK):
        return lambda: TcpPort(address["host"].strip("[]"), int(address["port"]), port)
    if port.startswith(RFC2217):
        return lambda: SerialPort(port, connection)
    fix = "Known: a serial port, socket://, tcp://, rfc2217://, visa://, pt104://, file:"
    raise CmmUqError(f"{address['scheme']}:// is no way to an instrument", where=port, fix=fix)


class SerialPort:
    """A serial line of this computer, or one behind an RFC 2217 device server; no other program has it at the same time."""

    def __init__(self, port: str, connection: Connection) -> None:
        import serial

        far = port.startswith(RFC2217)
        flow = {"xonxoff": connection.flow == "xon-xoff", "rtscts": connection.flow == "rts-cts"}
        settings: dict[str, Any] = {
            "baudrate": connection.baud, "bytesize": connection.data_bits, "parity": connection.parity[0].upper(),
            "stopbits": connection.stop_bits, "dsrdtr": connection.flow == "dsr-dtr", **flow,
        }  # fmt: skip
        self._failures = (serial.SerialException, OSError, TypeError, ValueError)
        own: dict[str, Any] = {} if far else {"exclusive": True, "write_timeout": 1.0}
        url = f"{port}?timeout={CONNECT_WITHIN_S}" if far else port
        try:
            # of pyserial's way to make a thread
            with warnings.catch_warnings(action="ignore", category=DeprecationWarning):
                made = serial.serial_for_url(url, do_not_open=True, timeout=TICK_S, **settings, **own)
                self._serial = cast("serial.Serial", made)
                self._serial.dtr, self._serial.rts = connection.dtr, connection.rts
                self._serial.open()
        except (serial.SerialException, OSError, ValueError) as error:
            raise _refused(port, error) from None

    def read(self, *, wait: bool = True) -> bytes:
        with _lost_on(self._failures):
            first: bytes = self._serial.read(1) if wait or self._serial.in_waiting else b""
            return first + (self._serial.read(waiting) if first and (waiting := self._serial.in_waiting) else b"")

    def write(self, data: bytes) -> None:
        with _lost_on(self._failures):
            self._serial.write(data)

    def close(self) -> None:
        with contextlib.suppress(*self._failures):
            self._serial.close()


class TcpPort:
    def __init__(self, host: str, port: int, name: str) -> None:
        try:
            self._socket = socket.create_connection((host, port), timeout=CONNECT_WITHIN_S)
        except OSError as error:
            raise _refused(name, error) from None
        self._socket.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        self._socket.setsockopt(socket.SOL_SOCKET, socket.SO_KEEPALIVE, 1)
        for name, value in KEPT_ALIVE.items():
            if hasattr(socket, name):
                self._socket.setsockopt(socket.IPPROTO_TCP, getattr(socket, name), value)

    def read(self, *, wait: bool = True) -> bytes:
        try:
            self._socket.settimeout(TICK_S if wait else 0)
            received = self._socket.recv(_CHUNK)
        except (TimeoutError, BlockingIOError):
            return b""
        except OSError as error:
            raise PortLostError(error.strerror or str(error)) from None
        if not received:
            raise PortLostError("the other side closed the connection")
        return received

    def write(self, data: bytes) -> None:
        try:
            self._socket.settimeout(CONNECT_WITHIN_S)
            self._socket.sendall(data)
        except OSError as error:
            raise PortLostError(error.strerror or str(error)) from None

    def close(self) -> None:
        self._socket.close()


_NO_PERMISSION = "" if os.name == "nt" else ": on Linux, join the group that owns it (ls -l), often dialout"
_REFUSALS: tuple[tuple[tuple[int, ...], tuple[type[Exception], ...], tuple[str, ...], str, str], ...] = (
    ((errno.EAGAIN, errno.EBUSY, errno.EWOULDBLOCK), (), ("exclusively lock",),
     "the port is busy: another program has it", "Close that program; one port is for one program"),
    ((errno.EACCES, errno.EPERM), (), ("Access is denied", "PermissionError"),
     "the port may not be opened by this user", f"Ask for the permission{_NO_PERMISSION}"),
    ((errno.ENOENT, errno.ENODEV, errno.ENXIO), (), ("FileNotFoundError",),
     "there is no such port", "Check cable and power. {present}"),
    ((errno.ENOTTY,), (), ("Inappropriate ioctl",), "is no serial port", "{present}"),
    ((), (ConnectionRefusedError,), ("refused",),
     "nobody listens at this address", "Check host, port number and power"),
    ((), (TimeoutError,), ("timed out",),
     f"no connection within {CONNECT_WITHIN_S:g} s", "Check address, cable and firewall"),
    ((), (socket.gaierror,), (), "no computer of this name is known", "Check the address"),
)  # fmt: skip
"""By codes, kinds and words of an error: what is wrong, and what to check."""


def _refused(port: str, error: Exception) -> CmmUqError:
    code, text = getattr(error, "errno", None), str(error)
    for codes, kinds, words, problem, fix in _REFUSALS:
        if code in codes or isinstance(error, kinds) or any(word in text for word in words):
            names = ", ".join(name for name, _ in serial_ports()) if "{present}" in fix else ""
            present = f"Ports here: {names}" if names else "No serial port is here"
            return CmmUqError(problem, where=port, fix=fix.format(present=present))
    return CmmUqError(f"cannot be opened: {text}", where=port, fix="Check port, cable and settings")


def serial_ports() -> list[tuple[str, str]]:
    """Name and description of the serial ports of this computer."""
    from serial.tools import list_ports

    found = ((port.device, str(port.description)) for port in list_ports.comports())
    return sorted((name, "" if description == "n/a" else description) for name, description in found)


class EndOfFileError(PortLostError):
    """The file has been replayed."""


class ReplayedFile:
    """A file as a port, ``file:NAME?every_s=S`` a line in that time; what is written to it goes nowhere."""

    def __init__(self, port: str, folder: Path, clock: Clock) -> None:
        name, _, query = port.removeprefix(FILE).partition("?")
        path, options = folder / name, parse_qs(query)
        check_file(path, "Name a file of received bytes: file:NAME")
        try:
            (text,) = options.pop("every_s", ["0"])
            self._every_s, self._clock = float(text), clock
            if options or not 0 <= self._every_s < 1e6:
                raise ValueError
        except ValueError:
            raise CmmUqError("says no pace", where=port, fix="Write it as file:NAME?every_s=0.1") from None
        self._file = path.open("rb")

    def read(self, *, wait: bool = True) -> bytes:
        received = self._file.readline(_REPLAYED) if self._every_s else self._file.read(_REPLAYED)
        if not received:
            raise EndOfFileError("the file is at its end")
        if self._every_s:
            self._clock.sleep(self._every_s)
        return received

    def write(self, data: bytes) -> None: ...

    def close(self) -> None:
        self._file.close()
