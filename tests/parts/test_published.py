"""What others printed comes out again."""

from __future__ import annotations

import pytest

from benchmarks.parts.published import Figure, arcs, circles, polar


@pytest.mark.parametrize("one", [*circles(), *polar(), *arcs()], ids=lambda one: one.what)
def test_a_printed_figure_comes_out_again(one: Figure) -> None:
    assert abs(one.found - one.expected) <= one.within, one.where
