"""What goes to a terminal: colours, encodings, and lines of any width."""

from __future__ import annotations

import inspect
import io
import json
import os
import re
import sys
from itertools import product
from pathlib import Path

import pytest
from hypothesis import given, strategies as st
from rich.cells import cell_len

from cmm_uq.app.cli import terminal as encoding
from cmm_uq.app.cli.summary import COLOURS, Layout
from cmm_uq.app.cli.terminal import Line, folded, progress, time_left
from cmm_uq.app.commands.plan import plan_summary
from cmm_uq.base.messages import Verbatim, say
from cmm_uq.base.units import Unit
from cmm_uq.certificate.wording import Headline, Summary
from tests.app.cli.terminal import on_terminal
from tests.artefacts.simulated import outcome
from tests.conftest import ROOT

ANSWER = "cmm-uq: No such option: --seeed. Did you mean --seed? cmm-uq report --help lists its options"


@pytest.mark.skipif(os.name == "nt", reason="pseudo-terminals of POSIX")
@pytest.mark.parametrize(
    ("environment", "coloured"), [({}, True), ({"NO_COLOR": "1"}, False), ({"TERM": "dumb"}, False)]
)
def test_an_error_is_folded_between_words_and_red_only_where_colour_is_wanted(
    environment: dict[str, str], coloured: bool
) -> None:
    code, told = on_terminal("report", "x", "--seeed", "3", columns=60, environment=environment)
    assert code == 2
    assert ("\x1b[1;31mcmm-uq:\x1b[0m" in told) is coloured
    plain = told.replace("\x1b[1;31m", "").replace("\x1b[0m", "")
    assert "\x1b" not in plain
    assert max(map(len, plain.splitlines())) <= 60
    assert " ".join(plain.split()) == ANSWER


def stages(capsys: pytest.CaptureFixture[str], *, quiet: bool, verbose: bool) -> list[str]:
    with progress(quiet=quiet, verbose=verbose) as stage:
        for part in (0.0, 0.5, 1.0) if stage else ():
            stage(f"Sampling: {part:.0%} of the draws needed", part)
        if stage:
            stage("Writing", 1.0)
    said = capsys.readouterr()
    assert said.out == ""
    return said.err.splitlines()


def test_away_from_a_terminal_stages_are_told_once_each_and_only_when_asked_for(
    capsys: pytest.CaptureFixture[str],
) -> None:
    assert stages(capsys, quiet=False, verbose=True) == ["Sampling", "Writing"]
    assert stages(capsys, quiet=False, verbose=False) == []
    assert stages(capsys, quiet=True, verbose=True) == []


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


@pytest.mark.long
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


FILES = [("certificate.html, certificate.pdf", "the certificate"), ("results.json", "every figure, for other programs")]
WORDS = st.lists(st.text("abcäµ漢-/.,\u00a0", min_size=1, max_size=12), min_size=1, max_size=60)


def text(lines: list[Line]) -> list[str]:
    return ["".join(part for part, _ in line) for line in lines]


def screen(job: str, width: int | None, *, verbose: bool = False) -> list[Line]:
    found = outcome(job)
    name = found.found.job.facts.job.id
    return Layout(width, verbose).screen(found.summary, name=name, files=FILES, folder="reports/x")


@given(WORDS, st.integers(20, 200))
def test_folding_keeps_every_word_and_no_line_is_too_long(words: list[str], width: int) -> None:
    lines = folded(" ".join(words), width)
    assert " ".join(lines) == " ".join(words)
    assert all(cell_len(line) <= width for line in lines)


def test_a_word_longer_than_the_line_stays_whole_so_that_a_path_can_be_copied() -> None:
    assert folded(f"see {'p' * 50} there", 20) == ["see", "p" * 50, "there"]


@pytest.mark.parametrize("job", ["iota-1102-20C", "sphere-simulated"])
def test_no_line_runs_over_the_edge_and_the_decision_stands_first(job: str) -> None:
    for width, verbose in product((60, 80, 120, 200), (False, True)):
        lines = screen(job, width, verbose=verbose)
        assert max(cell_len(line) for line in text(lines)) <= width
        (word, style), *_ = lines[0]
        assert (word, style) == {"iota-1102-20C": ("FAIL", "bold red"), "sphere-simulated": ("PASS", "bold green")}[job]


def test_an_ordinary_certificate_is_27_lines_of_80_columns_with_three_warnings() -> None:
    """Three lines of decision, ten figures, two lines a warning; a screen of 24 rows and a little."""
    lines = text(screen("iota-1102-20C", 80))
    assert len(lines) == 27
    assert "3 warnings, shortened: --verbose shows all" in lines


def test_verbose_says_every_warning_to_its_last_word() -> None:
    shown = " ".join(" ".join(text(screen("iota-1102-20C", 80, verbose=True))).split())
    warnings = outcome("iota-1102-20C").summary.warnings
    assert len(warnings) == 3
    assert all(" ".join(warning.split()) in shown for warning in warnings)


def test_away_from_a_terminal_every_fact_is_one_whole_line() -> None:
    lines = text(screen("iota-1102-20C", None))
    found = outcome("iota-1102-20C").summary
    assert [line for line in lines if line.startswith("FAIL  ASME B89.4.1-1997, volumetric performance: 340 µm")]
    for i, warning in enumerate(found.warnings):
        assert f"  {i + 1}. {warning}" in lines
    for name, value, k in found.figures:
        assert any(re.fullmatch(rf"  {re.escape(name)} +{re.escape(value)} +{re.escape(k)}", line) for line in lines)


def test_the_tenth_remark_is_on_the_screen_only_when_asked_for() -> None:
    told = Summary(remarks=tuple(Verbatim(f"remark {i}") for i in range(10)))
    short, whole = (text(Layout(80, verbose).screen(told)) for verbose in (False, True))
    assert short[-2:] == ["  6. remark 5", "  … and 4 more: --verbose, or the document"]
    assert whole[-1] == "  10. remark 9"


def test_words_that_steer_a_terminal_are_shown_as_escapes() -> None:
    told = Summary(Verbatim("machine\x1b[31m"), verdicts=(Headline("PASS", "good", Verbatim("a\x07"), ()),))
    assert text(Layout(80).screen(told)) == ["PASS  a\\x07", "machine\\x1b[31m"]


def test_green_is_for_what_passes_alone() -> None:
    assert [name for name, style in COLOURS.items() if "green" in style] == ["good"]


def test_the_screen_in_the_documentation_is_what_is_printed() -> None:
    page = (ROOT / "docs" / "running.md").read_text(encoding="utf-8")
    shown = page.partition("$ cmm-uq report examples/iota-1102-20C\n")[2].partition("  …\n")[0]
    lines = [line.replace("\u00a0", " ") for line in text(screen("iota-1102-20C", 80))]
    assert shown.splitlines() == lines[: shown.count("\n")]
    assert shown.count("\n") > 5


@pytest.mark.parametrize(
    ("elapsed", "part", "told"),
    [
        (60.0, 0.25, "~3 min left"),  # three times as long again
        (10.0, 0.5, "~10 s left"),
        (3600.0, 0.25, "~3.0 h left"),
        (4.0, 0.5, ""),  # of what is soon done nothing is said
        (60.0, 0.01, ""),
        (60.0, 1.0, ""),
    ],
)
def test_how_long_it_will_go_on_is_told_by_what_is_done(elapsed: float, part: float, told: str) -> None:
    assert time_left(elapsed, part) == told
