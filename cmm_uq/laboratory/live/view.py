"""What there is to be seen of a session, as texts: a screen shows it, or lines do."""

from __future__ import annotations

from dataclasses import dataclass

from cmm_uq.base.messages import Text, commas, say, signed
from cmm_uq.laboratory.live.lead import Lead, Step


@dataclass(frozen=True)
class View:
    """What there is to be seen.

    Parameters
    ----------
    head : how far it is.
    next : what comes next, with its coordinates.
    picture : of the set-up in the machine.
    shown : live figures of the newest point and set-up.
    again : why a repeat is asked for.
    temperatures : each with its change.
    instruments : each with how many readings came, and what ails it.
    said : what happened, newest last.
    """

    head: Text
    next: Text
    picture: tuple[str, ...]
    shown: tuple[Text, ...]
    again: Text
    temperatures: tuple[Text, ...]
    instruments: tuple[Text, ...]
    said: tuple[Text, ...]


def coming(step: Step | None, lead: Lead) -> Text:
    """What comes next, with its coordinates."""
    if step is None:
        return say("all of the plan is measured")
    at = commas(signed(value, ".1f") for value in step.xyz)
    m, p, r = step.place
    where = say("measurement {m}", m=m)
    if (title := lead.titles.get(m)) is not None:
        where = say("{where}, {title}", where=where, title=title)
    return say("{where}, point {p}, repeat {r}, near {at} mm", where=where, p=p, r=r, at=at)
