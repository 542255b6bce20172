"""What is stated is stated alike everywhere: random jobs, and their statements as every output has them.

Results are those of a real recording with statements and tolerances drawn at random. What each output says is read out of that
output itself, and compared with what was drawn by the order of gravity as it is written here.
"""

from __future__ import annotations

import datetime as dt
import json
import re
import shutil
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from functools import cache
from pathlib import Path
from random import Random
from types import SimpleNamespace
from typing import Any
from xml.etree import ElementTree as ET

import numpy as np
import pytest
import typer

from cmm_uq.analysis.conformity.decision import decide
from cmm_uq.analysis.conformity.statement import Decided, Statement
from cmm_uq.app.cli.options import Ending
from cmm_uq.app.cli.summary import conclude
from cmm_uq.app.commands.certificates.release import release
from cmm_uq.app.commands.files import Written
from cmm_uq.app.commands.laboratory.batch_jobs import COLUMNS, conforming, rows
from cmm_uq.app.commands.laboratory.due import _members, due_in, history_of
from cmm_uq.app.serve.certificate_page import decided_words
from cmm_uq.app.serve.view import by_rule, groups
from cmm_uq.base.messages import say
from cmm_uq.certificate.certificate import certified
from cmm_uq.certificate.digital_certificate.certificate import digital_certificate
from cmm_uq.certificate.origin import as_json
from cmm_uq.certificate.pages.history import overview_of
from cmm_uq.certificate.render import render_html
from cmm_uq.certificate.result import Outcome, Page, Result
from cmm_uq.certificate.results.qif_file import qif
from cmm_uq.certificate.sections import results as first_page
from cmm_uq.certificate.sections.results import subject_of
from cmm_uq.certificate.verify.figures import check_verdicts
from cmm_uq.certificate.verify.given import Inquiry
from cmm_uq.jobs.dcc import written
from cmm_uq.jobs.reports import ReportResults as Reported
from cmm_uq.jobs.tables.conformity import ConformityFacts
from cmm_uq.jobs.verdicts import Verdicts
from cmm_uq.laboratory.due.fleet import FleetValue
from cmm_uq.laboratory.records import open_records
from cmm_uq.laboratory.records.content import certificate_content
from cmm_uq.laboratory.records.listing import outcomes_of, standing_of_all
from cmm_uq.laboratory.records.store import Records
from cmm_uq.laboratory.schedule.jobs import REPORTED, JobFolder, JobOutcome
from cmm_uq.laboratory.schedule.notices import of_results
from tests.app.cli.laboratory import CHAIN, STATED
from tests.app.cli.process import run
from tests.artefacts.simulated import analysed
from tests.conftest import ROOT

JOB = "iota-1102-20C"

ORDER = ("fail", "conditional fail", "remeasure", "undecided", "incomplete", "conditional pass", "pass")
"""The gravest first."""

DRAWS = 40
STANDARDS = (("ISO 10360-2:2009", "E0"), ("ISO 10360-2:2009", "R0"), ("ASME B89.4.1-1997", "volumetric performance"))
RULES = ("simple", "ISO 14253-1", "ILAC-G8 non-binary")


@dataclass(frozen=True)
class Drawn:
    """A job with what it states, by name and in order."""

    result: Result
    stated: dict[str, str]

    @property
    def overall(self) -> str:
        return min(self.stated.values(), key=ORDER.index, default="none")

    @property
    def standing(self) -> str:
        return {"pass": "good", "none": "good", "fail": "bad", "conditional fail": "bad"}.get(self.overall, "open")


def statement(random: Random, standard: str, characteristic: str) -> Statement:
    """Two values of one limit, and now and then something missing or a reading to be repeated."""
    rule, errors = random.choice(RULES), []
    for _ in range(2):
        value, u = random.choice((0.5, 0.5, 0.5, 0.5, 2.9, 2.9, 3.1, 9.0)), random.choice((0.01, 0.3))
        errors.append(Decided(value, u, 3.0, decide(value, u, 3.0, rule, signed=True)))
    if random.random() < 0.1:
        errors[0] = replace(errors[0], standing="again")
    missing = (say("a position"),) if random.random() < 0.3 else ()
    facts = ConformityFacts(standard=standard, limit_um=3.0, rule=rule)
    return Statement(facts, characteristic, say("error"), say("lengths"), tuple(errors), missing, ())


