"""What is advised to be measured next, as other rooms read it: set-ups, what they would part and show, and that in words.

How such a plan is found is in :mod:`cmm_uq.analysis.planning.suggestion`.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

from cmm_uq.analysis.planning.identifiability import repeat_points
from cmm_uq.analysis.planning.set_up import SetUp, join
from cmm_uq.base.messages import Text, Verbatim, number, plural, say, semicolons
from cmm_uq.base.points import Floats, Points
from cmm_uq.machine.physics.catalogue import every

ODDS = 20.0  # odds that a plan is expected to reach for every pair, whichever of the two is true
_OF_FITS = ("radius_mm", "fit_rms_um", "n_points")  # columns of a recording that tell of the fit that gave a point


@dataclass(frozen=True)
class Separation:
    """Two effects that the recording cannot tell apart."""

    effects: tuple[str, str]
    before: float  # odds of the first over the second, by the recording
    after: float  # odds of the true one over the other that are to be expected, the worse of the two cases


@dataclass(frozen=True)
class DetectionGoal:
    """An effect that is to be shown."""

    effect: str
    amplitude: float  # that is to be detected, over its prior standard deviation
    length: float  # visible length from which on it is detected


@dataclass(frozen=True)
class DetectionChange:
    """How well an effect that was not seen will show."""

    effect: str
    # before, after: smallest amplitude that is detected, over its prior standard deviation; infinite where none is
    before: float
    after: float


@dataclass(frozen=True, eq=False)
class NextPlan:
    """What to measure next."""

    placings: tuple[SetUp, ...]
    repeats: int
    first: int  # number of the first as a measurement
    partings: tuple[Separation, ...]  # pairs, with the odds before and after
    shown: tuple[DetectionChange, ...]
    reached: bool  # whether every pair reaches ODDS and every effect shows as asked for
    box: Floats  # (3, 2) the room for the artefact, scale readings, mm

    @property
    def points(self) -> Points:
        """All of it as a recording at nominal coordinates, numbered on from what is recorded; without what fits told."""
        points = join(
            [replace(each, points=repeat_points(each.points, self.repeats)) for each in self.placings], first=self.first
        )
        return replace(points, columns={k: v for k, v in points.columns.items() if k not in _OF_FITS})


@dataclass(frozen=True)
class Suggestion:
    """What parts two effects."""

    separates: tuple[str, str]
    what: Text
    repetitions: int  # how often to measure each set-up
    odds: float  # of the true one of the two over the other that are then to be expected


def suggestions(plan: NextPlan | None, title: Text) -> tuple[Suggestion, ...]:
    if plan is None:
        return ()
    times = plural(plan.repeats, one=say("once"), many=say("{times} times", times=plan.repeats))
    ends = semicolons(say("{ends} mm", ends=placing.ends) for placing in plan.placings)
    return tuple(
        Suggestion(
            parting.effects,
            say(
                "Place the {title:small} at {ends} in scale readings and measure it {times}: odds of {odds} : 1 for the true "
                "one are to be expected; by this recording they are {before} for {first} over {second}.",
                title=title, ends=ends, times=times, odds=rounded(parting.after), before=odds_words(parting.before),
                first=_title(parting.effects[0]), second=_title(parting.effects[1]),
            ),
            plan.repeats, parting.after,
        )
        for parting in plan.partings
    )  # fmt: skip


def _title(name: str) -> Text:
    effect = every().get(name)
    return Verbatim(name) if effect is None else say("{title:small}", title=effect.title)


def odds_words(odds: float) -> Text:
    """Odds as ``3 : 1`` or ``1 : 3``."""
    return say("{odds} : 1", odds=rounded(odds)) if odds >= 1 else say("1 : {odds}", odds=rounded(1 / odds))


def rounded(odds: float) -> Text:
    """Odds of one or more, as many digits as they are worth."""
    return say("more than 1000") if odds >= 1000 else number(odds, ".0f" if odds >= 10 else ".2g")
