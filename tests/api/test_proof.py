"""``cmm_uq.prove`` gives its figures as a table; nothing is written before it is asked for."""

from __future__ import annotations

from pathlib import Path

import pytest

import cmm_uq
from cmm_uq.api.outcomes import Proof
from cmm_uq.documents.proof_results import proof_outcome
from tests.commands.test_proving import Ran, ran  # noqa: F401 - a fixture


@pytest.fixture
def proof(ran: Ran) -> Proof:  # noqa: F811
    return Proof(proof_outcome(ran.proof))


def test_rates_are_a_table_and_the_files_those_of_the_command(proof: Proof, tmp_path: Path) -> None:
    assert proof.rates.loc["false_alarms", ["count", "of"]].tolist() == [0, 1]
    assert proof.rates.loc["coverage", "of"] >= 1
    assert len(proof.sha256) == 64
    assert repr(proof).startswith("<Proof of plane-simulated: 2 cases, false_alarms open, coverage open")
    written = proof.write(tmp_path / "out")
    assert sorted(written) == [
        "cases.jsonl", "manifest.json", "results.json", "truth.json", "validation-simulated.html", "validation-simulated.pdf",
    ]  # fmt: skip


def test_a_call_refuses_what_the_command_refuses(iota: Path) -> None:
    with pytest.raises(cmm_uq.CmmUqError, match="0 cases"):
        cmm_uq.prove(iota, cases=0)
