"""Each standard's clauses: the form that a laboratory fills in, what certificates say by it, and the table of the docs."""

from __future__ import annotations

import re
from collections.abc import Callable
from pathlib import Path

import pytest

from cmm_uq.analysis.conformity import own_rule
from cmm_uq.analysis.conformity.standards import BUILT_IN, CLAUSES, statement
from cmm_uq.analysis.conformity.statement import Statement, clauses_in_words
from cmm_uq.app.commands.forms import form, write_form
from cmm_uq.app.commands.reading import job_of, read_job
from cmm_uq.artefacts import kind_of
from cmm_uq.base.errors import CmmUqError
from tests.analysis.conformity.recorded import gauge
from tests.app.cli.process import run

ROOT = Path(__file__).parents[3]
NAME = "ISO 10360-2:2009"
FILE = "clauses.toml"


def filled(answers: dict[str, str], name: str = NAME) -> str:
    """The form as it is written, filled in by hand: who, when, which edition, and some clauses."""
    text = (
        form(name)
        .replace('checked_by = ""', 'checked_by = "A. Muster"')
        .replace('edition = ""', 'edition = "Third, 2009"')
    )
    text = text.replace("# on = 2026-01-31", "on = 2026-03-02")
    for clause, answer in answers.items():
        text = re.sub(rf"(\[clauses\.{clause}\].*\n(?:.*\n)*?)# agrees = true.*\n", rf"\g<1>{answer}\n", text, count=1)
    return text


def decided(text: str) -> Statement:
    """E0 of an exact recording of a step gauge, in a job that names the form."""
    folder = ROOT / "examples" / "step-gauge-simulated"
    files = {name: (folder / name).read_bytes() for name in ("job.toml", "recording.csv")}
    job = files["job.toml"].decode().replace(f'standard = "{NAME}"', f'standard = "{NAME}"\nclauses = "{FILE}"')
    read = job_of({**files, "job.toml": job.encode(), FILE: text.encode()})
    assert FILE in read.inputs  # hashed and attached as every input
    return statement(read.facts.conformity[0], gauge(), {}, "[[conformity]] 1", kind_of(read).tested, None,
                     read.circumstances)  # fmt: skip


def test_without_a_form_the_certificate_names_the_clauses_that_nobody_read() -> None:
    read = read_job(ROOT / "examples" / "step-gauge-simulated")
    found = statement(read.facts.conformity[0], gauge(), {}, "[[conformity]] 1", kind_of(read).tested, None,
                      read.circumstances)  # fmt: skip
    (said,) = [text for text in found.remarks if "not checked against the text of" in text]
    assert "positions, what a space diagonal is, longest length, shortest length" in said
    assert "measuring again" in said
    assert "scope" not in said  # its publisher's abstract was read
    assert "offset tip" not in said  # of E150 alone


def test_a_form_says_who_checked_what_when_and_by_which_edition() -> None:
    found = decided(
        filled({"positions": "agrees = true", "longest": 'agrees = true\nchecked_by = "B. Roe"\non = 2026-04-01'})
    )
    said = [text for text in found.remarks if text.startswith("Clauses")]
    assert said[0] == "Clauses checked by A. Muster on 2026-03-02, edition Third, 2009: positions."
    assert said[1] == "Clauses checked by B. Roe on 2026-04-01, edition Third, 2009: longest length."
    assert "positions" not in said[2]
    assert "longest" not in said[2]
    assert "shortest length" in said[2]


def test_with_every_clause_checked_nothing_is_left_unread() -> None:
    answers = dict.fromkeys((one.name for one in CLAUSES[NAME]), "agrees = true")
    assert not any("not checked" in text for text in decided(filled(answers)).remarks)


@pytest.mark.parametrize(("stricter", "lacking"), [("", True), ("\nstricter = true", False)])
def test_a_clause_that_differs_lacks_unless_the_program_asks_for_more(stricter: str, lacking: bool) -> None:
    found = decided(filled({"shortest": f'agrees = false\ndiffers = "No shortest length."{stricter}'}))
    assert any(
        "By the laboratory's copy this differs, shortest length: No shortest length." in t for t in found.remarks
    )
    assert ("shortest length as the laboratory's copy has it" in found.missing) is lacking


def test_what_the_program_does_otherwise_by_now_was_not_checked() -> None:
    text = filled({"shortest": "agrees = true"}).replace("At most 30 mm", "At most 25 mm")
    said = decided(text).remarks[-1]
    assert not any("checked by" in text for text in decided(text).remarks)
    assert "shortest length" in said


