"""Profiles by name, ready ones and users' own; a new one from an example line; and an instrument tried out with one.

Which question is asked of an instrument when, and to which one an answer belongs.
"""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from functools import cache
from importlib.resources import files
from pathlib import Path

from cmm_uq.base.errors import CmmUqError, suggestion
from cmm_uq.base.files.csv_table import column_problem
from cmm_uq.base.files.limits import JOB_BYTES, TEXT, content_of
from cmm_uq.base.files.table import unit_of
from cmm_uq.base.files.toml_file import checked
from cmm_uq.base.messages import Text, say
from cmm_uq.base.values import dataclass, field
from cmm_uq.jobs.tables.plan import DeclaredSource
from cmm_uq.laboratory.live.instruments.parsing import check_profile, check_unit
from cmm_uq.laboratory.live.instruments.profile import NUMBER, ProfileFile, ProfileQuantity, Send, bytes_of, shown
from cmm_uq.laboratory.live.instruments.source import SECOND, Event, Reading, Returned

ENDING = ".toml"


def ready() -> tuple[str, ...]:
    return tuple(sorted(path.name.removesuffix(ENDING) for path in _folder().iterdir() if path.name.endswith(ENDING)))


def profile_named(name: str, folder: Path = Path()) -> ProfileFile:
    if not name.endswith(ENDING):
        return _ready(name)
    fix = "Name a profile: cmm-uq instruments list shows those that are ready"
    return profile_of(content_of(folder / name, JOB_BYTES, fix), folder / name)


@cache
def _ready(name: str) -> ProfileFile:
    if name not in ready():
        fix = f"{suggestion(name, ready())} A profile of your own ends in .toml"
        raise CmmUqError(f"there is no profile {name!r}", fix=fix)
    return profile_of((_folder() / f"{name}{ENDING}").read_bytes(), Path(f"{name}{ENDING}"))


def profile_of(content: bytes, path: Path) -> ProfileFile:
    found = checked(content, path, ProfileFile, most_word=TEXT.most)
    check_profile(found, str(path))
    return found


def profile_of_source(declared: DeclaredSource, folder: Path) -> ProfileFile:
    """The profile of a source, with the units that the job says its instrument is set to."""
    profile = profile_named(declared.profile, folder)
    quantities, named = dict(profile.quantities), profile.named()
    for name, unit in declared.units.items():
        where, quantity = f"[[acquire.source]] {declared.name}: units", quantities.get(name, ProfileQuantity())
        if name not in named:
            raise CmmUqError(f"the instrument gives no {name!r}", where=where, fix=suggestion(name, named))
        if quantity.unit_group or profile.protocol == "ipp":
            raise CmmUqError(f"the instrument says itself in which unit {name} is", where=where, fix="Leave it out")
        check_unit(name, unit, where)
        quantities[name] = quantity.model_copy(update={"unit": unit})
    return profile.model_copy(update={"quantities": quantities})


def unsaid_units(profile: ProfileFile, declared: DeclaredSource) -> dict[str, str]:
    """Units, by quantity, that the instrument does not say: the job's, else the profile's, else those of the names."""
    if profile.protocol == "ipp":
        return {}
    found = {}
    for name in sorted(set(declared.values) & profile.named() or profile.named()):
        quantity = profile.quantities.get(name, ProfileQuantity())
        unit = quantity.unit or unit_of(name) or unit_of(declared.values.get(name, name))
        if unit and not quantity.unit_group:
            found[name] = unit
    return found


def _folder() -> Path:
    return Path(str(files("cmm_uq") / "laboratory" / "live" / "instruments" / "profiles"))


_FOUND = re.compile(r"(?:[-+]\s*|(?<![\w.]))\d+(?:\.\d+)?(?:[Ee][-+]?\d+)?|(?<=[A-Za-z_])\d+\.\d+")
"""The 1 of CH1 is none, the 20.1 of T20.1 is one."""


@dataclass(frozen=True)
class ProfileDraft:
    """What a new profile says; quantities by the place of their number in the line, from 1."""

    name: str
    title: str
    line: str  # an example, as it comes, with or without its end
    quantities: Mapping[int, str]
    ranges: Mapping[str, Sequence[float]]  # least and largest plausible value by quantity
    ask: str = ""  # what is sent to get a line; empty where they come by themselves
    every_s: float = 1.0  # how often it is asked
    settings: Mapping[str, str | int] | None = None


