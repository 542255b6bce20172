"""Lines that manuals print, replayed through each profile: read as they mean, or refused in words."""

from __future__ import annotations

import tomllib
from pathlib import Path
from typing import Any

import pytest

from cmm_uq.jobs.tables.plan import DeclaredSource
from cmm_uq.laboratory.live.instruments.instrument import Introduction, open_source
from cmm_uq.laboratory.live.instruments.library import profile_named, ready
from cmm_uq.laboratory.live.instruments.parsing import FramedMessage
from cmm_uq.laboratory.live.instruments.profile import bytes_of
from cmm_uq.laboratory.live.instruments.source import Reading
from tests.laboratory.live.instruments.listening import listening

CAPTURED = tomllib.loads(Path(__file__).with_name("captured.toml").read_text(encoding="utf-8"))
WITHOUT = {"ipp", "ipp-position", "line-logger", "thermocouple-logger-11", "fluke-1529", "asl-f250", "pico-pt104"}
"""CMMs and the PT-104 have tests of their own; the loggers' lines are this program's; of the 1529 and the F250 no page prints
a line."""


def test_there_are_lines_for_every_profile_of_an_instrument_whose_manual_prints_some() -> None:
    assert {one["profile"] for one in CAPTURED["line"]} == set(ready()) - WITHOUT
    assert all(one["source"] for one in CAPTURED["line"] + CAPTURED["identity"])


@pytest.mark.parametrize("name", sorted({one["profile"] for one in CAPTURED["line"]}))
def test_lines_of_the_manuals_are_read_as_they_mean(name: str, tmp_path: Path) -> None:
    lines = [one for one in CAPTURED["line"] if one["profile"] == name]
    (tmp_path / "log").write_bytes(b"".join(bytes_of(one["received"]) for one in lines))
    source = open_source(DeclaredSource(name="a", profile=name, port="file:log"), folder=tmp_path)
    with listening(source) as heard:
        heard.until(lambda one: not one._thread.is_alive())
    readings = [one for one in heard.of(Reading) if isinstance(one, Reading) and one.raw.strip(b"\r\n")]
    assert len(readings) == len(lines)
    for line, reading in zip(lines, readings, strict=True):
        assert reading.values == pytest.approx(line.get("values", {}), rel=1e-12), line
        assert line["says"] in str(reading.status) if "says" in line else reading.status is None, line


@pytest.mark.parametrize("one", CAPTURED["identity"], ids=lambda one: str(one["profile"]))
def test_what_an_instrument_says_of_itself_is_understood(one: dict[str, Any]) -> None:
    wanted = profile_named(one["profile"]).identify
    assert wanted is not None
    heard = Introduction(wanted)
    for line in one["received"].strip("\n").split("\n"):
        heard.hear(FramedMessage(bytes_of(line), bytes_of(line)))
    assert heard.found is not None
    found = {key: value for key, value in vars(heard.found).items() if value and key != "name"}
    assert found == one["is"]