def outcome_of_statement(one: Statement) -> str:
    """By hand: the gravest of its values, or incomplete."""
    values = ["remeasure" if each.standing == "again" else each.decision.outcome for each in one.errors]
    gravest = min(values, key=ORDER.index)
    return "incomplete" if gravest in ("pass", "conditional pass") and one.missing else gravest


def outcome_of_tolerance(low: float, high: float, tolerance: float, *, determined: bool) -> str:
    """By hand: where the whole interval is."""
    if not determined:
        return "undecided"
    smallest = 0.0 if low <= 0.0 <= high else min(abs(low), abs(high))
    return "pass" if max(abs(low), abs(high)) <= tolerance else "fail" if smallest > tolerance else "undecided"


@cache
def drawn(seed: int) -> Drawn:
    random, result = Random(seed), analysed(JOB)
    statements = tuple(statement(random, *one) for one in STANDARDS if random.random() < 0.4)
    stated = {f"{one.facts.standard} {one.characteristic}": outcome_of_statement(one) for one in statements}
    tolerances, free = {}, set()
    for effect, parameters in result.parameters.items():
        if random.random() < 0.75:
            continue
        (name, quantity), *_ = parameters.items()
        low, high = quantity.interval95
        inner = 0.0 if low < 0 < high else min(abs(low), abs(high))
        most = max(abs(low), abs(high))
        tolerance = random.choice((*(2.0 * most,) * 6, (inner + most) / 2, 0.8 * inner or most / 9))
        free |= {effect} if random.random() < 0.1 else set()
        tolerances[effect] = tolerance
        stated[f"{effect}.{name}"] = outcome_of_tolerance(low, high, tolerance, determined=effect not in free)
    facts = result.job.facts
    model = facts.model.model_copy(update={"tolerances": tolerances})
    diagnosed = replace(result.diagnosed, diagnosis=replace(result.diagnosed.diagnosis, verdict="consistent"))
    chain = facts.artefact.certificate
    assert chain is not None
    elsewhere = chain.model_copy(update={"machine": "another"})  # its own machine's certificate makes no pass
    artefact = facts.artefact.model_copy(update={"certificate": elsewhere})
    job = replace(result.job, facts=facts.model_copy(update={"model": model, "artefact": artefact}))
    ls = result.least_squares
    column = [i for i, unknown in enumerate(ls.unknowns) if unknown.key[0] in free]
    estimate = replace(result.estimate, least_squares=replace(ls, null_space=np.eye(len(ls.unknowns))[:, column]))
    found = replace(result, job=job, statements=statements, diagnosed=diagnosed, estimate=estimate)
    return Drawn(found, stated)


@cache
def outcome(seed: int) -> Outcome:
    return certified(drawn(seed).result, Page(lambda result: []))


@cache
def results(seed: int) -> dict[str, Any]:
    """As another program reads them."""
    found: dict[str, Any] = json.loads(as_json(outcome(seed).results))
    return found


def kept(seed: int, place: Path) -> Records:
    """Records that hold the certificate of one draw, which lacks nothing that ISO/IEC 17025 asks for."""
    content = certificate_content(results(seed), drawn(seed).result.job.facts, command="report", folder="x",
                                  results_sha256=f"{seed:064x}", files={}, named=lambda name: name)  # fmt: skip
    records = open_records(place, create=True)
    records.append("report", content | {"missing": []})
    return records


@pytest.fixture(scope="module")
def recorded(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Callable[[int], Records]]:
    made: dict[int, Records] = {}
    place = tmp_path_factory.mktemp("records")

    def of(seed: int) -> Records:
        if seed not in made:
            made[seed] = kept(seed, place / f"{seed}.db")
        return made[seed]

    yield of
    for one in made.values():
        one.close()


