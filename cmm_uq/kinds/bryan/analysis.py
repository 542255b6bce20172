"""What the certificate of a Bryan gauge states beside the estimates: distances, adjustment, the patent's second way."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, cast

from cmm_uq.documents.result import Result
from cmm_uq.documents.wording import refusal
from cmm_uq.errors import CmmUqError
from cmm_uq.kinds.bryan.observe import Bryan
from cmm_uq.kinds.distances.adjustment import Setting, settings
from cmm_uq.kinds.distances.equations import DistanceSolution, second_way_data
from cmm_uq.kinds.distances.lengths import Lengths, lengths_of
from cmm_uq.messages import Text


@dataclass(frozen=True, eq=False)
class BryanFigures:
    """Distances of the swept ball from the best centre against their mean, what to adjust, and the second way to it."""

    lengths: Lengths
    settings: tuple[Setting, ...]
    second_way: DistanceSolution | Text


def figures(result: Result) -> BryanFigures:
    """Of a result."""
    bar = cast("Bryan", result.artefact)
    distances = bar.distances(bar.points.xyz, None) / bar.expansion
    try:
        second_way: DistanceSolution | Text = bar.in_two_steps()[0]
    except CmmUqError as error:
        second_way = refusal(error)
    return BryanFigures(lengths_of(result, distances, float(distances.mean())), settings(result), second_way)


def results(result: Result) -> dict[str, Any]:
    """The same for results.json."""
    found = figures(result)
    return {
        "lengths": found.lengths.as_data(),
        "adjustments": [setting.as_data() for setting in found.settings],
        **second_way_data(found.second_way, result.at_least),
    }
