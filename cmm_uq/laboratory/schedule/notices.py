"""What a person must hear of, and the messages that say it: each waits in a file of its own until it was sent.

A message is written before its job counts as done, and removed after its having been sent is remembered. A crash between
the server's answer and that moment sends it a second time under the same key: a warning that comes twice does no harm,
one that never comes does.
"""

from __future__ import annotations

import contextlib
import datetime as dt
import hashlib
import json
import threading
import time
from collections.abc import Callable, Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any, Literal, Protocol, get_args

from cmm_uq.base.errors import CmmUqError
from cmm_uq.base.messages import Text, Verbatim, commas, day, plural, say
from cmm_uq.base.output.manifest import writing_to
from cmm_uq.base.output.staging import replace_file
from cmm_uq.base.values import asdict, dataclass
from cmm_uq.jobs.verdicts import AGREES, Verdicts
from cmm_uq.laboratory.schedule.state import AHEAD, PRIVATE, Dispatch, FolderState, turn

Event = Literal["fail", "incomplete", "undecided", "mismatch", "drift", "due", "missed", "error"]
EVENTS: tuple[Event, ...] = get_args(Event)

_OF_OUTCOME: Mapping[str, Event] = {"fail": "fail", "conditional fail": "fail", "incomplete": "incomplete"}
"""Event of a statement of conformity; a pass is none, and every other word leaves it undecided."""

_OF_VERDICT: Mapping[str, Text] = {
    "explained": say("the recording contradicts its model, and the diagnosis names what was left out"),
    "partial": say("the recording contradicts its model, and the diagnosis names only part of what was left out"),
    "empirical": say(
        "the recording contradicts its model, and a function that was fitted predicts it, but no known effect"
    ),
    "unexplained": say("the recording contradicts its model, and no known effect accounts for it"),
}
_CONTRADICTS = say("the recording contradicts its model")


@dataclass(frozen=True)
class Notice:
    """Something that a person must hear of, once."""

    event: Event
    about: str  # job, machine, artefact or folder that it is about
    title: Text  # in a few words; the subject of an e-mail
    text: Text
    state: str = ""  # which state of it: another state is told again, the same is not
    where: str = ""  # folder in which to look

    @property
    def key(self) -> str:
        """Of the notice: the same whenever the same is to be said."""
        said = "\0".join((self.event, self.about, self.state))
        return hashlib.sha256(said.encode()).hexdigest()[:32]


def of_results(results: Mapping[str, Any], inputs: str, where: str) -> list[Notice]:
    """What has to be said of a certificate, at most one notice an event; none where all is well."""
    job = results.get("job", {})
    name, machine = Verbatim(str(job.get("id", ""))), Verbatim(str(job.get("machine") or ""))
    of = say("{machine} (job {name})", machine=machine, name=name) if machine else say("job {name}", name=name)
    told: dict[Event, list[Text]] = {}
    for one in Verdicts.of_results(results):
        if one.standing != "good":
            standard, called, said = Verbatim(one.by), Verbatim(one.name), Verbatim(one.outcome)
            text = say(
                "{standard} {characteristic}: {decision}", standard=standard, characteristic=called, decision=said
            )
            if not one.by:
                text = say("{name}, tolerance: {decision}", name=Verbatim(one.title or one.name), decision=said)
            elif not one.name:
                text = say("{standard}: {decision}", standard=standard, decision=said)
            told.setdefault(_OF_OUTCOME.get(one.outcome, "undecided"), []).append(text)
    verdict = str((results.get("diagnosis") or {}).get("verdict") or "consistent")
    if verdict not in AGREES:
        told.setdefault("mismatch", []).append(_OF_VERDICT.get(verdict, _CONTRADICTS))
    return [
        Notice(event, str(name), say("{event}: {of}", event=Verbatim(event), of=of),
               say("{of}: {said}.", of=of, said=commas(said)), inputs, where)
        for event, said in told.items()
    ]  # fmt: skip


def of_error(error: CmmUqError, about: str, since: str) -> Notice:
    """Of a job or a folder that could not be reported; what was mended and comes back later is told again."""
    title = say("error: {about}", about=Verbatim(about))
    return Notice("error", about, title, Verbatim(str(error)), f"{error} since {since}", error.where or "")


