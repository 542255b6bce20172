"""Instruments that speak only GPIB or USB-TMC, by pyvisa, which is installed with ``cmm-uq[visa]``.

Nothing is read before something was asked: many instruments take a reading without a question for an error.
"""

from __future__ import annotations

import contextlib
import time
from typing import Any

from cmm_uq.base.errors import CmmUqError
from cmm_uq.laboratory.live.instruments.port import TICK_S, PortLostError

SCHEME = "visa://"
"""Begins the name of a port that VISA knows: ``visa://GPIB0::17::INSTR``."""


class VisaPort:
    """An instrument by VISA.

    Parameters
    ----------
    port : ``visa://RESOURCE``.
    library : of VISA; empty for the one that pyvisa finds.

    Raises
    ------
    CmmUqError : pyvisa is not installed, or the resource cannot be opened.
    """

    def __init__(self, port: str, library: str = "") -> None:
        try:
            import pyvisa
        except ImportError:
            raise CmmUqError("needs pyvisa, which is not installed", where=port,
                             fix='Install it: pip install "cmm-uq[visa]"') from None  # fmt: skip
        self._failures = (pyvisa.errors.VisaIOError, pyvisa.errors.InvalidSession, OSError, ValueError)
        self._timed_out = pyvisa.constants.StatusCode.error_timeout
        self._asked = False
        try:
            self._visa: Any = pyvisa.ResourceManager(library).open_resource(
                port.removeprefix(SCHEME), timeout=TICK_S * 1e3
            )
        except self._failures as error:
            raise CmmUqError(f"cannot be opened: {error}", where=port,
                             fix="Check address and cable; pyvisa-info says which VISA is there") from None  # fmt: skip

    def read(self) -> bytes:
        """See :meth:`cmm_uq.laboratory.live.instruments.ports.Port.read`."""
        if not self._asked:
            time.sleep(TICK_S)
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
        """See :meth:`cmm_uq.laboratory.live.instruments.ports.Port.write`."""
        try:
            self._visa.write_raw(data)
        except self._failures as error:
            raise PortLostError(str(error)) from None
        self._asked = self._asked or b"?" in data

    def close(self) -> None:
        """See :meth:`cmm_uq.laboratory.live.instruments.ports.Port.close`."""
        with contextlib.suppress(*self._failures):
            self._visa.close()
