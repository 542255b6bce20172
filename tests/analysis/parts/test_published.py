"""What others printed comes out again."""

from __future__ import annotations

from collections.abc import Callable

import pytest

from benchmarks.parts.published import Figure, arcs, circles, polar


@pytest.mark.parametrize("figures", [circles, polar, arcs])
def test_printed_figures_come_out_again(figures: Callable[[], list[Figure]]) -> None:
    assert [one for one in figures() if not one.holds] == []
