"""What of a drawing is sound by itself: the rest is told by name, instead of ending the whole."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from pydantic import ValidationError

from cmm_uq.base.errors import CmmUqError
from cmm_uq.jobs.part.characteristic import CharacteristicFacts
from cmm_uq.jobs.part.checks import unfit
from cmm_uq.jobs.part.common import members
from cmm_uq.jobs.part.drawing import Drawing, Unknown
from cmm_uq.jobs.part.feature import FeatureFacts
from cmm_uq.jobs.part.probed import Probed, probed


def probed_of(given: Mapping[str, Any]) -> Probed:
    """A feature's table with its contact points.

    Raises
    ------
    CmmUqError : the readers of a job refuse it.
    """
    where = f"feature {given['name']!r}"
    try:
        facts = FeatureFacts.model_validate(dict(given))
    except ValidationError as error:
        raise CmmUqError(_first(error), where=where) from None
    return probed(facts, where)


def set_aside_unsound(drawing: Drawing, where: str) -> None:
    """Move features and characteristics that the readers of a job would refuse to what is not understood.

    Parameters
    ----------
    where : file, for messages.
    """
    features: dict[str, Probed] = {}
    for given in list(drawing.features):
        try:
            features[given["name"]] = probed_of(given)
        except CmmUqError as error:
            drawing.features.remove(given)
            drawing.unknown.append(Unknown(given["name"], _unsound(error.problem), where))
    for given in list(drawing.characteristics):
        try:
            facts = CharacteristicFacts.model_validate(dict(given))
            named = [*facts.features, *(each for name in facts.datums for each in members(name, features))]
            found = unfit(facts, features) if features.keys() >= set(named) else None
            problem = found[0] if found else ""
        except ValidationError as error:
            problem = _first(error)
        except CmmUqError:  # of a feature that was set aside: told where features are left out
            problem = ""
        if problem:
            drawing.characteristics.remove(given)
            drawing.unknown.append(Unknown(given["name"], _unsound(problem), where))


def _unsound(problem: str) -> str:
    return f"is refused as it stands: {problem}"


def _first(error: ValidationError) -> str:
    first = error.errors()[0]
    return ": ".join(filter(None, (".".join(map(str, first["loc"])), first["msg"].removeprefix("Value error, "))))
