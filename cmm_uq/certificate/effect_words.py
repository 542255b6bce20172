"""Effects by their names in words, and how large they are as a technician would say it."""

from __future__ import annotations

from collections.abc import Iterable, Mapping

from cmm_uq.base.messages import Text, Verbatim, commas, say
from cmm_uq.base.units import unit
from cmm_uq.certificate.wording import NO_FACTOR, expanded, with_uncertainty
from cmm_uq.machine.physics.catalogue import every
from cmm_uq.machine.physics.effect import Amount, Effect
from cmm_uq.maths.uncertainty.quantity import Quantity, figure


def effect_of(name: str, own: Iterable[Effect] = ()) -> Effect | None:
    """The effect of a name, first among a model's ``own``; ``None`` of what is no effect."""
    return next((effect for effect in own if effect.name == name), every().get(name))


def title_of(name: str, own: Iterable[Effect] = ()) -> Text:
    """An effect in words; what is none, as it stands."""
    effect = effect_of(name, own)
    if effect is not None:
        return effect.title
    return name if isinstance(name, Text) else Verbatim(name)


def titles(names: Iterable[str], own: Iterable[Effect] = ()) -> list[Text]:
    known = tuple(own)
    return [title_of(name, known) for name in names]


def parameter_title(owner: str, name: str, own: Iterable[Effect] = ()) -> Text:
    """A parameter of an effect in words: ``Periodic scale error of X, amplitude``; of what is no effect by its names."""
    effect = effect_of(owner, own)
    if effect is not None and len(effect.reported) == 1:
        return effect.title
    return say("{title}, {what}", title=title_of(owner, own), what=_what(effect, name))


def size_of(effect: Effect | None, parameters: Mapping[str, Quantity], *, factors: bool = True) -> Text:
    """How large an effect is, and what that means: ``the angle between X and Y is 90° minus 36 ± 4 ″``."""
    quantities = {
        name: quantity.times(1e6, unit("10⁻⁶/K")) if quantity.unit == "1/K" else quantity
        for name, quantity in parameters.items()
    }
    if effect is not None:
        positive = {name: q.times(-1.0, q.unit) if q.value < 0 else q for name, q in quantities.items()}
        amounts = {name: Amount(_figures(q, factors), quantities[name].value < 0) for name, q in positive.items()}
        if meaning := effect.meaning(amounts):
            return meaning
    sizes = {name: _figures(quantity, factors) for name, quantity in quantities.items()}
    if len(sizes) == 1:
        return next(iter(sizes.values()))
    return commas(say("{what} {size}", what=_what(effect, name), size=size) for name, size in sizes.items())


def _what(effect: Effect | None, name: str) -> Text:
    parameters = () if effect is None else (*effect.reported, *effect.coefficients)
    return next((p.what for p in parameters if p.name == name and p.what), Verbatim(name))


def _figures(quantity: Quantity, factors: bool) -> Text:
    if not quantity.u > 0:
        return say("{value}\u00a0{unit}", value=figure(quantity.value), unit=quantity.unit)
    stated, k = with_uncertainty(quantity), expanded(quantity)[2]
    if not factors or k == NO_FACTOR:
        return say("{stated}\u00a0{unit}", stated=stated, unit=quantity.unit)
    return say("{stated}\u00a0{unit} (k\u00a0=\u00a0{k})", stated=stated, unit=quantity.unit, k=k)
