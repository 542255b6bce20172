"""What an operator may type."""

from __future__ import annotations

import pytest

from cmm_uq.base.errors import CmmUqError
from cmm_uq.laboratory.live.screen import OperatorInput, understood


def test_numbers_words_and_nothing() -> None:
    assert understood("1.5 -2 3e1") == OperatorInput("point", "1.5 -2 3e1", (1.5, -2.0, 30.0))
    assert understood("404.2") == OperatorInput("point", "404.2", (404.2,))
    assert understood("  ") == OperatorInput("take")
    assert understood("u the ball slipped") == OperatorInput("undo", "the ball slipped")
    assert understood("QUIT") == OperatorInput("quit")


@pytest.mark.parametrize(("line", "told"), [
    ("1 2", "2 numbers. Type three coordinates"), ("1,5 2 3", "Write decimals with a point"), ("undo", "undo without a text"),
    ("r", "'r' is no word"), ("jump", "'jump' is no word"), ("1 2 1e9", "more than anything that is measured"),
    ("nan", "'nan' is no word"), ("1 2 3_0", "is not a number"),
])  # fmt: skip
def test_anything_else_is_told_what_it_lacks(line: str, told: str) -> None:
    with pytest.raises(CmmUqError) as error:
        understood(line)
    assert told in str(error.value)
