"""The same figures on every BLAS kernel of this processor: closed forms as printed, sampled ones within a tenth of u."""

from __future__ import annotations

from pathlib import Path

import pytest

from benchmarks.hostile.kernels import EXAMPLES, compared, differences, kernels


@pytest.mark.long
@pytest.mark.parametrize("example", EXAMPLES)
def test_figures_do_not_depend_on_the_kernel(example: str, tmp_path: Path) -> None:
    found = kernels()
    if len(found) < 2:
        pytest.skip("these libraries obey no OPENBLAS_CORETYPE on this processor")
    (_, again, _), (_, _, differ) = compared(example, found[-1], found[:1], tmp_path)
    assert again, "the same kernel twice gives other bytes"
    assert differ == []


def test_a_figure_in_closed_form_may_not_move_and_a_sampled_one_by_a_tenth_of_u() -> None:
    value = {"value": 10.0, "u": 1.0, "interval95": [8.0, 12.0]}
    moved = {"value": 10.09, "u": 1.0, "interval95": [8.0, 12.11]}
    assert list(differences({"accuracy": value}, {"accuracy": moved})) != []
    assert list(differences({"estimates": {"a": value}}, {"estimates": {"a": moved}})) == [
        ".estimates.a.interval95: 12.0 and 12.11, u = 1.0"
    ]
    assert list(differences({"decision": "pass"}, {"decision": "fail"})) == [".decision: 'pass' and 'fail'"]