def of_due(item: str, called: str, due: dt.date, on: dt.date, why: Text, *, beyond: bool = False) -> Notice:
    """Of a machine or an artefact that is to be calibrated by a day: once before it, and once after it."""
    overdue = beyond or due < on
    state = say("overdue since {due}", due=day(due)) if overdue else say("due on {due}", due=day(due))
    capital, name = Verbatim(item.capitalize()), Verbatim(called)
    title = say("{state}: {item} {called}", state=state, item=Verbatim(item), called=name)
    text = say("{item} {called} is {state}: {why}.", item=capital, called=name, state=state, why=why)
    return Notice("due", f"{item} {called}", title, text, f"{due.isoformat()} {'overdue' if overdue else 'due'}")


def of_drift(machine: str, changed: Sequence[Text], entry: int) -> Notice:
    """What has to be said of a machine that changed by more than chance since the recording before."""
    of = say("machine {machine}", machine=Verbatim(machine))
    said = commas(changed)
    text = say("{of} changed by more than chance since the recording before: {changed}.", of=of, changed=said)
    return Notice("drift", f"machine {machine}", say("drift: {of}", of=of), text, str(entry))


def of_missed(last: dt.datetime, begun: dt.datetime, missed: Sequence[dt.datetime]) -> Notice:
    """Of starts since the last run without one; of a clock that was set back where there are none."""
    times = [Verbatim(f"{one:%Y-%m-%d %H:%M}") for one in (last, begun, *missed)]
    if not missed:
        text = say("the last run began on {last}, and the clock says {now}: one is wrong", last=times[0], now=times[1])
        return Notice("missed", "the clock", say("a wrong clock"), text, last.isoformat())
    listed = times[2:] if len(missed) <= MOST else [*times[2 : MOST // 2], Verbatim("…"), *times[-MOST // 2 :]]
    title = plural(len(missed), one=say("1 run was missed"), many=say("{count} runs were missed", count=len(missed)))
    text = say("{count}, after the run of {last}: {times}. What was due then is done and said now.",
               count=title, last=times[0], times=commas(listed))  # fmt: skip
    return Notice("missed", "the runs", title, text, f"{last.isoformat()} {missed[-1].isoformat()}")


def decisions(results: Mapping[str, Any]) -> list[str]:
    """Every decision of conformity on a certificate, in its order."""
    return [one.outcome for one in Verdicts.of_results(results)]


class UndeliveredError(Exception):
    """A message did not go out; a later attempt may succeed. Its text holds no secret."""


@dataclass(frozen=True)
class OutgoingMessage:
    """What is sent of a notice; of texts only, so that it can wait in a file."""

    key: str  # the same whenever the same is sent the same way, so that a receiver knows a repetition
    event: str
    about: str
    title: str
    text: str
    where: str
    at: str  # moment at which it was found, UTC, ISO 8601

    def as_data(self) -> dict[str, str]:
        return asdict(self)

    @classmethod
    def of(cls, notice: Notice, channel: str, at: str) -> OutgoingMessage:
        """A notice on its way through a channel."""
        key = hashlib.sha256(f"{channel}\0{notice.key}".encode()).hexdigest()[:32]
        return cls(key, notice.event, notice.about, str(notice.title), str(notice.text), notice.where, at)


class Channel(Protocol):
    name: str  # what tells it from others, without a secret
    events: frozenset[str]  # that it is told of

    def send(self, message: OutgoingMessage) -> str:
        """Send a message; what is to be remarked of it, as a rule nothing."""


def within(seconds: float, call: Callable[[], str], who: str) -> str:
    """What a call returns, or no answer after so long, whatever it hangs in: a name server, a handshake, one byte a minute."""
    found: list[Any] = []

    def attempt() -> None:
        try:
            found.append(call())
        except Exception as error:
            found.append(error)

    thread = threading.Thread(target=attempt, name="message", daemon=True)
    thread.start()
    thread.join(seconds)
    if not found:
        raise UndeliveredError(f"{who} did not answer within {seconds:g} s")
    if isinstance(found[0], Exception):
        raise found[0]
    return str(found[0])


_MENDED = "Free the disk, or mend the permissions"
MOST = 20  # messages that one run sends one by one through a channel; what is beyond goes in one
LISTED = 200  # titles in a message of several
_EXIT_CODE = "exit code"  # by which a run tells whoever started it
_WAITING, _SENT, _UNFINISHED = ".json", ".sent", ".unfinished-"
_ABANDONED_S = 3600.0  # age at which nobody writes a file any more that takes milliseconds


@dataclass(frozen=True)
class Delivery:
    message: OutgoingMessage
    channel: str
    problem: str = ""  # why it did not go out; empty where it did
    remark: str = ""  # on one that went out


@dataclass(frozen=True)
class Announcement:
    """What stands, since when it is known, and whether this run is the one to say it in its exit code."""

    notice: Notice
    since: dt.datetime
    counts: bool = True


@dataclass(eq=False)
class Outbox:
    out: Path
    channels: Sequence[Channel]
    state: FolderState
    now: Callable[[], str]
    resumed: bool = False  # whether a run before ended in the middle, so that nobody saw its exit code

    @property
    def moment(self) -> dt.datetime:
        return dt.datetime.fromisoformat(self.now())

    @property
    def folder(self) -> Path:
        return self.out / PRIVATE / "outbox"

    def _messages(self, notice: Notice) -> list[tuple[Channel, OutgoingMessage]]:
        return [(channel, OutgoingMessage.of(notice, channel.name, self.now()))
                for channel in self.channels if notice.event in channel.events]  # fmt: skip

    def add(self, notices: Iterable[Notice]) -> list[Notice]:
        """Let notices go out that have not yet; those of them that were new to any channel."""
        added = []
        for notice in notices:
            new = [self._wait(message, channel.name) for channel, message in self._messages(notice)]
            added += [notice] if any(new) else []
        return added

    def announce(self, notices: Sequence[Notice]) -> list[Announcement]:
        """Let notices of what stands go out, and have the exit code say what is new, or was last said in another week.

        A week of the calendar, and not seven days: runs once a week are never exactly seven days apart, and a clock that was
        wrong hides nothing for longer.
        """
        self.add(notices)
        announced = []
        for notice in notices:
            message = OutgoingMessage.of(notice, _EXIT_CODE, self.now())
            content = {**message.as_data(), "channel": _EXIT_CODE}
            counts = notice.event != "error" and self.state.claim(message.key, content, self._again)
            known = self.state.sent(message.key)
            announced.append(Announcement(notice, min(known.first, self.moment) if known else self.moment, counts))
        return announced

    def _again(self, before: Dispatch | None) -> bool:
        return before is None or self.resumed or _week(before.last) != _week(self.moment)

    def _went_out(self, key: str) -> bool:
        """Whether a message went out; one by a clock that was ahead of this one may have said what is true only now."""
        known = self.state.sent(key)
        return known is not None and known.last <= self.moment + AHEAD

    def _surely_went_out(self, key: str) -> bool:
        """The same, as far as it can be known: not of records that were lost."""
        with contextlib.suppress(CmmUqError):
            return self._went_out(key)
        return False

    def sent_at_once(self, notices: Iterable[Notice]) -> list[Delivery]:
        """Send notices that cannot wait in a file; nothing of it is remembered."""
        return [
            Delivery(message, channel.name, *_attempt(channel, message))
            for notice in notices
            for channel, message in self._messages(notice)
            if not (self._place(message.key).exists() or self._surely_went_out(message.key))
        ]

    def waiting(self) -> int:
        return sum(1 for _ in self.folder.glob(f"*{_WAITING}")) if self.folder.is_dir() else 0

    def deliver(self, patience_s: float) -> list[Delivery]:
        """Send what waits, each channel until its first failure; nothing where another run is at it for longer."""
        if not self.folder.is_dir():
            return []
        with turn(self.out / PRIVATE / "messages.lock", patience_s=patience_s) as mine:
            if mine is None:
                return []
            for path in self.folder.parent.glob(f"*/{_UNFINISHED}*"):  # of a run that was killed in the middle of it
                with contextlib.suppress(OSError):
                    if time.time() - path.stat().st_mtime > _ABANDONED_S:
                        path.unlink()
            self._remember()
            done = self._send_all()
            self._remember()
            return done

    def _send_all(self) -> list[Delivery]:
        known, done = {channel.name: channel for channel in self.channels}, list[Delivery]()
        by_channel: dict[str, list[tuple[OutgoingMessage, Path]]] = {}
        for path in self.folder.glob(f"*{_WAITING}"):
            if (read := _read(path)) is None:
                continue
            if self._surely_went_out(read[0].key):  # a run beside this one was faster
                _drop(path)
            else:
                by_channel.setdefault(read[1], []).append((read[0], path))
        for name, waiting in by_channel.items():
            waiting.sort(key=lambda one: (one[0].at, one[0].key))
            if name not in known:
                why = "schedule.toml names it no longer: not sent"
                done += [Delivery(message, name, why) for message, _ in waiting]
                for _, path in waiting:
                    _drop(path)
                continue
            problem = ""
            for message, paths in _collected(waiting):
                if not problem:
                    problem, remark = _attempt(known[name], message)
                done.append(Delivery(message, name, problem, "" if problem else remark))
                for path in () if problem else paths:
                    with writing_to(path, _MENDED):
                        path.rename(path.with_suffix(_SENT))
        return done

    def _remember(self) -> None:
        """Have it in the state which messages went out; what cannot be remembered now stays for the next run."""
        for path in sorted(self.folder.glob(f"*{_SENT}")):
            read = _read(path)
            if read is None:
                continue
            message, name = read
            try:
                if not self._went_out(message.key):
                    self.state.add_sent(message.key, {**message.as_data(), "channel": name})
            except CmmUqError:
                return
            _drop(path)

    def _place(self, key: str) -> Path:
        return self.folder / f"{key}{_WAITING}"

    def _wait(self, message: OutgoingMessage, channel: str) -> bool:
        place = self._place(message.key)
        if place.exists() or place.with_suffix(_SENT).exists() or self._went_out(message.key):
            return False
        content = json.dumps({"channel": channel, "message": message.as_data()}, ensure_ascii=False)
        replace_file(place, content.encode(), _MENDED)
        return True


def _week(moment: dt.datetime) -> tuple[int, int]:
    """Year and week of the calendar (ISO 8601), where this computer stands."""
    return moment.astimezone().isocalendar()[:2]


def _read(path: Path) -> tuple[OutgoingMessage, str] | None:
    """A message and its channel; ``None`` of a file that is gone, or that somebody else put there."""
    try:
        data = json.loads(path.read_text(encoding="utf-8"))
        return OutgoingMessage(**{key: str(value) for key, value in data["message"].items()}), str(data["channel"])
    except (OSError, ValueError, TypeError, KeyError, AttributeError):
        return None


def _collected(waiting: Sequence[tuple[OutgoingMessage, Path]]) -> list[tuple[OutgoingMessage, list[Path]]]:
    """Messages one by one with their files; of many the last is all the others together."""
    if len(waiting) <= MOST:
        return [(message, [path]) for message, path in waiting]
    alone, rest = waiting[: MOST - 1], waiting[MOST - 1 :]
    key = hashlib.sha256("".join(message.key for message, _ in rest).encode()).hexdigest()[:32]
    titles = [message.title for message, _ in rest]
    listed = "\n".join([*titles[:LISTED], *([f"and {len(titles) - LISTED} more"] if len(titles) > LISTED else [])])
    first, title = rest[0][0], str(say("{count} more messages", count=len(rest)))
    together = OutgoingMessage(key, first.event, "", title, listed, "", first.at)
    return [*((message, [path]) for message, path in alone), (together, [path for _, path in rest])]


def _attempt(channel: Channel, message: OutgoingMessage) -> tuple[str, str]:
    """Why a message did not go out, and what is to be remarked of one that did; either may be empty."""
    try:
        return "", channel.send(message)
    except (UndeliveredError, CmmUqError) as error:
        return str(error), ""


def _drop(path: Path) -> None:
    with contextlib.suppress(OSError):
        path.unlink()
