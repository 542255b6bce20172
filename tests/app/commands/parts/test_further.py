"""What to measure on the machine next: a plan that shows what the calibration did not, and what its artefact never will."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from functools import cache

import pytest

from cmm_uq.app.commands.parts.drift import further_of
from cmm_uq.app.commands.planning import make_plan
from cmm_uq.app.commands.reading import job_of, read_job
from cmm_uq.base.messages import say
from cmm_uq.certificate.part.measurement import FurtherSetUps, UnseenError
from cmm_uq.jobs.job import Job
from tests.conftest import ROOT


@cache
def calibrated(name: str = "step-gauge-simulated") -> Job:
    return read_job(ROOT / "examples" / name)


def unseen(effect: str, share: float, characteristic: str = "1") -> UnseenError:
    return UnseenError(
        characteristic, f"machine: {effect}", effect, say("{e}", e=say("error")), share, say("nobody saw it")
    )


@cache
def planned() -> tuple[FurtherSetUps, Mapping[str, bytes]]:
    shares = [
        unseen("rotation_x_y", 0.2),
        unseen("rotation_x_y", 0.6, "2"),
        unseen("periodic_scale_x", 0.3),
        unseen("tip size", 0.9),
    ]
    further, files = further_of(calibrated(), shares)
    assert further is not None
    return further, files


@pytest.mark.long
def test_errors_of_the_machine_are_told_by_their_largest_share() -> None:
    assert planned()[0].effects == ("rotation_x_y", "periodic_scale_x")


def test_what_a_bar_never_shows_is_told_with_what_does() -> None:
    found, _ = further_of(calibrated("iota-1102-20C"), [unseen("hysteresis_x", 0.4)])
    assert found is not None
    assert (found.setups, found.missed) == (0, ("hysteresis_x",))
    assert "Hysteresis of X (a gauge whose faces are met from both sides" in found.text


def test_the_job_beside_the_page_plans_the_set_ups_that_are_told() -> None:
    further, named = planned()
    assert further.setups == 4
    assert further.command == "cmm-uq plan further"
    files = {name.removeprefix("further/"): content for name, content in named.items()}
    job = job_of(files)
    assert job.facts.job.id == "step-gauge-simulated-further"
    assert job.facts.model.effects == [*calibrated().facts.model.effects, "rotation_x_y"]
    again = make_plan(replace(job, facts=job.facts.model_copy(
        update={"plan": job.facts.plan.model_copy(update={"candidates": 60})})), power=False)  # fmt: skip
    assert [placing.ends in further.text for placing in again.to_measure] == [True] * 4
    assert again.better is not None
    assert again.better.identifiability is not None
    (one,) = [one for one in again.better.identifiability.parameters if one.unknown.key[0] == "rotation_x_y"]
    assert one.u_with_prior < 0.5 * one.unknown.prior_sd


def test_where_no_set_up_helps_there_is_no_job() -> None:
    found, files = further_of(calibrated(), [unseen("periodic_scale_x", 0.5)])
    assert found is not None
    assert (found.setups, found.command, files) == (0, "", {})
    assert found.missed == ("periodic_scale_x",)


def test_without_the_calibration_or_anything_unseen_nothing_is_planned() -> None:
    assert further_of(None, [unseen("rotation_x_y", 0.5)]) == (None, {})
    assert further_of(calibrated(), []) == (None, {})
