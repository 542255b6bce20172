"""No encoding of a terminal or a pipe stops a command, and JSON says the same in each."""

from __future__ import annotations

import inspect
import io
import json
import sys
from pathlib import Path

import pytest
from hypothesis import given, strategies as st

from cmm_uq.app.cli import terminal as encoding
from cmm_uq.app.commands.plans.plan import plan_summary
from cmm_uq.base.messages import say
from cmm_uq.base.units import Unit
from cmm_uq.certificate.wording import Summary
from tests.conftest import ROOT


def written(text: str, codec: str, monkeypatch: pytest.MonkeyPatch) -> str:
    stream = io.TextIOWrapper(io.BytesIO(), encoding=codec)
    monkeypatch.setattr(sys, "stdout", stream)
    encoding.any_character()
    stream.write(text)
    stream.flush()
    assert isinstance(stream.buffer, io.BytesIO)
    return stream.buffer.getvalue().decode(codec)


def test_ascii_has_the_nearest_of_what_is_printed(monkeypatch: pytest.MonkeyPatch) -> None:
    assert written("−174 ± 16 ″, 3 µm → 4 ≤ 5", "ascii", monkeypatch) == '-174 +/- 16 ", 3 um -> 4 <= 5'
    assert written("machine 漢 \udcff", "ascii", monkeypatch) == "machine \\u6f22 \\udcff"


def test_what_windows_writes_into_a_pipe_keeps_what_it_can(monkeypatch: pytest.MonkeyPatch) -> None:
    assert written("−1 ± 2 µm…", "cp1252", monkeypatch) == "-1 ± 2 µm…"


@given(st.text())
def test_json_is_the_same_data_in_every_encoding(text: str) -> None:
    for codec in ("ascii", "cp1252", "utf-8"):
        found = encoding.json_for(codec, json.dumps({"a": text}, ensure_ascii=False))
        found.encode(codec, "surrogatepass" if codec == "utf-8" else "strict")
        assert json.loads(found) == {"a": text}


def test_everything_that_the_program_prints_beyond_ascii_has_a_nearest() -> None:
    """Of the modules that write what a terminal shows; a unit or a sign that is added there must be added here too."""
    writers = map(inspect.getfile, (plan_summary, Summary, Unit, say))
    sources = [*(ROOT / "cmm_uq" / "app" / "cli").rglob("*.py"), *map(Path, writers)]
    used = {c for path in sources for c in path.read_text(encoding="utf-8") if not c.isascii()}
    assert sorted(used - encoding.NEAREST.keys()) == []