@pytest.mark.parametrize(("damage", "message"), [
    (lambda text: text.replace('checked_by = "A. Muster"', 'checked_by = ""'), "checked_by"),
    (lambda text: text.replace("on = 2026-03-02", ""), r"\[on\]: is missing"),
    (lambda text: text.replace("on = 2026-03-02", 'on = "yesterday"'), r"\[on\]: input should be a valid date"),
    (lambda text: text.replace("[clauses.shortest]", "[clauses.shortness]"), "has no clause 'shortness' here"),
    (lambda text: text.replace('standard = "ISO 10360-2:2009"', 'standard = "VDI/VDE 2617"'), "is the form of VDI/VDE 2617"),
    (lambda text: text.replace("\nagrees = true", "\nagrees = false", 1), "agrees = false with differs"),
    (lambda text: text.replace("\nagrees = true", '\nagrees = true\ndiffers = "so"', 1), "agrees = false with differs"),
    (lambda text: text.replace("\nagrees = true", "\nagrees = true\nstricter = true", 1), "stricter belongs to"),
    (lambda text: text.replace("\nagrees = true", "\nagree = true", 1), r"positions\.agree: unknown key.*agrees"),
    (lambda text: text.replace("does =", "did =", 1), "did|does"),
    (lambda text: text[:200], "valid TOML|is missing"),
])  # fmt: skip
def test_a_damaged_form_is_refused_with_its_place(damage: Callable[[str], str], message: str) -> None:
    with pytest.raises(CmmUqError) as refused:
        decided(damage(filled({"positions": "agrees = true"})))
    assert re.search(message, str(refused.value)), refused.value
    assert FILE in str(refused.value)


def test_a_form_that_is_not_there_is_refused() -> None:
    folder = ROOT / "examples" / "step-gauge-simulated"
    files = {name: (folder / name).read_bytes() for name in ("job.toml", "recording.csv")}
    job = files["job.toml"].decode().replace(f'standard = "{NAME}"', f'standard = "{NAME}"\nclauses = "{FILE}"')
    with pytest.raises(CmmUqError, match=rf"{FILE}: no such file"):
        job_of({**files, "job.toml": job.encode()})


@pytest.mark.parametrize("name", CLAUSES)
def test_every_standard_has_a_form_that_can_be_filled_in(name: str) -> None:
    text = filled(dict.fromkeys((one.name for one in CLAUSES[name]), "agrees = true"), name)
    assert text.count("\nagrees = true") == len({one.name for one in CLAUSES[name]}) == len(CLAUSES[name])


@pytest.mark.parametrize("name", [name for name in BUILT_IN if name != own_rule.NAME])
def test_every_characteristic_goes_by_some_clause_and_every_clause_is_of_one(name: str) -> None:
    characteristics = {one.name for one in BUILT_IN[name].characteristics}
    for clause in BUILT_IN[name].clauses:
        assert not clause.of or set(clause.of) & characteristics or name == "VDI/VDE 2617"
    for one in characteristics:
        assert clauses_in_words(name, [c for c in BUILT_IN[name].clauses if not c.of or one in c.of], None)[0]


def test_nothing_is_written_over_a_form(tmp_path: Path) -> None:
    file = write_form(NAME, tmp_path / FILE)
    file.write_text("kept")
    with pytest.raises(CmmUqError):
        write_form(NAME, file)
    assert file.read_text() == "kept"


def test_the_command_lists_standards_and_writes_a_form(tmp_path: Path) -> None:
    assert "ISO 10360-2:2009: E0, R0, E150" in run("standards").stdout
    assert "not read; as commonly reported" in run("standards", NAME).stdout
    done = run("standards", NAME, "--form", str(tmp_path / FILE))
    assert (done.returncode, (tmp_path / FILE).read_text("utf-8")) == (0, form(NAME))
    wrong = run("standards", "ISO 10360-2:2010")
    assert (wrong.returncode, "no standard 'ISO 10360-2:2010' is decided" in wrong.stderr) == (2, True)


def test_the_table_of_unread_clauses_is_the_one_of_the_docs() -> None:
    text = (ROOT / "docs" / "standards.md").read_text("utf-8")
    rows = [line for line in text.partition("## Unverified")[2].splitlines() if line.startswith("| ")][2:]
    assert rows == unread_rows()


def unread_rows() -> list[str]:
    """Clauses whose text nobody read, standards that share one together."""
    together: dict[tuple[str, str, str], list[str]] = {}
    for standard, clauses in CLAUSES.items():
        for one in clauses:
            if not one.read:
                together.setdefault((str(one.title), one.does, one.source), []).append(standard)
    return [f"| {', '.join(names)} | {title} | {does} | {source} |".replace("|t", "\\|t")
            for (title, does, source), names in together.items()]  # fmt: skip
