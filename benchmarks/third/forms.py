"""Forms of errors that no catalogue of machines' effects has: those of a dictionary, and others that no dictionary has.

A form is a function of one covariate or two, each from 0 to 1 over the recording; it moves the points along one axis, or
lengthens that axis where it is a scale. Nothing here comes from the package.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from itertools import product
from typing import NamedTuple

import numpy as np

from benchmarks.concealed.physics import Error, component

Parameters = Mapping[str, float]
POSITIONS = ("x_mm", "y_mm", "z_mm")


class Form(NamedTuple):
    """A form, how its parameters are drawn, and its members: of each the columns that span it, by their parameters."""

    value: Callable[..., np.ndarray]
    drawn: Callable[[np.random.Generator], dict[str, float]]
    members: Callable[[], list[list[dict[str, float]]]]


def _members(**values: np.ndarray) -> Callable[[], list[list[dict[str, float]]]]:
    names = list(values)
    return lambda: [[dict(zip(names, map(float, each), strict=True))] for each in product(*values.values())]


def _sines() -> list[list[dict[str, float]]]:
    turned = [(order, phase) for order in (1.0, 2.0) for phase in (0.0, np.pi / 2)]
    return [
        [{"period": float(period), "order": order, "phase": phase, "harmonic": 0.0} for order, phase in turned]
        for period in np.geomspace(0.08, 0.9, 60)
    ]


def _sine(
    u: np.ndarray, period: float, phase: float, harmonic: float, order: float = 1.0, second: float = 0.0
) -> np.ndarray:
    angle = 2 * np.pi * order * u / period
    return np.sin(angle + phase) + harmonic * np.sin(2 * angle + second)


def _nothing_drawn(random: np.random.Generator) -> dict[str, float]:
    return {}


_PLACES, _WIDTHS = np.linspace(0.08, 0.92, 43), np.geomspace(0.03, 0.2, 9)
DICTIONARY: dict[str, Form] = {
    "step": Form(lambda u, at: (u > at).astype(float), lambda r: {"at": r.uniform(0.25, 0.75)},
                 _members(at=np.linspace(0.08, 0.92, 169))),
    "dent": Form(lambda u, at, width: np.exp(-0.5 * ((u - at) / width) ** 2),
                 lambda r: {"at": r.uniform(0.2, 0.8), "width": r.uniform(0.04, 0.12)},
                 _members(at=_PLACES, width=_WIDTHS)),
    "ramp": Form(lambda u, at: np.maximum(u - at, 0.0), lambda r: {"at": r.uniform(0.35, 0.75)}, _members(at=_PLACES)),
    "cubic": Form(lambda u: (2 * u - 1) ** 3, _nothing_drawn, _members()),
    "saturating": Form(lambda u, at, width: np.tanh((u - at) / width),
                       lambda r: {"at": r.uniform(0.2, 0.6), "width": r.uniform(0.08, 0.25)},
                       _members(at=np.linspace(-0.1, 0.9, 26), width=np.geomspace(0.05, 0.4, 9))),
    "sawtooth": Form(lambda u, period, start: (u / period + start) % 1.0,
                     lambda r: {"period": r.uniform(0.2, 0.5), "start": r.uniform(0, 1)},
                     _members(period=np.geomspace(0.15, 0.6, 60), start=np.arange(24) / 24)),
    "exponential": Form(lambda u, time: np.exp(-u / time), lambda r: {"time": r.uniform(0.08, 0.35)},
                        _members(time=np.geomspace(0.04, 0.8, 20))),
    "sine": Form(_sine,
                 lambda r: {"period": r.uniform(0.15, 0.6), "phase": r.uniform(0, 6.28), "harmonic": r.uniform(0, 0.6),
                            "second": r.uniform(0, 6.28)}, _sines),
    "product": Form(lambda u, v: (2 * u - 1) * (2 * v - 1), _nothing_drawn, _members()),
    "bowl": Form(lambda u, v: (2 * u - 1) ** 2 + (2 * v - 1) ** 2, _nothing_drawn, _members()),
    "sign": Form(lambda u: np.sign(2 * u - 1), _nothing_drawn, _members()),
    "dead_zone": Form(lambda u, at, width: np.sign(u - at) * np.maximum(np.abs(u - at) - width, 0.0),
                      lambda r: {"at": r.uniform(0.4, 0.6), "width": r.uniform(0.15, 0.3)},
                      _members(at=np.linspace(0.3, 0.7, 17), width=np.linspace(0.08, 0.36, 8))),
}  # fmt: skip
"""Of the issue that asked for them; whoever diagnoses may have them."""


def _field(u: np.ndarray, v: np.ndarray, seed: float) -> np.ndarray:
    """A smooth random field: eight waves of some two thirds of the travel."""
    random = np.random.default_rng(int(seed))
    k, phase, size = random.normal(0, 5.0, (8, 2)), random.uniform(0, 6.28, 8), random.standard_normal(8)
    return np.asarray(np.cos(np.multiply.outer(u, k[:, 0]) + np.multiply.outer(v, k[:, 1]) + phase) @ size)


def _stick_slip(u: np.ndarray, seed: float) -> np.ndarray:
    """What follows sticks, and slips by another amount at irregular places: it goes up evenly and falls back."""
    random = np.random.default_rng(int(seed))
    slips = np.sort(random.uniform(0, 1, 7))
    fallen = np.concatenate([[0.0], np.cumsum(random.exponential(1 / 7, 7))])
    return np.asarray(u - fallen[np.searchsorted(slips, u)])


def _walk(u: np.ndarray, seed: float) -> np.ndarray:
    """A random walk of forty steps of position."""
    steps = np.random.default_rng(int(seed)).standard_normal(41)
    return np.asarray(np.interp(u, np.linspace(0, 1, 41), np.cumsum(steps)) / 6)


def _seeded(random: np.random.Generator) -> dict[str, float]:
    return {"seed": float(random.integers(2**31))}


OTHERS: dict[str, Form] = {
    "chirp": Form(lambda u, slow, fast, phase: np.sin(2 * np.pi * (slow * u + fast * u**2) + phase),
                  lambda r: {"slow": r.uniform(0.5, 1.5), "fast": r.uniform(1.5, 4), "phase": r.uniform(0, 6.28)}, list),
    "|sine|": Form(lambda u, period, phase: np.abs(np.sin(np.pi * u / period + phase)),
                   lambda r: {"period": r.uniform(0.25, 0.6), "phase": r.uniform(0, 3.14)}, list),
    "cusp": Form(lambda u, at: np.sqrt(np.abs(u - at)), lambda r: {"at": r.uniform(0.3, 0.7)}, list),
    "ripple": Form(lambda u, at, width, period: np.exp(-0.5 * ((u - at) / width) ** 2) * np.cos(2 * np.pi * (u - at) / period),
                   lambda r: {"at": r.uniform(0.3, 0.7), "width": r.uniform(0.1, 0.2), "period": r.uniform(0.12, 0.25)}, list),
    "field": Form(_field, _seeded, list),
    "stick-slip": Form(_stick_slip, _seeded, list),
    "walk": Form(_walk, _seeded, list),
}  # fmt: skip
TWO = ("product", "bowl", "field")
"""Forms of two covariates."""
OF_TIME = ("step", "ramp", "saturating", "sine", "chirp", "walk")
FORMS = DICTIONARY | OTHERS


@dataclass(frozen=True)
class Outside:
    """One error outside the catalogue.

    Parameters
    ----------
    form : of :data:`FORMS`.
    of : its covariates.
    spans : of each the lowest and the highest value in the recording.
    along : the axis.
    scale : whether it lengthens the axis, by so much for a metre, or moves every point.
    parameters : of the form.
    """

    form: str
    of: tuple[str, ...]
    spans: tuple[tuple[float, float], ...]
    along: int
    scale: bool
    parameters: Parameters

    @property
    def name(self) -> str:
        """In words."""
        return f"{self.form} of {' and '.join(self.of)}, {'scale of ' if self.scale else 'along '}{'xyz'[self.along]}"

    def error(self, form: str | None = None, parameters: Parameters | None = None) -> Error:
        """For one micrometre, or µm/m; of another form of the same covariates where one is given."""
        value = FORMS[form or self.form].value
        chosen = self.parameters if parameters is None else parameters

        def e(p: np.ndarray, c: dict) -> np.ndarray:
            return component(self.along, self.acting(value(*self.covariates(p, c), **chosen)[:, None], p)[:, 0])

        return e

    def covariates(self, p: np.ndarray, c: dict) -> list[np.ndarray]:
        """Each (n,), 0 to 1 over the recording."""
        values = [p[:, POSITIONS.index(name)] if name in POSITIONS else c[name] for name in self.of]
        return [(value - low) / (high - low) for value, (low, high) in zip(values, self.spans, strict=True)]

    def acting(self, values: np.ndarray, p: np.ndarray) -> np.ndarray:
        """How far functions (n, k), µm or µm/m, move the points along the axis, mm."""
        return np.asarray(1e-3 * values * (1e-3 * p[:, [self.along]] if self.scale else 1.0))

    def only(self, index: int) -> Outside:
        """The same of one of its covariates."""
        return Outside(self.form, self.of[index : index + 1], self.spans[index : index + 1], self.along, self.scale, {})


def drawn(random: np.random.Generator, forms: Mapping[str, Form], true: np.ndarray, recorded: dict) -> Outside | None:
    """One of some forms, of covariates that were recorded with the points; nothing where there are none for it."""
    form = str(random.choice(sorted(forms)))
    along = int(random.integers(3))
    if form in TWO:
        first, second = random.permutation(3)[:2]
        of: tuple[str, ...] = (POSITIONS[first], POSITIONS[second])
    elif form == "sign":
        of = (f"approach_{'xyz'[(along + int(random.integers(1, 3))) % 3]}",)
    elif form == "exponential" or (form in OF_TIME and random.random() < 0.3):
        of = ("time_s",)
    elif form == "dead_zone" and random.random() < 0.5:
        of = (str(random.choice(["temp_x_c", "temp_y_c", "temp_z_c"])),)
    else:
        of = (POSITIONS[int(random.integers(3))],)
    if not all(name in recorded or name in POSITIONS for name in of):
        return None
    values = [true[:, POSITIONS.index(name)] if name in POSITIONS else recorded[name] for name in of]
    spans = tuple((float(each.min()), float(each.max())) for each in values)
    if any(high - low < 1e-6 for low, high in spans):
        return None
    scale = of[0] not in POSITIONS and bool(random.random() < (0.5 if form == "sign" else 0.8))
    parameters = {name: float(value) for name, value in forms[form].drawn(random).items()}
    return Outside(form, of, spans, along, scale, parameters)
