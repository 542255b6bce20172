"""What a person must hear of, and the messages that say it: a certificate that is no pass, what is due, an error."""

from __future__ import annotations

import datetime as dt
import hashlib
import threading
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass
from typing import Any, Literal, Protocol, get_args

from cmm_uq.base.errors import CmmUqError
from cmm_uq.base.messages import Text, Verbatim, commas, day, say
from cmm_uq.jobs.verdicts import Verdicts

Event = Literal["fail", "incomplete", "undecided", "mismatch", "drift", "due", "error"]  # what a message may be about
EVENTS: tuple[Event, ...] = get_args(Event)

_OF_OUTCOME: Mapping[str, Event] = {"fail": "fail", "conditional fail": "fail", "incomplete": "incomplete"}
"""Event of a statement of conformity; a pass is none, and every other word leaves it undecided."""

_OF_VERDICT: Mapping[str, Text] = {
    "explained": say("the recording contradicts its model, and the diagnosis names what was left out"),
    "partial": say("the recording contradicts its model, and the diagnosis names only part of what was left out"),
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
            if not one.by:
                text = say("{name}, tolerance: {decision}", name=Verbatim(one.title or one.name), decision=said)
            elif not one.name:
                text = say("{standard}: {decision}", standard=standard, decision=said)
            else:
                text = say(
                    "{standard} {characteristic}: {decision}", standard=standard, characteristic=called, decision=said
                )
            told.setdefault(_OF_OUTCOME.get(one.outcome, "undecided"), []).append(text)
    verdict = str((results.get("diagnosis") or {}).get("verdict") or "consistent")
    if verdict != "consistent":
        told.setdefault("mismatch", []).append(_OF_VERDICT.get(verdict, _CONTRADICTS))
    return [
        Notice(
            event, str(name), say("{event}: {of}", event=Verbatim(event), of=of),
            say("{of}: {said}.", of=of, said=commas(said)), inputs, where,
        )
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
    title = say("{state}: {item} {called}", state=state, item=Verbatim(item), called=Verbatim(called))
    text = say("{item} {called} is {state}: {why}.", item=Verbatim(item.capitalize()), called=Verbatim(called), state=state,
               why=why)  # fmt: skip
    return Notice("due", f"{item} {called}", title, text, f"{due.isoformat()} {'overdue' if overdue else 'due'}")


def of_drift(machine: str, changed: Sequence[Text], entry: int) -> Notice:
    """What has to be said of a machine that changed by more than chance since the recording before."""
    of = say("machine {machine}", machine=Verbatim(machine))
    text = say(
        "{of} changed by more than chance since the recording before: {changed}.", of=of, changed=commas(changed)
    )
    return Notice("drift", f"machine {machine}", say("drift: {of}", of=of), text, str(entry))


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
        """For a file, or a webhook."""
        return asdict(self)

    @classmethod
    def of(cls, notice: Notice, channel: str, at: str) -> OutgoingMessage:
        """A notice on its way through a channel."""
        key = hashlib.sha256(f"{channel}\0{notice.key}".encode()).hexdigest()[:32]
        return cls(key, notice.event, notice.about, str(notice.title), str(notice.text), notice.where, at)


class Channel(Protocol):
    """A way of sending messages."""

    name: str  # what tells it from others, without a secret
    events: frozenset[str]  # that it is told of

    def send(self, message: OutgoingMessage) -> str:
        """Send a message; what is to be remarked of it, as a rule nothing."""
        ...


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
