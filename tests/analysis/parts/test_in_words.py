"""Every kind, every characteristic and every line that a budget can have stands in words."""

from __future__ import annotations

from dataclasses import replace
from typing import get_args

import numpy as np
import pytest

from cmm_uq.analysis.machine.state import StatedNoise
from cmm_uq.analysis.parts import budget as in_words, plan
from cmm_uq.analysis.parts.budget import PLACE, variance_shares
from cmm_uq.analysis.parts.reported import measured_of
from cmm_uq.analysis.parts.setup import circumstances_of, plan_of
from cmm_uq.analysis.parts.virtual import Virtual
from cmm_uq.base.messages import Message, Verbatim, say
from cmm_uq.jobs.part.feature import Kind
from cmm_uq.jobs.part.job import TABLES
from cmm_uq.maths.geometry.association import ASSOCIATIONS
from tests.certificate.parts_found import machine
from tests.jobs.part.parts import plate


def test_every_kind_has_words() -> None:
    assert set(in_words.KINDS) == set(get_args(Kind))
    assert set(in_words.CHARACTERISTICS) == set(plan.WHATS)
    assert set(in_words.ASSOCIATIONS) == set(ASSOCIATIONS)


def test_every_line_of_a_budget_has_words() -> None:
    """Those of a plate with all that a job can state; only errors of the machine are named by their effects."""
    environment = {
        "part_c": 21.0, "u_part_k": 0.1, "u_scales_k": 0.1, "scales_cte_per_k": 8e-6, "u_scales_cte_per_k": 1e-6,
        "u_gradient_k_per_m": [0.1, 0.1, 0.1], "u_drift_k": 0.1,
    }  # fmt: skip
    stylus = [{**one, "u_offset_um": [0.1, 0.1, 0.1]} for one in TABLES["stylus"]]
    characteristic = [{**TABLES["characteristic"][0], "u_operator_um": 1.0}, *TABLES["characteristic"][1:]]
    values = b"characteristic,value_mm\n1,30.00\n2,0.01\n3,0.01\n4,0.01\n5,40.00\n"
    job = measured_of(plate(
        {"report.csv": values}, recording={"values": "report.csv"}, environment=environment, negligible=None,
        stylus=stylus, characteristic=characteristic, placing={"u_origin_mm": [9.0, 9.0, 0.0],
        "origin_mm": [300.0, 450.0, -500.0], "u_fixture_um": 0.5},
        probing={"u_operator_um": 1.0, "seconds_per_point": 5.0},
    )).job  # fmt: skip
    plan = plan_of(job)
    noise = StatedNoise(np.full(3, 1e-3), placing_mm=1e-3, growth_mm=1e-3, longest_mm=500.0, slow_mm=1e-3)
    given = circumstances_of(job, replace(machine(), noise=noise), plan, 2)
    found = variance_shares(Virtual(plan, given), 64)
    lines = [*found.causes, *found.factors]
    unknown = [line for line in lines if not isinstance(in_words.line_in_words(line, {}), Message)]
    assert all(line.startswith("machine: ") for line in unknown), unknown
    assert {in_words.family_of(line) for line in lines} == set(in_words.FAMILIES)


@pytest.mark.parametrize(("line", "words"), [
    ("stylus: tip size down: left", "Size of the tip of down: left"),
    ("form: form of form of A", "Form of form of A"),
    ("form: roughness of A", "Roughness of A"),
    ("machine: scale_x", "Scale of X"),
    ("machine: not an effect", "not an effect"),
    ("machine", "Errors of the machine"),
    (PLACE, "Place on the table"),
    ("of another package", "of another package"),
])  # fmt: skip
def test_a_line_keeps_the_names_in_it(line: str, words: str) -> None:
    assert in_words.line_in_words(line, {"scale_x": say("Scale of X")}) == words


def test_a_name_of_the_user_s_is_never_translated() -> None:
    said = in_words.line_in_words("form: form of Bohrung", {})
    assert isinstance(said, Message)
    assert isinstance(said.arguments["name"], Verbatim)
