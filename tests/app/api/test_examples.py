"""What the docstrings of the API show is run, and gives what they say."""

from __future__ import annotations

import doctest
from importlib import import_module

import pytest

from tests.conftest import ROOT


@pytest.mark.parametrize(
    ("module", "least"), [("cmm_uq", 3), ("cmm_uq.app.api.calls", 10), ("cmm_uq.app.api.calls", 4)]
)
def test_the_examples_of_the_docstrings_hold(module: str, least: int, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(ROOT)
    ran = doctest.testmod(import_module(module), raise_on_error=False)
    assert ran.attempted >= least
    assert ran.failed == 0
