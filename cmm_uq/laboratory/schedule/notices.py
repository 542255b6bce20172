"""What a person must hear of: a certificate that is no pass, a recording that contradicts its model, what is due, an error."""

from __future__ import annotations

import datetime as dt
import hashlib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Literal, get_args

from cmm_uq.base.errors import CmmUqError
from cmm_uq.base.messages import Text, Verbatim, commas, day, say
from cmm_uq.jobs.verdicts import Verdict, Verdicts

Event = Literal["fail", "incomplete", "undecided", "mismatch", "drift", "due", "error"]
"""What a message may be about."""

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
    """Something that a person must hear of, once.

    Parameters
    ----------
    event : see :data:`Event`.
    about : job, machine, artefact or folder that it is about.
    title : in a few words; the subject of an e-mail.
    text : one or several sentences.
    state : which state of it: another state is told again, the same is not.
    where : folder in which to look.
    """

    event: Event
    about: str
    title: Text
    text: Text
    state: str = ""
    where: str = ""

    @property
    def key(self) -> str:
        """Of the notice: the same whenever the same is to be said."""
        said = "\0".join((self.event, self.about, self.state))
        return hashlib.sha256(said.encode()).hexdigest()[:32]


def of_results(results: Mapping[str, Any], inputs: str, where: str) -> list[Notice]:
    """What has to be said of a certificate, at most one notice an event; none where all is well.

    Parameters
    ----------
    results : contents of results.json.
    inputs : hash over the hashes of all that was read.
    where : folder of the certificate.
    """
    job = results.get("job", {})
    name, machine = Verbatim(str(job.get("id", ""))), Verbatim(str(job.get("machine") or ""))
    of = say("{machine} (job {name})", machine=machine, name=name) if machine else say("job {name}", name=name)
    told: dict[Event, list[Text]] = {}
    for one in Verdicts.of_results(results):
        if one.standing != "good":
            told.setdefault(_OF_OUTCOME.get(one.outcome, "undecided"), []).append(_statement(one))
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
    """What has to be said of a job or a folder that could not be reported.

    Parameters
    ----------
    error : that ended it.
    about : job id, or folder.
    since : moment at which it was first met; where it was mended in between and comes back, it is told again.
    """
    title = say("error: {about}", about=Verbatim(about))
    return Notice("error", about, title, Verbatim(str(error)), f"{error} since {since}", error.where or "")


def of_due(item: str, called: str, due: dt.date, on: dt.date, why: Text, *, beyond: bool = False) -> Notice:
    """What has to be said of a machine or an artefact that is to be calibrated: once before its day, and once after it.

    Parameters
    ----------
    item : machine or artefact.
    called : its serial number or name.
    due : day by which it is to be calibrated.
    on : today.
    why : it is due then.
    beyond : whether its last certificate finds it beyond its limits.
    """
    overdue = beyond or due < on
    state = say("overdue since {due}", due=day(due)) if overdue else say("due on {due}", due=day(due))
    title = say("{state}: {item} {called}", state=state, item=Verbatim(item), called=Verbatim(called))
    text = say("{item} {called} is {state}: {why}.", item=Verbatim(item.capitalize()), called=Verbatim(called), state=state,
               why=why)  # fmt: skip
    return Notice("due", f"{item} {called}", title, text, f"{due.isoformat()} {'overdue' if overdue else 'due'}")


def of_drift(machine: str, changed: Sequence[Text], entry: int) -> Notice:
    """What has to be said of a machine that changed by more than chance since the recording before.

    Parameters
    ----------
    machine : its serial number.
    changed : what did.
    entry : number of the newer certificate's entry.
    """
    of = say("machine {machine}", machine=Verbatim(machine))
    text = say(
        "{of} changed by more than chance since the recording before: {changed}.", of=of, changed=commas(changed)
    )
    return Notice("drift", f"machine {machine}", say("drift: {of}", of=of), text, str(entry))


def decisions(results: Mapping[str, Any]) -> list[str]:
    """Every decision of conformity on a certificate, in its order."""
    return [one.outcome for one in Verdicts.of_results(results)]


def _statement(one: Verdict) -> Text:
    standard, name, said = Verbatim(one.by), Verbatim(one.name), Verbatim(one.outcome)
    if not one.by:
        return say("{name}, tolerance: {decision}", name=Verbatim(one.title or one.name), decision=said)
    if not one.name:
        return say("{standard}: {decision}", standard=standard, decision=said)
    return say("{standard} {characteristic}: {decision}", standard=standard, characteristic=name, decision=said)
