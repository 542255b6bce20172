"""How large a report says each family of errors to be, and which of its figures rest on priors."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace

import numpy as np
import pytest

from cmm_uq.analysis.machine.performance import ALL, PriorInfluence
from cmm_uq.analysis.machine.state import StatementEvidence
from cmm_uq.certificate.document import Paragraph, Section, Table
from cmm_uq.certificate.part.budget_section import priors_section, resting_on_priors
from cmm_uq.certificate.part.measurement import PartMeasurement, part_results
from cmm_uq.certificate.sections.regions import families_data, priors_data
from cmm_uq.jobs.part.machine_state import BoundFacts
from tests.certificate.parts_found import found_of, machine, measured_points
from tests.jobs.part.parts import plate

pytestmark = pytest.mark.long  # all need what takes long to make

DATASHEET = BoundFacts(errors=["periodic_scale_x", "hysteresis_y"], largest_um=0.5, source="Datasheet S-1, 2024")


@pytest.fixture(scope="module")
def found() -> PartMeasurement:
    return found_of(points=measured_points(plate()))


def told(found: PartMeasurement, *influence: PriorInfluence) -> Section:
    return priors_section(replace(found, influence=influence))


def tables(section: Section) -> dict[str, Table]:
    return {str(block.caption): block for block in section.blocks if isinstance(block, Table)}


def paragraph(section: Section) -> Paragraph:
    return next(block for block in section.blocks if isinstance(block, Paragraph))


def change(
    found: PartMeasurement, u: Iterable[float] = (), shift: Iterable[float] = (), **of: object
) -> PriorInfluence:
    """Of ratios of u, and of shifts over u, for the first characteristics; nothing changes of the others."""
    ratios, shifts = np.ones(len(found.stated)), np.zeros(len(found.stated))
    u, shift = list(u), list(shift)
    ratios[: len(u)], shifts[: len(shift)] = u, shift
    return replace(PriorInfluence("play", 2.0, ratios, shifts), **of)  # type: ignore[arg-type]


def with_sizes(found: PartMeasurement) -> PartMeasurement:
    """Play of a fifth of what physics allows in the median, from 0 to 0.4; long waves of rotations of all of it."""
    even = np.linspace(0.0, 0.4, 4001)
    scales = {"play": even, "rotation long": np.ones(4001)}
    return replace(found, given=replace(found.given, machine=replace(machine(), scales=scales)))


def test_sizes_are_those_of_the_draws_times_what_physics_allows(found: PartMeasurement) -> None:
    """30 µm of play; of 30″ bow, slope and the first two of ten waves with weights 1/k have 28.65″, by their mean squares."""
    sized = with_sizes(found)
    play, rotation = families_data(sized.given.machine.scales)
    assert (play["allowed"], play["unit"]) == (30.0, "µm")
    assert [play[key] for key in ("low", "size", "high")] == pytest.approx([30 * 0.01, 30 * 0.2, 30 * 0.39])
    u, k = (np.arange(20_000) + 0.5) / 20_000, np.arange(1, 11)
    squares = np.mean(2 * np.cos(np.pi * np.outer(u + 0.125, k) / 1.25) ** 2, axis=0) / k**2
    share = (2 + squares[:2].sum()) / (2 + squares.sum())
    assert rotation["size"] == rotation["allowed"] == pytest.approx(30 * np.sqrt(share))
    rows = tables(told(sized, change(found)))["Sizes of errors, root mean square"].rows
    assert rows[0] == ("Play of the drives", "30", "6.0", "0.30", "12", "µm")
    assert rows[1] == ("Rotations, long waves", "29", "29", "29", "29", "″")


def test_the_largest_change_is_told_with_whose_it_is(found: PartMeasurement) -> None:
    """u falls by 4 % at most and of the second, the value moves by 0.03 u at most and of the first, downwards."""
    table = tables(told(found, change(found, [1.02, 0.96], [-0.03, 0.01], times=0.5)))["Influence of the priors"]
    one, two = (each.name for each in found.characteristics[:2])
    assert table.rows == (("Play of the drives", "0.5", "−4", two, "−3", one),)


def test_what_changes_nothing_is_no_row_and_a_sentence_says_so(found: PartMeasurement) -> None:
    """Below 1 % there is no row, of all priors together neither; without rows there is no table."""
    little = change(found, [1.009], [0.004])
    calm = told(found, little, replace(little, family=ALL))
    assert "Influence of the priors" not in tables(calm)
    assert str(paragraph(calm).text).endswith("no figure changes by a tenth of U.")
    table = tables(told(found, little, replace(change(found, [1.011]), family=ALL)))["Influence of the priors"]
    assert table.rows == (("All of them together", "2", "1", found.characteristics[0].name, "0", "–"),)


def test_results_have_every_change(found: PartMeasurement) -> None:
    data = priors_data([change(found, [1.5], [-0.25], times=0.5)])
    rest = len(found.stated) - 1
    assert data == [
        {"family": "play", "times": 0.5, "u_ratio": [1.5] + [1.0] * rest, "shift_u": [-0.25] + [0.0] * rest,
         "u_percent": 50.0, "value_percent": -25.0}
    ]  # fmt: skip


def test_a_tenth_of_u_or_of_expanded_uncertainty_makes_a_figure_rest_on_the_prior(found: PartMeasurement) -> None:
    """A shift counts as a part of U = k·u: 0.1·k of u and no less."""
    k = found.stated[0].U / found.stated[0].u
    names = [one.name for one in found.characteristics]
    for one, rests in (
        (change(found, [1.099, 0.901]), []), (change(found, [1.0, 1.101]), [names[1]]),
        (change(found, [0.899]), [names[0]]), (change(found, shift=[0.099 * k]), []),
        (change(found, shift=[-0.101 * k]), [names[0]]),
    ):  # fmt: skip
        assert resting_on_priors(replace(found, influence=(one,))) == rests
    calm, warned = paragraph(told(found, change(found))), paragraph(told(found, change(found, [1.0, 1.5])))
    assert (calm.tone, warned.tone) == ("plain", "warning")
    assert str(warned.text).startswith(f"1 of {len(names)} characteristics rest on what was taken")


def test_bounds_stand_with_their_source_and_what_the_recording_says(found: PartMeasurement) -> None:
    said = (StatementEvidence("hysteresis_y", 0.1), StatementEvidence("periodic_scale_x", 50.0))
    found = replace(found, given=replace(found.given, machine=replace(found.given.machine, statements=said)))
    state = found.job.facts.machine_state.model_copy(update={"bound": [DATASHEET]})
    job = replace(found.job, facts=found.job.facts.model_copy(update={"machine_state": state}))
    for influence in ((), (change(found),)):
        rows = tables(told(replace(found, job=job), *influence))["Bounds that are stated"].rows
        assert rows == (
            ("Periodic scale error of X", "0.5", "Datasheet S-1, 2024", "denies it: not used"),
            ("Hysteresis of Y", "0.5", "Datasheet S-1, 2024", "supports it"),
        )
    (bound,) = part_results(replace(found, job=job))["machine"]["bounds"]
    assert bound["recording"] == [
        {"error": "periodic_scale_x", "recording_against": 50.0, "used": False},
        {"error": "hysteresis_y", "recording_against": 0.1, "used": True},
    ]


def test_a_part_without_influence_or_bounds_has_no_such_section(found: PartMeasurement) -> None:
    assert not told(found).blocks
