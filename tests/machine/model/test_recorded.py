"""What recorded points must be before an artefact is made of them."""

from __future__ import annotations

import pytest

from cmm_uq.base.errors import CmmUqError
from cmm_uq.machine.model.recorded import check_length


def test_references_in_one_place_are_refused() -> None:
    with pytest.raises(CmmUqError, match=r"their references lie all in one place.*own reference"):
        check_length(400.0, 0.0, "the recorded plates", "recording.csv")


@pytest.mark.parametrize(
    ("measured", "says"), [(400_000.0, "not mm"), (405.0, "differ by 12.5 mm/m"), (395.9, "differ")]
)
def test_a_length_that_only_a_unit_or_another_artefact_explains_is_refused(measured: float, says: str) -> None:
    with pytest.raises(CmmUqError, match=says):
        check_length(measured, 400.0, "the recorded bars", "recording.csv")


@pytest.mark.parametrize("measured", [396.1, 400.0, 403.9])
def test_a_length_within_one_per_cent_is_taken(measured: float) -> None:
    check_length(measured, 400.0, "the recorded bars", "recording.csv")
