"""The effects, in tables: what a row says of an effect, and how far it moves points, as a function of them and of its axes."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from importlib import import_module

from cmm_uq.base.messages import NOTHING, Text
from cmm_uq.base.points import Floats, Points
from cmm_uq.base.values import dataclass
from cmm_uq.machine.physics.effect import CONTRACT, Effect, Family, Nonparametric, Parameter, Shape

# of points, the two letters of the effect, and its shape: basis (n, 3, k), mm
Displacement = Callable[[Points, str, str, Sequence[float]], Floats]
_DISPLACEMENTS: dict[str, Displacement] = {}  # by family: effects go to other processes, and nameless functions do not


@dataclass(frozen=True)
class Law:
    """An effect, or a family of them that differ by axes; see :class:`~cmm_uq.machine.physics.effect.Effect`."""

    family: str
    what: str  # it is, in a sentence
    title: Text
    formula: str
    mechanism: str
    points_to: Text
    coefficients: tuple[Parameter, ...]
    displacement: Displacement
    columns: tuple[str, ...] = ()
    tier: str = CONTRACT
    means: Text = NOTHING
    sense: tuple[Text, Text] = (NOTHING, NOTHING)
    shape: tuple[Shape, ...] = ()
    everywhere: bool = False
    idealised_over: str | None = None
    imitated_by: tuple[Nonparametric, ...] = ()
    along_motion: bool = False

    def __post_init__(self) -> None:
        _DISPLACEMENTS[self.family] = self.displacement

    def of(self, *letters: str) -> Effect:
        return OfLaw(self, *letters)

    def each(self, axes: Iterable[str]) -> tuple[Effect, ...]:
        return tuple(self.of(*letters.split()) for letters in axes)

    def has(self, effect: Effect) -> bool:
        """Whether an effect is of this law."""
        return isinstance(effect, Family) and effect.family == self.family


class OfLaw(Family):
    """An effect of a law."""

    def __init__(self, law: Law, *letters: str) -> None:
        self.__doc__, self.family, self.title, self.formula = law.what, law.family, law.title, law.formula
        self.mechanism, self.points_to, self.coefficients = law.mechanism, law.points_to, law.coefficients
        self.columns, self.tier, self.means, self.sense = law.columns, law.tier, law.means, law.sense
        self.shape, self.everywhere, self.imitated_by = law.shape, law.everywhere, law.imitated_by
        self.idealised_over = law.idealised_over
        super().__init__(*letters)
        self.along_motion = self.axis if law.along_motion else None

    def basis(self, points: Points, shape: Sequence[float] = ()) -> Floats:
        return _DISPLACEMENTS[self.family](points, self.axis, self.other, shape)

    def __reduce__(self) -> tuple[object, ...]:
        return _blank, (_DISPLACEMENTS[self.family].__module__,), self.__dict__


def _blank(module: str) -> OfLaw:
    """An effect still without its state; its table is read, in a process that had not."""
    import_module(module)
    return OfLaw.__new__(OfLaw)
