"""Values and keys as a file of TOML has them are read back as they were."""

from __future__ import annotations

import tomllib
from typing import Any

from hypothesis import given, strategies as st

from cmm_uq.base.files.toml_file import nested
from cmm_uq.jobs.schema import commented, written, written_key

NAMES = st.text(st.characters(exclude_categories=["Cs"]))
VALUES = st.recursive(
    st.booleans() | st.integers(-(2**63), 2**63 - 1) | st.floats(allow_nan=False) | NAMES | st.dates(),
    lambda inner: st.lists(inner, max_size=3) | st.dictionaries(NAMES, inner, max_size=3),
    max_leaves=6,
)
SCHEMA = {"properties": {"recording": {"properties": {"file": {"description": "The recording."}}}}}


@given(st.dictionaries(NAMES, VALUES, max_size=4))
def test_whatever_the_names_a_table_is_read_back(table: dict[str, Any]) -> None:
    assert tomllib.loads(f"lines = {written(table)}")["lines"] == table
    if table:
        assert tomllib.loads(commented(SCHEMA, {"recording": table}, comment=False))["recording"] == table


def test_plain_names_stand_without_quotes() -> None:
    assert [written_key(name) for name in ("x_mm", "1", "a-b", "", "é", "a b")] == [
        "x_mm", "1", "a-b", '""', '"é"', '"a b"',
    ]  # fmt: skip


def test_dotted_keys_are_keys_of_tables_over_what_stands_there() -> None:
    table = {"travel": {"x": 1, "y": 2}, "limit": 3, "travel.x": 4, "limit.a": 5, "a.b.c": 6, "a.b.d": 7}
    assert nested(table) == {"travel": {"x": 4, "y": 2}, "limit": {"a": 5}, "a": {"b": {"c": 6, "d": 7}}}
    assert table["travel"] == {"x": 1, "y": 2}
