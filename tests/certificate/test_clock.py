"""No result depends on when it is written: no module reads a clock, and only a new job's date comes from one."""

from __future__ import annotations

import ast
from collections import defaultdict

import pytest

from cmm_uq.certificate.document import Document
from cmm_uq.certificate.render.html import render_html
from cmm_uq.certificate.render.pdf import render_pdf
from tests.conftest import ROOT

CLOCKS = {
    "now",
    "today",
    "utcnow",
    "time_ns",
    "localtime",
    "gmtime",
    "ctime",
    "perf_counter",
    "monotonic",
    "process_time",
}
READ = {
    "cmm_uq/base/output": {"monotonic"}, "cmm_uq/app/commands/jobs": {"now"}, "cmm_uq/app/commands/parts": {"now"},
    "cmm_uq/laboratory/live": {"now"}, "cmm_uq/laboratory/live/instruments": {"now", "time_ns", "monotonic"},
    "cmm_uq/laboratory/records": {"now"}, "cmm_uq/app/cli": {"now"}, "cmm_uq/app/commands/laboratory": {"now"},
    "cmm_uq/laboratory/schedule": {"now", "time", "monotonic"}, "cmm_uq/certificate/sign": {"now"},
    "cmm_uq/app/serve": {"now", "monotonic"},
}  # fmt: skip
"""How long a command waits for another one's lock, or for what it is writing when it is interrupted; the date that a new job
begins with, for its reader to change; when a reading came, and when a simulated instrument sends one; when something was
recorded or sent, on which day something is due, when something was signed, and how long a job, a lock, a cluster or a browser
is waited for. No certificate and no results.json has any of these."""


def clocks(source: str) -> set[str]:
    """Clocks that a module reads, by the names of ``time`` and ``datetime``."""
    calls = [node.func for node in ast.walk(ast.parse(source)) if isinstance(node, ast.Call)]
    named = [call for call in calls if isinstance(call, ast.Attribute)]
    of_time = {
        "time" for call in named if call.attr == "time" and isinstance(call.value, ast.Name) and call.value.id == "time"
    }
    return {call.attr for call in named if call.attr in CLOCKS} | of_time


def test_no_room_reads_a_clock_but_these() -> None:
    read = defaultdict(set)
    for path in (ROOT / "cmm_uq").rglob("*.py"):
        read[path.parent.relative_to(ROOT).as_posix()] |= clocks(path.read_text(encoding="utf-8"))
    assert {room: names for room, names in read.items() if names} == READ


@pytest.mark.parametrize("call", ["dt.datetime.now()", "date.today()", "time.time()", "time.perf_counter()"])
def test_a_clock_would_be_found(call: str) -> None:
    assert clocks(f"x = {call}")


@pytest.mark.parametrize("epoch", ["0", "4102444800"])
def test_the_epoch_of_a_reproducible_build_changes_no_byte(
    epoch: str, certificate: Document, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.delenv("SOURCE_DATE_EPOCH", raising=False)
    before = render_html(certificate), render_pdf(certificate, {"job.toml": b"[job]"})
    monkeypatch.setenv("SOURCE_DATE_EPOCH", epoch)
    assert (render_html(certificate), render_pdf(certificate, {"job.toml": b"[job]"})) == before
