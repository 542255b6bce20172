"""Every kind, every characteristic and every line that a budget can have stands in words."""

from __future__ import annotations

from typing import get_args

import pytest

from cmm_uq.geometry.association import ASSOCIATIONS
from cmm_uq.messages import Message, Verbatim, say
from cmm_uq.parts import in_words, plan
from cmm_uq.parts.budget import PLACE
from tests.documents.parts_found import found_of


def test_every_kind_has_words() -> None:
    assert set(in_words.KINDS) == set(get_args(plan.FeatureKind))
    assert set(in_words.CHARACTERISTICS) == set(plan.WHATS)
    assert set(in_words.ASSOCIATIONS) == set(ASSOCIATIONS)


def test_every_line_of_a_budget_has_words() -> None:
    """Those of a plate with all that a job can state; only errors of the machine are named by effects."""
    found = found_of()
    lines = [*found.budget.causes, *found.budget.factors]
    unknown = [line for line in lines if not isinstance(in_words.line_in_words(line, {}), Message)]
    assert all(line.startswith("machine: ") for line in unknown)
    assert {in_words.family_of(line) for line in lines} <= set(in_words.FAMILIES)


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
