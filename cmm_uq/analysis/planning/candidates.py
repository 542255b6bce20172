"""Candidate set-ups, the artefact in many places and attitudes inside the machine's volume; and ready plans."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from itertools import product

import numpy as np

from cmm_uq.analysis.planning.set_up import PLANES, Pattern, SetUp, attitudes_of_lines, direction_words
from cmm_uq.analysis.planning.setting import Setting, Start, Volume
from cmm_uq.base.errors import CmmUqError
from cmm_uq.base.messages import Text, Verbatim, say
from cmm_uq.base.points import Floats
from cmm_uq.machine.model.artefact import Artefact

THIRDS = (0.0, 0.5, 1.0)
_FIFTHS = (0.0, 0.25, 0.5, 0.75, 1.0)
PatternFor = Callable[[Floats], Pattern | None]  # the pattern for an attitude; ``None`` where it does not fit
# Ways of setting up an artefact that the fixtures of a volume allow, by their words
Attitudes = Callable[[Volume], list[tuple[Text, Floats]]]


@dataclass(frozen=True)
class RelocatedCandidates:
    """A recorded artefact, that stands by itself in each set-up, set up in other places."""

    attitudes: Attitudes  # in which it is set up, beside that of the recording

    def __call__(self, artefact: Artefact, volume: Volume, count: int) -> tuple[SetUp, ...]:
        first = artefact.points.select(artefact.points.measurement == artefact.measurement[0])
        pattern, attitude, _ = Pattern.of_recording(first.select(first.repeat == first.repeat.min()))
        return self.like(pattern, attitude, volume, count)

    def like(self, pattern: Pattern, recorded: Floats, volume: Volume, count: int) -> tuple[SetUp, ...]:
        """A pattern in other places; first of all in the recorded attitude (3, 3)."""
        ways = [(say("as recorded"), recorded), *self.attitudes(volume)]
        return thinned(everywhere(volume, ways, pattern), count, volume)


@dataclass(frozen=True)
class VolumeCandidates:
    """Candidates of an artefact that stands by itself in each set-up."""

    attitudes: Attitudes  # in which it is set up
    shape: Callable[[Setting], Pattern | PatternFor]  # what is measured of it in one set-up
    elsewhere: RelocatedCandidates  # of a recorded one

    def candidates(self, setting: Setting, start: Start | None) -> tuple[SetUp, ...]:
        """In many places: as the plan says, or as it was recorded."""
        plan, volume = setting.plan, setting.volume
        if start is not None and start.again is not None:
            pattern, attitude, _ = Pattern.of_recording(start.again.points)
            return self.elsewhere.like(pattern.once().repeated(plan.repeats), attitude, volume, plan.candidates)
        return thinned(everywhere(volume, self.attitudes(volume), self.shape(setting)), plan.candidates, volume)


def candidates(setting: Setting, start: Start | None = None) -> tuple[SetUp, ...]:
    """Set-ups that the volume and the fixtures allow, at most as many as the plan says."""
    return setting.planning.candidates(setting, start)


def along_lines(volume: Volume) -> list[tuple[Text, Floats]]:
    """Attitudes of a bar or gauge, held along its length."""
    return [(title, way) for title, way in attitudes_of_lines(volume.size) if volume.allows(way[:, 0])]


def across_planes(volume: Volume) -> list[tuple[Text, Floats]]:
    """Attitudes of a plate, held by its normal."""
    return [(title, way) for title, way in PLANES if volume.allows(way[:, 2])]


def upright(volume: Volume) -> list[tuple[Text, Floats]]:
    """The one attitude of what looks alike from all sides."""
    return [(say("upright"), np.eye(3))]


def thinned(placings: Iterator[SetUp], count: int, volume: Volume) -> tuple[SetUp, ...]:
    """At most so many of them, spread evenly over the list."""
    found = tuple(placings)
    if not found:
        size = " × ".join(f"{v:.0f}" for v in volume.size)
        raise CmmUqError(
            "no placing is possible: the artefact does not fit the volume in any direction that the fixtures allow",
            where="job.toml [plan]",
            fix=f"The volume is {size} mm; allow other directions or heights, or use a smaller artefact",
        )
    return tuple(
        found[i] for i in np.unique(np.linspace(0, len(found) - 1, min(count, len(found))).round().astype(int))
    )


def everywhere(volume: Volume, ways: Sequence[tuple[Text, Floats]], shape: Pattern | PatternFor) -> Iterator[SetUp]:
    """Every attitude in the corners, on the edges and in the middle of the room that it has."""
    steps = _FIFTHS if len(ways) < 4 else THIRDS
    for title, attitude in ways:
        pattern = shape if isinstance(shape, Pattern) else shape(attitude)
        room = None if pattern is None else volume.room(pattern.turned(attitude))
        if pattern is None or room is None:
            continue
        middles: dict[tuple[float, ...], Floats] = {}
        for place in product(steps, repeat=3):
            middle = room[:, 0] + (room[:, 1] - room[:, 0]) * place
            middles.setdefault(tuple(middle.round(3).tolist()), middle)
        yield from (pattern.placed(volume.machine, attitude, middle, title) for middle in middles.values())


MIDDLE = (0.5, 0.5, 0.5)  # of the room that a set-up has, along each axis
ACROSS = " (across it)"  # how a plate stands to the direction by which it is held


def ready_plan(setting: Setting) -> tuple[Text, tuple[SetUp, ...]]:
    """Name and set-ups of the ready plan that a job asks for, or of the usual one for its kind."""
    ready, kind = setting.planning.ready, setting.artefact.kind
    usual = next(iter(ready))
    name = Verbatim(setting.plan.ready or usual)
    if name not in ready:
        raise CmmUqError(f"{name!r} is no plan for a job of kind {kind!r}", where="job.toml [plan] ready",
                         fix=f"Leave it out: the usual plan is {usual!r}")  # fmt: skip
    return name, ready[name](setting)


def check_allowed(setting: Setting, direction: Floats, how: str = "") -> None:
    if not setting.volume.allows(direction):
        raise CmmUqError(
            f"no fixture holds the artefact {direction_words(direction)}{how}, which this plan wants",
            where="job.toml [plan.fixtures] directions",
            fix='Allow the direction, or leave out ready and ask for number = 20 placings by criterion = "D"',
        )
