"""A diagnosis is computed again with the options that it was made with: they follow from results.json."""

from __future__ import annotations

from typing import Any

import pytest

from cmm_uq.app.commands.certificates.again import again
from cmm_uq.app.commands.reading import read_job
from cmm_uq.base.errors import CmmUqError
from cmm_uq.certificate.results.contents import false_alarms
from cmm_uq.certificate.verify.given import Given
from tests.conftest import ROOT

JOB = ROOT / "examples" / "plane-simulated"


class AskedError(Exception):
    """What the diagnosis was asked for."""


@pytest.mark.parametrize("alpha", [0.01, 0.05])
def test_a_diagnosis_is_made_again_with_its_rate_of_false_alarms(monkeypatch: pytest.MonkeyPatch, alpha: float) -> None:
    def asked(job: object, **options: Any) -> None:
        raise AskedError(options["seed"], options["alpha"])

    monkeypatch.setattr("cmm_uq.app.commands.certificates.again.diagnosis_outcome", asked)
    data = {"sampling": {"seed": 3}, "diagnosis": {"verdict": "consistent", **false_alarms(alpha)}}
    with pytest.raises(AskedError) as told:
        again(Given(results=("results.json", data, b"")), read_job(JOB))
    assert told.value.args == (3, alpha)


@pytest.mark.parametrize(
    "data", [{"diagnosis": {"false_alarms": 2.0}}, {"sampling": {"seed": -1}}, {"sampling": {"seed": "x"}}]
)
def test_options_that_cannot_be_are_refused(data: dict[str, Any]) -> None:
    with pytest.raises(CmmUqError, match="is no"):
        again(Given(results=("results.json", data, b"")), read_job(JOB))