def numbers_in(line: str) -> list[str]:
    return [found[0] for found in _FOUND.finditer(without_end(line))]


def without_end(text: str) -> str:
    return re.sub(r"(?:<CR>|<LF>|\r|\n)+$", "", text)


def terminator_of(text: str) -> str:
    """The end of an example; a line feed where it shows none, which nearly all lines end with."""
    end = text[len(without_end(text)) :].replace("\r", "<CR>").replace("\n", "<LF>")
    return end or "<LF>"


def range_of(text: str, name: str) -> tuple[float, float]:
    """Least and largest value, of ``0:40``."""
    low, _, high = text.partition(":")
    try:
        found = float(low), float(high)
    except ValueError:
        found = (1.0, 0.0)
    if not found[0] < found[1]:
        raise CmmUqError(f"{text!r} is no range", where=f"range of {name}", fix="Write it as 0:40")
    return found


def drafted(wanted: ProfileDraft) -> bytes:
    line = without_end(wanted.line)
    found = list(_FOUND.finditer(line))
    for place, name in wanted.quantities.items():
        if not 1 <= place <= len(found):
            raise CmmUqError(f"the line has {len(found)} numbers, so none with the number {place}", where="--quantity",
                             fix="Count them from 1")  # fmt: skip
        if problem := column_problem(name) or ("" if name.isidentifier() else "letters, digits and _ only"):
            fix = "Name it as temp_c or x_mm, with its unit at its end"
            raise CmmUqError(f"{name!r} cannot name a quantity: {problem}", where="--quantity", fix=fix)
    if not wanted.quantities:
        fix = "Name one as temp_c=1, the line's first number"
        raise CmmUqError("no quantity is named", where="--quantity", fix=fix)
    pattern, place = "^", 0
    for number, one in enumerate(found, 1):
        pattern += _literal(line[place : one.start()])
        named = wanted.quantities.get(number)
        pattern += f"(?P<{named}>{NUMBER})" if named else NUMBER
        place = one.end()
    pattern += _literal(line[place:]) + r"\s*$"
    values = {name: float("".join(found[number - 1][0].split())) for number, name in wanted.quantities.items()}
    return "\n".join(_lines(wanted, pattern, values)).encode()


def _lines(wanted: ProfileDraft, pattern: str, values: Mapping[str, float]) -> list[str]:
    end, settings = terminator_of(wanted.line), wanted.settings or {}
    plain_name = re.sub(r"[^a-z0-9.-]+", "-", wanted.name.lower()).strip("-.") or "instrument"
    lines = [
        f"name = {_toml_text(plain_name)}", f"title = {_toml_text(wanted.title)}", "", "[connection]",
        *(f"{key} = {_toml_text(given) if isinstance(given, str) else given}" for key, given in settings.items()),
        "", "[frame]", f"terminator = {_toml_text(end)}", "", "[send]",
    ]  # fmt: skip
    if wanted.ask:
        lines += [f"poll = [{{ send = {_toml_text(wanted.ask)} }}]", f"every_s = {wanted.every_s:g}"]
    else:
        lines += ["silent_after_s = 10"]
    lines += ["", "[parse]", "# Each number that is a quantity has its name in the pattern; blanks fit any number of blanks.",
              f"pattern = {_toml_text(pattern)}", "ignore = ['\\s*']"]  # fmt: skip
    for name in values:
        if name in wanted.ranges:
            low, high = wanted.ranges[name]
            lines += ["", f"[quantities.{name}]", f"range = [{low:g}, {high:g}]"]
    said = ", ".join(f"{name} = {value!r}" for name, value in values.items())
    return [
        *lines, "", "[[example]]", f"received = {_toml_text(without_end(wanted.line) + end)}", f"values = {{ {said} }}", "",
        "[facts]", 'not_found = ["what the instrument says when something is wrong: add [[ill]] for it"]', "",
    ]  # fmt: skip


def _literal(text: str) -> str:
    """Text that must be there, with as many blanks as there may be."""
    return r"\s*+".join(
        "".join(re.escape(chr(byte)) if 32 <= byte < 127 else f"\\x{byte:02x}" for byte in bytes_of(part))
        for part in re.split(r"\s+", text)
    )


