"""The page of all effects says what the effects do: names, priors, columns, and which artefact sees each."""

from __future__ import annotations

from tests.machine.physics.effect_table import END, PAGE, START, table


def test_the_page_of_effects_is_up_to_date() -> None:
    """Written anew by ``python -m tests.machine.physics.effect_table``."""
    text = PAGE.read_text(encoding="utf-8")
    assert text.partition(START)[2].partition(END)[0].strip() == table()
