"""Instruments from the command line: ready profiles, one tried at its port, a new one from an example line."""

from __future__ import annotations

import contextlib
import os
import re
import tempfile
import threading
from collections.abc import Iterator
from pathlib import Path

from cmm_uq.base.errors import CmmUqError, suggestion
from cmm_uq.base.output.new_file import write_new
from cmm_uq.jobs.tables.plan import DeclaredSource
from cmm_uq.laboratory.live.instruments import library
from cmm_uq.laboratory.live.instruments.instrument import open_source
from cmm_uq.laboratory.live.instruments.simulated_line import SPEAKERS, WAYS, SimulatedLine
from cmm_uq.laboratory.live.instruments.source import Event, LiveSource


def ready_profiles() -> list[tuple[str, str, str]]:
    """Name, title and what it was tried on, of each."""
    profiles = map(library.profile_named, library.ready())
    return [(profile.name, profile.title, profile.facts.tried) for profile in profiles]


def declared(what: str, port: str, job: Path | None) -> tuple[DeclaredSource, Path]:
    """The source that is meant, and the folder that its files lie in.

    port : at which it is; empty where the job says it.
    """
    if job is None:
        name = re.sub(r"[^A-Za-z0-9._-]", "_", Path(what).name.removesuffix(library.ENDING))
        return DeclaredSource.model_construct(name=name or "instrument", profile=what, port=port), Path()
    from cmm_uq.app.commands.reading import read_job

    read = read_job(job, recorded=False)
    sources = {source.name: source for source in read.facts.acquire.source}
    if what not in sources:
        raise CmmUqError(f"the job has no source {what!r}", where=f"{job}: [acquire]", fix=suggestion(what, sources))
    source = sources[what]
    return (source.model_copy(update={"port": port}) if port else source), read.folder


class Attempt:
    """An instrument that is open, and what came of it so far.

    what, port, job : see :func:`declared`.
    """

    def __init__(self, what: str, port: str, job: Path | None) -> None:
        source, folder = declared(what, port, job)
        profile = library.profile_of_source(source, folder)
        self.trial = library.Trial(profile, source.port)
        self.source: LiveSource = open_source(source, folder=folder)
        self._stop = threading.Event()

    def events(self, seconds: float | None) -> Iterator[Event]:
        """What comes, for some time or until nobody asks any more."""
        timer = threading.Timer(seconds, self._stop.set) if seconds is not None else None
        if timer is not None:
            timer.daemon = True
            timer.start()
        try:
            for event in self.source.events(self._stop):
                self.trial.take(event)
                yield event
        finally:
            if timer is not None:
                timer.cancel()
            self.source.close()


def write_profile(out: Path, wanted: library.ProfileDraft) -> None:
    if out.suffix != library.ENDING:
        raise CmmUqError("a profile's file ends in .toml", where=str(out), fix=f"Name it {out.stem or 'my-gauge'}.toml")
    content = library.drafted(wanted)
    library.profile_of(content, out)
    write_new(out, content)


@contextlib.contextmanager
def simulated_instrument(profile: str, way: str) -> Iterator[str]:
    """A simulated instrument, at the port that is given, until it is left.

    way : ``pty``, ``socket`` or ``rfc2217``; empty for the usual one.
    """
    if library.profile_named(profile).protocol == "ipp":
        from cmm_uq.laboratory.live.instruments.ipp_server import SimulatedIppServer as SimulatedMachine

        machine = SimulatedMachine()
        try:
            yield machine.url
        finally:
            machine.close()
        return
    if profile not in SPEAKERS:
        raise CmmUqError(f"there is no simulation of {profile!r}", fix=suggestion(profile, SPEAKERS))
    usual = "socket" if os.name == "nt" else "pty"
    chosen = next((one for one in WAYS if one == (way or usual)), None)
    if chosen is None or (chosen == "pty" and os.name == "nt"):
        raise CmmUqError(f"{way!r} is no way to a simulated instrument here", where="--way", fix=suggestion(way, WAYS))
    own = SPEAKERS[profile]()
    with tempfile.TemporaryDirectory(prefix="cmm-uq-") as folder, SimulatedLine(own, chosen, Path(folder)) as line:
        yield line.port