def _toml_text(text: str) -> str:
    """A literal text of TOML; one with a single quote in it in the other way."""
    if "'" not in text and text.isprintable():
        return f"'{text}'"
    escaped = text.replace("\\", "\\\\").replace('"', '\\"')
    return '"' + "".join(c if c.isprintable() else f"\\u{ord(c):04X}" for c in escaped) + '"'


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
    profile: ProfileFile
    port: str
    messages: int = 0
    with_values: int = 0
    wrong: int = 0
    answers: int = 0
    unasked: int = 0
    quantities: dict[str, float] = field(default_factory=dict)
    received: bytes = b""  # the last bytes that were not understood, or else that came
    told: str = ""  # the last that was wrong

    def take(self, event: Event) -> None:
        if not isinstance(event, Reading):
            return
        self.messages += 1
        self.with_values += bool(event.values)
        self.unasked += event.unasked
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


PAUSE = SECOND // 2  # after an answer that did not come, or that is no question's: a late one is then that of none


class Conversation:
    """Questions to one instrument, one after the other, a round every so often; moments are of the monotonic clock, ns.

    An answer belongs to a question only where that is the one that is open: a further one is that of none, and where several
    are open, of any. Then nothing is asked for a while, what still comes is that of none, and the question is asked anew.
    A silent instrument (``gap``) is asked without regard to the rounds, so that its return is noticed.
    """

    def __init__(self, send: Send, now: int, *, replayed: bool = False) -> None:
        self._polls = [(bytes_of(poll.send), poll.messages) for poll in send.poll]
        self._every, self._patience = round(send.every_s * SECOND), round(send.answer_within_s * SECOND)
        silent = send.silent_after_s
        self._silence = None if self._polls or silent is None or replayed else round(silent * SECOND)
        self._replayed, self._by_itself = replayed, replayed or send.unasked or not self._polls
        self._due = self._since = self._asked_at = self._heard_at = self._pause = now
        self._open = self._left = 0  # questions without their answer; messages that the last one's still lacks
        self.kept_since: int | None = None  # since when answers to nothing keep a due question from being asked
        self.asked = 0 if replayed else -1
        self.waiting = self.gap = False

    @property
    def expects(self) -> bool:
        """Whether a message with values may come now; else it comes before a question."""
        return self.waiting or self._by_itself

    def question(self, now: int) -> bytes | None:
        """What to send now; ``None``: nothing yet."""
        if not self._polls or self._replayed:
            return None
        if self.waiting:
            if not self.gap or len(self._polls) > 1 or now - self._asked_at < min(self._patience, SECOND):
                return None
            return self._sent(now)
        following = (self.asked + 1) % len(self._polls)
        if following == 0 and now < self._due and not self.gap:
            return None
        if now < self._pause:
            self.kept_since = now if self.kept_since is None else self.kept_since
            return None
        if following == 0:
            self._due += self._every * max(1, 1 + (now - self._due) // self._every)
        self.asked, self.waiting, self._since = following, True, now
        return self._sent(now)

    def _sent(self, now: int) -> bytes:
        question, self._left = self._polls[self.asked]
        self._asked_at, self.kept_since = now, None
        self._open += 1
        return question

    def heard(self, now: int) -> None:
        self._heard_at = now

    def answered(self, now: int) -> Text | None:
        """Take note of an answer; why it is that of no question, ``None`` where it is, or where none is needed."""
        if self._by_itself or (self.waiting and self._open == 1):
            self._left -= 1
            if self._by_itself or not self._left:
                self._open, self.waiting = 0, False
            self.gap = False
            if self._replayed and self._polls:
                self.asked = (self.asked + 1) % len(self._polls)
            return None
        questions, self._pause = self._open, now + PAUSE
        if not self.waiting:
            self._open = max(0, questions - 1)
            return say("it comes too late") if questions else say("nobody had asked")
        self._open, self.waiting, self.gap = 0, False, False
        self.asked, self._due = self.asked - 1, min(self._due, self._pause)
        return say("{count} questions have no answer yet, and it may be that of any", count=questions)

    def overdue(self, now: int) -> bool:
        """Whether an answer did not come in time, or an instrument that speaks by itself is silent; said once each time."""
        if self.waiting and now - self._since >= self._patience:
            self.waiting = False
            self._pause = now + PAUSE if len(self._polls) > 1 else now
            return True
        if self.kept_since is not None and now - self.kept_since >= self._patience + PAUSE:
            self.kept_since = now
            return True
        if self._silence is not None:
            allowed = min(self._silence, SECOND) if self.gap else self._silence
            if now - self._heard_at >= allowed:
                self._heard_at = now
                return True
        return False
