"""What the certificate of a ballbar states beside the estimates: lengths, the budget of one, adjustment, second way."""

from __future__ import annotations

from dataclasses import dataclass, replace
from math import hypot
from typing import Any, cast

from cmm_uq.artefacts.ballbar.observe import Ballbar
from cmm_uq.artefacts.distances.adjustment import Setting, settings
from cmm_uq.artefacts.distances.equations import DistanceSolution, second_way_data, solve_distances
from cmm_uq.artefacts.distances.lengths import Lengths, lengths_of
from cmm_uq.base.errors import CmmUqError
from cmm_uq.base.messages import Text, Verbatim, say
from cmm_uq.base.units import MICROMETRE, unit
from cmm_uq.certificate.result import Result
from cmm_uq.certificate.wording import refusal
from cmm_uq.maths.uncertainty.budget import Budget, Line
from cmm_uq.maths.uncertainty.budget_results import budget_data


@dataclass(frozen=True, eq=False)
class BallbarFigures:
    """Lengths against the certified one, or their mean; the budget of one; what to adjust, and the second way to it."""

    lengths: Lengths
    budget: Budget
    settings: tuple[Setting, ...]
    second_way: DistanceSolution | Text


def figures(result: Result) -> BallbarFigures:
    """Of a result."""
    bar = cast("Ballbar", result.artefact)
    lengths = bar.lengths()
    reference = bar.sizes[0].nominal if bar.sizes[0].certified else float(lengths.mean())
    return BallbarFigures(
        lengths_of(result, lengths, reference), _budget(result, bar), settings(result), _second_way(result, bar)
    )


def results(result: Result) -> dict[str, Any]:
    """The same for results.json."""
    found = figures(result)
    return {
        "lengths": found.lengths.as_data(),
        "length_budget": budget_data(found.budget),
        "adjustments": [setting.as_data() for setting in found.settings],
        **second_way_data(found.second_way, result.at_least),
    }


def _budget(result: Result, bar: Ballbar) -> Budget:
    """What one length's deviation from the reference is uncertain by: the readings, and the certified length."""
    coordinate = result.noise.coordinate
    origin = say("residuals of this recording") if coordinate.u > 0 else say("stated in the job")
    lines = [
        Line(
            say("Coordinate of a ball, along the bar, twice"),
            coordinate.value,
            origin,
            unit=unit("µm"),
            dof=coordinate.degrees_of_freedom,
            sensitivity=float(bar.noise_scale[0]),
        )
    ]
    size = bar.sizes[0]
    if size.certified and size.sd > 0:
        chain = result.job.facts.artefact.certificate
        number = chain.number if chain else ""
        source = say("certificate {number}", number=Verbatim(number)) if number else say("certificate")
        lines.append(Line(say("Certified length"), size.sd / MICROMETRE, source, unit=unit("µm"), sensitivity=-1.0))
    return Budget(say("deviation of one length"), lines, unit=unit("µm"))


def _second_way(result: Result, bar: Ballbar) -> DistanceSolution | Text:
    """The distance equations of all used lengths, or why they have no solution."""
    size, ends, used = bar.sizes[0], bar.ends(), result.model.used
    if not size.certified:
        return say("The length of the bar is not certified.")
    try:
        found = solve_distances((ends[:, 1] - ends[:, 0])[used], (size.nominal * bar.expansion)[used])
        return replace(found, relative_length_u=hypot(size.sd / size.nominal, result.relative_doubt))
    except CmmUqError as error:
        return refusal(error)
