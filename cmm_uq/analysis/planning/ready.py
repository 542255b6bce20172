"""Ready plans: what every kind's own, scaled to the machine's volume, have in common."""

from __future__ import annotations

from cmm_uq.analysis.planning.directions import words
from cmm_uq.analysis.planning.placing import Placing
from cmm_uq.analysis.planning.setting import Setting
from cmm_uq.base.errors import CmmUqError
from cmm_uq.base.messages import Text, Verbatim
from cmm_uq.base.points import Floats

MIDDLE = (0.5, 0.5, 0.5)
"""Of the room that a placing has, along each axis."""

ACROSS = " (across it)"
"""How a plate stands to the direction by which it is held."""


def ready_plan(setting: Setting) -> tuple[Text, tuple[Placing, ...]]:
    """Name and placings of the ready plan that a job asks for, or of the usual one for its kind.

    Raises
    ------
    CmmUqError : its kind has no such plan, it does not fit the volume, or no fixture holds it.
    """
    ready, kind = setting.planning.ready, setting.artefact.kind
    usual = next(iter(ready))
    name = Verbatim(setting.plan.ready or usual)
    if name not in ready:
        raise CmmUqError(f"{name!r} is no plan for a job of kind {kind!r}", where="job.toml [plan] ready",
                         fix=f"Leave it out: the usual plan is {usual!r}")  # fmt: skip
    return name, ready[name](setting)


def check_allowed(setting: Setting, direction: Floats, how: str = "") -> None:
    """Refuse a direction that no fixture holds.

    Parameters
    ----------
    how : the artefact stands to the direction, as ``(across it)``.

    Raises
    ------
    CmmUqError : with the direction in words.
    """
    if not setting.volume.allows(direction):
        raise CmmUqError(
            f"no fixture holds the artefact {words(direction)}{how}, which this plan wants",
            where="job.toml [plan.fixtures] directions",
            fix='Allow the direction, or leave out ready and ask for number = 20 placings by criterion = "D"',
        )  # fmt: skip
