"""What stays free is said once for effects whose titles differ in their last word alone, in the order of the first of them."""

from __future__ import annotations

import pytest

from cmm_uq.app.commands.plans.words import combination
from cmm_uq.base.messages import Message
from cmm_uq.machine.model.measurement import ARTEFACT


@pytest.mark.parametrize(("effects", "sizes", "words"), [
    (["scale_x"], 0, "Scale error of X: nothing shows of it"),
    (["scale_x", "scale_y", "scale_z"], 1, "Scale error of X, Y and Z together, with the artefact's own length"),
    (["squareness_xy", "hysteresis_x", "squareness_zx"], 0, "Squareness X–Y and Z–X and Hysteresis of X together"),
    (["artefact_sag", "scale_x"], 0, "Sag of the artefact and Scale error of X together"),
    ([], 1, "The artefact's own length"), ([], 2, "The artefact's own dimensions"),
])  # fmt: skip
def test_a_free_combination_in_words(effects: list[str], sizes: int, words: str) -> None:
    parts = {(effect, "p"): 1.0 for effect in effects} | {(ARTEFACT, f"size_{i}_mm"): 1.0 for i in range(sizes)}
    found = combination(parts)
    assert found == words
    assert isinstance(found, Message)
