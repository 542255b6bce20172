"""An open port, whatever is behind it."""

from __future__ import annotations

from typing import Protocol

TICK_S = 0.05
"""Longest wait for bytes; whoever waits longer looks at the clock in between."""


class PortLostError(Exception):
    """The port is gone: unplugged, closed by the other side, or switched off."""


class Port(Protocol):
    """An open port."""

    def read(self) -> bytes:
        """What came, as soon as anything comes; empty where nothing did within :data:`TICK_S`.

        Raises
        ------
        PortLostError : the port is gone.
        """
        ...

    def write(self, data: bytes) -> None:
        """Send.

        Raises
        ------
        PortLostError : the port is gone.
        """
        ...

    def close(self) -> None:
        """Give it back."""
        ...
