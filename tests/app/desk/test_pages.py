"""Pages in states that no other test comes to: each is shown, every label and caption beside what it names."""

from __future__ import annotations

import datetime as dt
import re
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

from cmm_uq.app.desk import job_pages
from cmm_uq.app.desk.desk import Desk
from cmm_uq.app.desk.place import Draft
from cmm_uq.app.serve.page import WebPage, page
from cmm_uq.base.messages import Verbatim
from cmm_uq.jobs.verdicts import Verdict, Verdicts

READ: dict[str, Any] = {
    "problem": ["x", "cannot say", "points_per_measurement = N"], "lines": [], "example": "", "amounts": "", "stated": [],
    "doubtful": [],
    "sheets": ["a", "b"],
    "columns": [["X", "x_mm"], ["", "unknown"], ["n", "name"], ["t", "of another package"]], "more": 5, "command": "",
    "rows": [[1, ["X", "", "n", "t"], True], [2, ["1", "2", "<b>", "4"], False]], "facts": [["<b>", "b"]],
}  # fmt: skip
KEYS = {"unit": "mm", "points_per_measurement": 3, "lines": {"1": "along X"}}
STATED = Verdicts([
    Verdict("E0", "incomplete", 1.2, 0.3, 4.0, Verbatim("µm"), "ISO", missing=(Verbatim("3 lengths"),)),
    Verdict("x", "fail", None, None, None, Verbatim("")),
])  # fmt: skip


def read(**said: Any) -> WebPage:
    return job_pages.read_page(Draft("0" * 16, "x/<b>.csv", KEYS), READ | said, ["plan.csv"])


def run(**state: Any) -> WebPage:
    shown = {"job": "K", "what": "<b>", "problem": None, "cancelled": False, "state": lambda: {"percent": 3}}
    return page("desk/run.html", "/desk", run=SimpleNamespace(**(shown | state)))


def certificate(stated: Verdicts = STATED, warnings: tuple[str, ...] = ("not stated: <b>",)) -> WebPage:
    files, made = ("reports/K/c.pdf", "reports/K/c-simulated.html"), dt.datetime(2026, 1, 1)
    return job_pages.certificate_page(job_pages.JobState("K", "K", "M", False, {}, stated, made, True, files=files),
                                      None, True, warnings)  # fmt: skip


@pytest.mark.parametrize(("shown", "told"), [
    (read(), "say below how many rows in turn"),
    (read(problem=None, lines=[("1", "", "", ""), ("X", "", "x", "")]), "Where line X lies"),
    (read(lines=[("1", "", "", "")]), '<option value="plan.csv"'),
    (read(lines=[("2", "along X from ?,8,4", "", "")]), 'value="along X from ?,8,4"'),
    (read(columns=[], rows=[], facts=[]), "Delete this export"),
    (run(), "Cancel"), (run(cancelled=True), "nothing was written"), (run(problem=("f", "is wrong", "")), "is wrong"),
    (certificate(), "U = 0.3 µm"), (certificate(Verdicts(), ()), "It states no conformity"),
    (page("desk/part.html", "/desk", draft=None, certificates=[]), "Drop the plan"),
])  # fmt: skip
def test_a_page_is_whole(shown: WebPage, told: str, tmp_path: Path) -> None:
    text = Desk(tmp_path)._response(shown, admitted=True).body.decode()
    assert told in text
    assert "<b>" not in text
    ids = re.findall(r' id="([^"]*)"', text)
    assert len(ids) == len(set(ids))
    assert set(re.findall(r' (?:for|aria-labelledby|aria-describedby|list)="([^"]*)"', text)) <= set(ids)
