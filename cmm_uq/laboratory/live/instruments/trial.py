"""An instrument tried out: each message beside what was understood of it, and in the end what to check where nothing was."""

from __future__ import annotations

from dataclasses import dataclass, field

from cmm_uq.base.errors import CmmUqError
from cmm_uq.laboratory.live.instruments.profile import ProfileFile, shown
from cmm_uq.laboratory.live.instruments.source import Event, Reading, Returned

_SAYS = ("the instrument says", "the machine says")  # how words of the instrument begin
_LETTERS = {"none": "N", "even": "E", "odd": "O", "mark": "M", "space": "S"}


def beside(event: Event) -> tuple[str, str]:
    """What came, as control codes are written, and what it says."""
    if isinstance(event, Reading):
        values = ", ".join(f"{name} = {value:.10g}" for name, value in event.values.items())
        return shown(event.raw), "; ".join(filter(None, (event.point, values, event.status))) or "–"
    if isinstance(event, Returned):
        return "", f"back after {event.after_s:.1f} s"
    return "", f"silent: {event.why}"


@dataclass
class Trial:
    """What came of an instrument, counted."""

    profile: ProfileFile
    port: str
    messages: int = 0
    with_values: int = 0
    wrong: int = 0
    answers: int = 0
    quantities: dict[str, float] = field(default_factory=dict)
    received: bytes = b""  # the last bytes that were not understood, or else that came
    told: str = ""  # the last that was wrong

    def take(self, event: Event) -> None:
        if not isinstance(event, Reading):
            return
        self.messages += 1
        self.with_values += bool(event.values)
        self.quantities |= event.values
        if event.status is not None:
            self.wrong += 1
            self.told, self.received = str(event.status), event.raw
            self.answers += event.status.startswith(_SAYS)
        elif not self.wrong:
            self.received = event.raw

    def conclude(self) -> None:
        """Refuse an instrument that gave no value, with what was seen, what was expected and what to check."""
        if self.with_values or (self.profile.protocol == "ipp" and not self.wrong):
            return
        expected = next((one.received for one in self.profile.example if one.values), "")
        like = f"; expected like {expected[:60]}" if expected else ""
        if not self.messages:
            settings = "" if "://" in self.port else f"the settings (the profile has {self.settings}), "
            speaks = "be asked" if self.profile.send.poll else "send by itself"
            fix = f"Check power and cable (crossed or straight), {settings}that it is set to {speaks}"
            raise CmmUqError(f"nothing came{like}", where=self.port, fix=fix)
        seen = shown(self.received[:60])
        if self.answers:
            fix = "See its display and manual"
            raise CmmUqError(f"the instrument answers, but gives no value: {self.told}", where=self.port, fix=fix)
        if sum(byte >= 0x80 or byte == 0 for byte in self.received) > len(self.received) / 4:
            fix = f"Check baud rate, data bits and parity: the profile has {self.settings}"
            raise CmmUqError(f"what comes is no text: {seen}{like}", where=self.port, fix=fix)
        fix = "Check that it is this instrument, and its settings"
        raise CmmUqError(f"what comes is not understood: {seen}{like}", where=self.port, fix=fix)

    @property
    def settings(self) -> str:
        """Of the line: ``9600 7E1``."""
        line = self.profile.connection
        return f"{line.baud} {line.data_bits}{_LETTERS[line.parity]}{line.stop_bits}"