each = pytest.mark.parametrize("seed", range(DRAWS))
ON = dt.date(2004, 9, 1)
"""The day of the measurement."""


def test_all_outcomes_are_among_those_that_are_drawn() -> None:
    gravest = [drawn(seed).overall for seed in range(DRAWS)]
    assert set(gravest) == {*ORDER, "none"}
    assert any(
        one.stated[name] == "undecided" for one in map(drawn, range(DRAWS)) for name in one.stated if "." in name
    )


@each
def test_results_json_the_terminal_and_exit_codes(seed: int) -> None:
    of, data = drawn(seed), results(seed)
    assert {one["name"] if one["by"] is None else f"{one['by']} {one['name']}": one["outcome"]
            for one in data["verdicts"]["statements"]} == of.stated  # fmt: skip
    assert data["verdicts"]["overall"] == of.overall
    told = outcome(seed).summary.verdicts
    assert [one.word.lower() for one in told] == [*of.stated.values()]
    found = outcome(seed)
    ended = Written(found, b"{}", {}, found.summary, found.conforming, "job")
    code = 0
    try:
        conclude(ended, Ending(quiet=True, strict=True))
    except typer.Exit as exit_:
        code = exit_.exit_code
    assert code == (0 if of.overall in ("pass", "none") else 4)


@each
def test_results_of_earlier_versions_say_the_same(seed: int) -> None:
    """But for parameters that are not determined, of which they said nothing."""
    data = {key: value for key, value in results(seed).items() if key != "verdicts"}
    of = drawn(seed)
    assert {one.called: one.outcome for one in Verdicts.of_results(data)} == {
        name: said for name, said in of.stated.items() if name.partition(".")[0] not in of.result.free
    }  # fmt: skip
    inquiry = Inquiry()
    check_verdicts(inquiry, results(seed), "results.json")
    assert not inquiry.findings


@each
def test_batches_and_scheduled_runs(seed: int) -> None:
    of, data = drawn(seed), results(seed)
    assert conforming(data) == (of.overall in ("pass", "none"))
    decision = [name for name, *_ in COLUMNS].index("decision")
    assert {row[decision] for row in rows(data)} == {of.overall}
    notices = of_results(data, "inputs", "where")
    events = {{"fail": "fail", "conditional fail": "fail", "incomplete": "incomplete"}.get(said, "undecided")
              for said in of.stated.values() if said != "pass"}  # fmt: skip
    assert {one.event for one in notices} == events
    ended = JobOutcome(JobFolder(Path(), Path(), "job", {}), REPORTED, results=data, notices=notices)
    assert ended.line()["decisions"] == [*of.stated.values()]
    assert ended.code == (0 if of.overall in ("pass", "none") else 1)


@each
def test_the_digital_certificate(seed: int) -> None:
    of = drawn(seed)
    tree = ET.fromstring(written(digital_certificate(results(seed), of.result.job, html=None)))
    dcc = "{https://ptb.de/dcc}"
    by_standard = [
        one.findtext(f"{dcc}conformity") for one in tree.iterfind(f".//{dcc}administrativeData//{dcc}statement")
        if "basic_conformity" in one.get("refType", "").split()
    ]  # fmt: skip
    word = {"conditional pass": "conditionalPass", "conditional fail": "conditionalFail", "undecided": "noPass",
            "incomplete": "noPass", "remeasure": "noPass"}  # fmt: skip
    assert by_standard == [word.get(said, said) for name, said in of.stated.items() if " " in name]
    by_tolerance = {
        one.get("id", "").removeprefix("estimates."): one.findtext(f"{dcc}measurementMetaData/{dcc}metaData/{dcc}conformity")
        for one in tree.iterfind(f".//{dcc}quantity") if one.find(f"{dcc}measurementMetaData") is not None
    }  # fmt: skip
    assert by_tolerance == {name: word.get(said, said) for name, said in of.stated.items() if " " not in name}


