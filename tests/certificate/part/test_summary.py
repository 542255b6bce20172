"""A part in a few lines: what to measure on the machine is named with its file, set-ups are left to the page."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

from cmm_uq.base.messages import say
from cmm_uq.certificate.part.found import Further
from cmm_uq.certificate.part.summary import _remarks


def remark(further: Further) -> str:
    found: Any = SimpleNamespace(standing=SimpleNamespace(path=say("drawn")), unseen=(), further=further)
    return str(_remarks(found)[-1])


def test_what_further_set_ups_show_is_named_and_what_they_do_not_is_left_out() -> None:
    further = Further(
        ("scale_x", "rotation_x_x"), 2, say("all"), "cmm-uq plan further", "further/job.toml", ("rotation_x_x",)
    )
    assert remark(further) == "2 further set-ups of the artefact show Scale error of X: further/job.toml."


def test_where_none_shows_anything_that_is_said() -> None:
    said = remark(Further(("rotation_x_x",), 0, say("all"), missed=("rotation_x_x",)))
    assert said == "No further set-up of the artefact as it was recorded shows what the calibration did not see."
