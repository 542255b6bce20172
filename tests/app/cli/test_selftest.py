"""``cmm-uq selftest``: what a laboratory files as evidence."""

from __future__ import annotations

import json
import re

import pytest
import typer

from cmm_uq.app.cli.evaluations import selftest as command
from cmm_uq.maths.uncertainty.reference import jcgm, selftest
from cmm_uq.maths.uncertainty.reference.jcgm import ReferenceCase
from tests.app.cli.process import run

SUM = ReferenceCase("sum", "arithmetic", {"a": (2.0, 0.1)}, lambda: [2.5])


def test_every_published_figure_is_reproduced_and_named_with_its_source() -> None:
    done = run("selftest", "--verbose")
    assert done.returncode == 0, done.stdout
    passed, total = map(int, re.search(r"(\d+) of (\d+) figures", done.stdout).groups())
    assert passed == total > 100
    rows = re.findall(r"(?m)^PASS  (.+): (\S+), expected (\S+) within (\S+) \((.+)\)$", done.stdout)
    assert len(rows) == total
    assert any("JCGM 101" in source for *_, source in rows)


def test_programs_get_the_figures_as_numbers_and_what_differs_ends_with_4(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    outcomes = [*selftest.run(jcgm.CASES[:4]), *selftest.run([SUM])]
    monkeypatch.setattr(selftest, "run", lambda: outcomes)
    with pytest.raises(typer.Exit) as ended:
        command(json=True)
    assert ended.value.exit_code == 4
    data = json.loads(capsys.readouterr().out)
    *figures, wrong = data["figures"]
    assert (data["schema"], data["passed"]) == ("cmm-uq/selftest/1", len(figures))
    assert (wrong["case"], wrong["expected"], wrong["got"], wrong["passed"]) == ("sum: a", 2.0, 2.5, False)
    for figure in figures:
        assert figure["passed"] is True
        assert abs(figure["got"] - figure["expected"]) <= figure["tolerance"] + 1e-12 * abs(figure["expected"])