@each
def test_qif(seed: int) -> None:
    of = drawn(seed)
    tree = ET.fromstring(qif(Reported.model_validate_json(as_json(results(seed)))))
    space = "{http://qifstandards.org/xsd/qif3}"
    whole = tree.findtext(f".//{space}InspectionStatusEnum")
    assert whole == {"pass": "PASS", "fail": "FAIL"}.get(of.overall, "UNKNOWN")
    said = {one.get("name", ""): one.get("value") for one in tree.iter(f"{space}AttributeStr")}
    assert {re.sub("^decision (by|on) | by its tolerance$", "", name): word for name, word in said.items()
            if name.startswith("decision")} == of.stated  # fmt: skip


@each
def test_the_records_what_is_due_and_the_history(seed: int, recorded: Callable[[int], Records]) -> None:
    of, records = drawn(seed), recorded(seed)
    (kept,) = records.certificates()
    assert kept.decision == of.overall
    stated = outcomes_of(records, [kept.entry])[kept.entry]
    assert sorted(stated.values()) == sorted(of.stated.values())
    (due,) = (one for one in due_in(records, (), ON) if one.item == "machine")
    beyond = of.standing == "bad"
    assert due.beyond == beyond
    assert (due.state(ON, dt.timedelta(days=1)) == "overdue") == beyond
    assert any("does not state that it conforms" in one for one in due.remarks) == (of.standing == "open")
    history = history_of(records.machines()[0].serial, records.place, on=ON)
    assert history.decision == of.overall
    assert overview_of(history).standing == of.standing
    assert (overview_of(history).verdict == "Beyond its limits") == beyond
    for one in history.values:
        said = of.stated.get(one.series.name)
        if said is not None:
            assert one.beyond == (said in ("fail", "conditional fail"))


@each
def test_the_fleet(seed: int, recorded: Callable[[int], Records]) -> None:
    of, records = drawn(seed), recorded(seed)
    ((serial, every),) = records.all_series().items()
    stated = outcomes_of(records, {int(entry) for one in every.values() for entry in one.entry})
    nothing = SimpleNamespace(estimates=SimpleNamespace(crossing=None))
    for name, series in every.items():
        members = tuple(_members({serial: series}, {serial: records.machine(serial)}, stated))
        found = FleetValue(name, name, "", members, nothing, np.ones(1, bool), 0)
        if said := of.stated.get(name):
            assert found.beyond.tolist() == [said in ("fail", "conditional fail")]


@each
def test_the_pages_of_the_records(seed: int, recorded: Callable[[int], Records]) -> None:
    of, records = drawn(seed), recorded(seed)
    (newest,) = standing_of_all(records)
    due = by_rule(records, ON)[newest.machine.serial]
    found = groups(newest, due, ON)
    assert ("overdue" in found) == (of.standing == "bad")
    assert ("failing" in found, "open" in found) == (of.standing == "bad", of.standing == "open")
    (kept,) = records.certificates()
    said = str(decided_words(kept)[0])
    assert ("states no conformity" in said) if of.overall == "none" else (f"decision: {of.overall}" in said)


@pytest.mark.long(but="a")
@each
def test_a_release_asks_for_a_word_unless_all_passes(seed: int, tmp_path: Path) -> None:
    of, asked = drawn(seed), list[str]()

    def ask(question: str) -> str:
        asked.append(question)
        return "agreed"

    with kept(seed, tmp_path / "records.db") as records:
        release(records, "1", by="A. Huber", ask=ask)
        word = records.signatures(1)[0].reason
    if of.overall in ("pass", "conditional pass", "none"):
        assert (asked, word) == ([], "")
    else:
        assert word == f"{of.overall}: agreed"
        assert all(f"{name}: {said}" in asked[0] for name, said in of.stated.items() if said != "pass")


