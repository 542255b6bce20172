"""One message of an instrument: its bytes as received, what they say, and when they came by two clocks."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from cmm_uq.base.messages import Text


@dataclass(frozen=True)
class Reading:
    """One message of an instrument, as received and as understood.

    Parameters
    ----------
    source : the name in the job, unique.
    number : counts the messages of this source since it was opened, from 1.
    utc_ns : wall clock when its last byte arrived, ns since 1970.
    monotonic_ns : monotonic clock at the same moment, ns.
    raw : bytes as received, framing included.
    values : by the quantity's name with its unit, ``{"temp_c": 20.01}``; empty where the message was not understood.
    status : what the instrument says is wrong with it, or what is wrong with the message; ``None``: sound.
    point : for a CMM what was measured (``PtMeas``), else ``None``.
    """

    source: str
    number: int
    utc_ns: int
    monotonic_ns: int
    raw: bytes
    values: Mapping[str, float]
    status: Text | None = None
    point: str | None = None
