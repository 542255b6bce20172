"""A declared source made ready: its profile, its port, the instrument at it."""

from __future__ import annotations

from functools import partial
from pathlib import Path

from cmm_uq.jobs.acquire import DeclaredSource
from cmm_uq.laboratory.live.instruments.instrument import Instrument
from cmm_uq.laboratory.live.instruments.ipp.machine import open_machine
from cmm_uq.laboratory.live.instruments.library import profile_named
from cmm_uq.laboratory.live.instruments.ports import FILE, NETWORK, RFC2217, opener
from cmm_uq.laboratory.live.instruments.profile import ProfileFile
from cmm_uq.laboratory.live.instruments.replay import ReplayedFile
from cmm_uq.laboratory.live.instruments.source import SYSTEM, Clock, Identity, Source


def open_source(declared: DeclaredSource, *, clock: Clock = SYSTEM, folder: Path = Path()) -> Source:
    """The source that a job declares, with its port open.

    Parameters
    ----------
    declared : one ``[[acquire.source]]``.
    clock : by which readings are stamped.
    folder : of the job: profiles and replayed files of its own lie in it.

    Raises
    ------
    CmmUqError : there is no such profile, or the port is absent, busy or forbidden.
    """
    profile = profile_named(declared.profile, folder)
    identity = Identity(
        declared.name, profile.maker or None, profile.model or None, declared.serial or None,
        certificate=declared.certificate or None,
    )  # fmt: skip
    if profile.protocol == "ipp":
        return open_machine(identity, profile, declared.port, clock)
    return instrument(identity, profile, declared.port, clock, folder)


def instrument(identity: Identity, profile: ProfileFile, port: str, clock: Clock, folder: Path) -> Instrument:
    """An instrument that speaks as a profile says.

    Raises
    ------
    CmmUqError : the port cannot be opened, or another instrument is there.
    """
    if port.startswith(FILE):
        return Instrument(identity, profile, partial(ReplayedFile, port, folder, clock), clock)
    far = port.startswith((*NETWORK, RFC2217))
    return Instrument(identity, profile, opener(port, profile.connection), clock, reopen_when_silent=far)