@each
def test_the_box_of_the_first_page(seed: int) -> None:
    of, box = drawn(seed), first_page.overview_of(drawn(seed).result)
    if box is None:
        assert of.overall == "none"
        return
    assert box.standing == of.standing
    assert (box.verdict == "Conforms" or box.verdict.startswith("Conforms: all")) == (of.overall == "pass")
    shown = dict(box.rows)
    said = {subject_of(one): word for one, word in zip(of.result.verdicts, of.stated.values(), strict=True)}
    assert {name: shown[name].partition(":")[0] for name in said if name in shown} == {
        name: word for name, word in said.items() if name in shown
    }
    assert min((said[name] for name in said if name in shown), key=ORDER.index) == of.overall


@pytest.mark.parametrize("seed", range(0, DRAWS, 10))
def test_the_certificate_shows_that_box(seed: int) -> None:
    page = re.sub(r"\s+", " ", re.sub("<[^>]*>", " ", render_html(outcome(seed).document)))
    box = first_page.overview_of(outcome(seed).found)  # type: ignore[arg-type]
    for name, said in () if box is None else box.rows:
        assert " ".join(f"{name} {said}".split()) in page


@pytest.mark.long
def test_the_commands_on_a_machine_that_is_out_of_tolerance(tmp_path: Path) -> None:
    """Scale Z is 14 ppm and squareness XY 12″, with tolerances of 12 ppm and 8″; no standard decides on anything."""
    job = Path(shutil.copytree(ROOT / "examples" / "triangle-simulated", tmp_path / "jobs" / "triangle"))
    toml = (job / "job.toml").read_text(encoding="utf-8").replace('origin = "simulated"', 'number = "K-1"')
    toml = toml.replace("[machine]\n", f'{STATED}[machine]\nserial = "77"\n').replace(
        "[recording]\n", f"{CHAIN}[recording]\n"
    )
    (job / "job.toml").write_text(toml, encoding="utf-8")
    jobs, records = tmp_path / "jobs", tmp_path / "records.db"
    (jobs / "schedule.toml").write_text("[run]\nquiet_s = 0\n", encoding="utf-8")
    done = run("report", "--scheduled", jobs, "--out", tmp_path / "reports", "--records", records)
    told = [json.loads(line) for line in done.stdout.splitlines()]
    assert done.returncode == 1
    (line,) = (one for one in told if one.get("job"))
    assert (line["events"], line["exit_code"]) == (["fail", "undecided"], 1)
    assert {one: line["decisions"].count(one) for one in ORDER} == dict.fromkeys(ORDER, 0) | {
        "fail": 2, "undecided": 1, "pass": 12
    }  # fmt: skip
    certificate = (tmp_path / "reports" / "triangle-simulated" / "certificate.xml").read_text(encoding="utf-8")
    assert certificate.count("<dcc:conformity>fail<") == 2
    done = run("report", job, "--out", tmp_path / "again", "--records", "none", "--strict")
    assert done.returncode == 4
    assert "FAIL       Scale error of Z, tolerance 12 ppm: " in done.stdout
    assert run("batch", jobs, "--out", tmp_path / "batch", "--results-only", "--strict", "--workers", 1).returncode == 4
    done = run("due", "--strict", "--on", "2026-01-01", "--records", records)
    assert done.returncode == 4
    assert "last certificate finds it beyond its limits" in " ".join(done.stdout.split())
    history = json.loads(run("history", "77", "--on", "2026-01-01", "--records", records, "--json").stdout)
    assert history["decision"] == "fail"
    beyond = {name for name, one in history["values"].items() if one["beyond_limit"]}
    assert beyond == {"scale_z.ppm", "squareness_xy.angle_arcsec"}
    done = run("release", "K-1", "--by", "A. Huber", "--records", records)
    assert done.returncode == 2
    assert "scale_z.ppm: fail; squareness_xy.angle_arcsec: fail; squareness_yz.angle_arcsec: undecided" in done.stderr
    done = run("release", "K-1", "--by", "A. Huber", "--despite", "to be adjusted", "--records", records)
    assert (done.returncode, done.stdout.endswith("released\n")) == (0, True)
