"""One robot stated by its rows and by its screw axes: the same certificate, with eccentric encoders, play and sag in it."""

from __future__ import annotations

import re

import numpy as np
import pytest

from cmm_uq.app.commands.jobs.new import new_job
from cmm_uq.app.commands.jobs.simulate import simulated_job
from cmm_uq.app.commands.reading import job_of
from cmm_uq.app.commands.report import evaluate_job
from cmm_uq.artefacts.optical import tracked
from cmm_uq.base.arm import THETA, Arm
from cmm_uq.certificate.result import Result
from cmm_uq.jobs.job import Job

FILES = new_job("tracked_points", {}, id="robot")
NAMED = ("zero_q2", "zero_q3", "zero_q4", "zero_q5", "length_q1", "length_q2", "length_q3", "length_q4", "length_q5",
         "twist_q1", "twist_q2", "twist_q3", "twist_q4", "twist_q5", "offset_q3", "offset_q4", "offset_q5", "parallelism_q2",
         "tool_offset", "eccentricity_q1", "sag_q2", "slack_q3")  # fmt: skip
TRUTH = {"seed": 7, "noise": {"coordinate_um": 30.0}, "effects": {
    "zero_q3": {"arcsec": 500.0}, "length_q2": {"um": 400.0}, "twist_q1": {"arcsec": -200.0},
    "tool_offset": {"x_um": 1000.0, "y_um": 500.0, "z_um": -800.0},
    "eccentricity_q1": {"amplitude_arcsec": 70.0, "phase_rad": 0.7}, "sag_q2": {"arcsec_per_m": 250.0},
    "slack_q3": {"gap_arcsec": 90.0},
}}  # fmt: skip


def by_rows() -> Job:
    """The new job's robot with these effects, and the sides from which its joints came."""
    before, _, rest = FILES["job.toml"].decode().partition("effects = [")
    text = f"{before}effects = {list(NAMED)!r}  #{rest}".replace("'", '"')
    lines = FILES["recording.csv"].decode().splitlines()
    random = np.random.default_rng(3)
    rows = [f"{line},{random.choice([-1, 1])}" for line in lines[2:]]
    recording = "\n".join([lines[0], f"{lines[1]},approach_q3", *rows]) + "\n"
    job = job_of({**FILES, "job.toml": text.encode(), "recording.csv": recording.encode()})
    return simulated_job(job, TRUTH)


def by_screws(job: Job) -> Job:
    """The same recording by the screw axes of its rows at home."""
    arm = job.points.machine
    assert isinstance(arm, Arm)
    home, text = arm.at(np.zeros((1, 6))), job.inputs["job.toml"].decode()
    text = re.sub(r"\[\[machine.joint\]\]\n(?:[^\[\n].*\n|\n)*", "", text)
    text = re.sub(r"\n(joint|arm) = .*", "", re.sub(r"\[machine.arm\]\n(?:[^\[\n].*\n|\n)*", "", text))
    axes = "".join(
        f"[[machine.joint]]\ndirection = {home.axes[0, i, THETA].tolist()}\npoint_mm = {home.origins[0, i, THETA].tolist()}\n"
        for i in range(6)
    )
    frame = np.column_stack([home.flange[0], home.tool[0] - home.flange[0] @ arm.tool_mm]).tolist()
    stated = f"[machine.arm]\nhome = {frame}\ntool_mm = {arm.tool_mm.tolist()}\n{axes}\n[artefact]"
    return job_of({**job.inputs, "job.toml": text.replace("[artefact]", stated, 1).encode()})


@pytest.mark.long
def test_the_certificate_of_distances_is_the_same_by_rows_and_by_screw_axes() -> None:
    """Within a fifth of the noise, which the certificate rounds to; so are the errors of joints, in any frame."""
    rows = by_rows()
    screws = by_screws(rows)
    assert isinstance(screws.points.machine, Arm)
    assert screws.points.machine.by_screws
    results = [evaluate_job(job) for job in (rows, screws)]
    one, other = results
    assert isinstance(one, Result)
    assert isinstance(other, Result)
    found, same = (tracked.results(each)["positions"] for each in (one, other))
    for when in ("before", "after", "held_out"):
        for figure in ("mean_um", "rms_um", "largest_um"):
            assert found[when][figure] == pytest.approx(same[when][figure], abs=6.0), (when, figure)
    assert found["before"]["rms_um"] > 10 * found["after"]["rms_um"]
    for effect in ("eccentricity_q1", "sag_q2", "slack_q3"):
        for name, quantity in one.parameters[effect].items():
            again = other.parameters[effect][name]
            assert abs(quantity.value - again.value) < 0.3 * quantity.u, (effect, name)
            assert again.u == pytest.approx(quantity.u, rel=0.1)
    names = {"eccentricity_q1": "amplitude_arcsec", "sag_q2": "arcsec_per_m", "slack_q3": "gap_arcsec"}
    for (effect, name), value in zip(names.items(), (70.0, 250.0, 90.0), strict=True):
        quantity = other.parameters[effect][name]
        assert abs(quantity.value - value) < 4 * quantity.u, effect
