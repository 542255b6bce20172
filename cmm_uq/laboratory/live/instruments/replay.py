"""A file of received bytes, replayed as a port: as fast as possible, or at a pace (``file:NAME?every_s=0.1``)."""

from __future__ import annotations

from pathlib import Path
from urllib.parse import parse_qs

from cmm_uq.base.errors import CmmUqError
from cmm_uq.base.files.content import check_file
from cmm_uq.laboratory.live.instruments.port import PortLostError
from cmm_uq.laboratory.live.instruments.ports import FILE, file_named
from cmm_uq.laboratory.live.instruments.source import Clock

_CHUNK = 4096


class EndOfFileError(PortLostError):
    """The file has been replayed."""


class ReplayedFile:
    """A file as a port; what is written to it goes nowhere.

    Parameters
    ----------
    port : ``file:NAME``, with ``?every_s=S`` where each line is to take that time.
    folder : in which the file lies.
    clock : that waits.

    Raises
    ------
    CmmUqError : there is no such file, or the pace is none.
    """

    def __init__(self, port: str, folder: Path, clock: Clock) -> None:
        path = file_named(port, folder)
        check_file(path, "Name a file of received bytes: file:NAME")
        self._every_s, self._clock = _pace(port), clock
        self._file = path.open("rb")

    def read(self) -> bytes:
        """See :meth:`cmm_uq.laboratory.live.instruments.ports.Port.read`: a line where there is a pace, else a block."""
        received = self._file.readline(_CHUNK) if self._every_s else self._file.read(_CHUNK)
        if not received:
            raise EndOfFileError("the file is at its end")
        if self._every_s:
            self._clock.sleep(self._every_s)
        return received

    def write(self, data: bytes) -> None:
        """See :meth:`cmm_uq.laboratory.live.instruments.ports.Port.write`."""

    def close(self) -> None:
        """See :meth:`cmm_uq.laboratory.live.instruments.ports.Port.close`."""
        self._file.close()


def _pace(port: str) -> float:
    given = parse_qs(port.removeprefix(FILE).partition("?")[2])
    try:
        (text,) = given.pop("every_s", ["0"])
        found = float(text)
        if given or not 0 <= found < 1e6:
            raise ValueError
    except ValueError:
        raise CmmUqError("says no pace", where=port, fix="Write it as file:NAME?every_s=0.1") from None
    return found
