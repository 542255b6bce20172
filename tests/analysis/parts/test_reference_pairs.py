"""Points whose feature is known exactly give that feature, through plan and characteristics, to 1e-9 mm."""

from __future__ import annotations

import pytest

from benchmarks.parts.reference_pairs import every, pair
from cmm_uq.analysis.parts.plan import FeatureKind
from cmm_uq.maths.geometry.association import Association


@pytest.mark.parametrize(("kind", "how"), list(every()))
def test_a_reference_pair_gives_form_size_direction_and_place_to_a_picometre(
    kind: FeatureKind, how: Association
) -> None:
    for name, off in pair(kind, how, seed=7).items():
        assert off < 1e-9, name
