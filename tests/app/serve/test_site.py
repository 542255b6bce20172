"""Every page by its address: what it lists, that nothing in the records becomes part of it, and what it says if it cannot."""

from __future__ import annotations

import datetime as dt
import os
import re
import sqlite3
from hashlib import sha256
from html.parser import HTMLParser
from pathlib import Path
from typing import Any

import pytest

from cmm_uq.app.commands.laboratory.due import due_in
from cmm_uq.app.serve import application
from cmm_uq.app.serve.exchange import WebRequest, read_address
from cmm_uq.app.serve.page import WebPage
from cmm_uq.app.serve.site import PAGES, Site
from cmm_uq.app.serve.view import ChainComparing
from cmm_uq.base.errors import CmmUqError
from cmm_uq.base.messages import Text, say
from cmm_uq.certificate.look import template_folder
from cmm_uq.laboratory.due.due import DueItem
from cmm_uq.laboratory.records import open_records
from tests.app.serve.conftest import Looked
from tests.app.serve.laboratory import HOSTILE, RESULTS, TODAY, TURNED, entry_of, opened_in
from tests.certificate.saying import said
from tests.laboratory.records.histories import certificate, made, moment
from tests.laboratory.records.test_parts import MARCH, calibrated, part

ADDRESSES = ["/", "/?state=overdue", "/?text=K1", "/machine?serial=K1", "/machine?serial=K3", "/certificates",
             "/certificates?origin=simulated", "/certificates?machine=K1", "/diagnoses", "/diagnoses?verdict=all",
             "/parts", "/artefacts", "/file", "/integrity", "/nowhere", "/certificates?page=x"]  # fmt: skip


class Shown(HTMLParser):
    def __init__(self, text: str) -> None:
        super().__init__()
        self.texts: list[str] = []
        self.links: list[str] = []
        self.elements: set[str] = set()
        self.attributes: set[str] = set()
        self.feed(text)

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.elements.add(tag)
        self.attributes |= {name for name, _ in attrs}
        self.links += [value or "" for name, value in attrs if name in ("href", "action", "src")]

    def handle_data(self, data: str) -> None:
        if text := " ".join(data.split()):
            self.texts.append(text)


def every_address(looked: Looked) -> list[str]:
    entries = [f"/certificate?entry={entry_of(looked.place, number)}" for number in ("k-1", "k-4", "sim-1", "h-1")]
    hostile = next(link for link in Shown(looked.text("/")).links if link.startswith("/machine?serial=%3Cscript"))
    return [*ADDRESSES, *entries, hostile]


def test_nothing_in_the_records_can_become_part_of_a_page(looked: Looked) -> None:
    for address in every_address(looked):
        shown = Shown(looked.text(address))
        assert "script" not in shown.elements, address
        assert not {name for name in shown.attributes if name.startswith("on") or name == "style"}, address
    page = looked.text(every_address(looked)[-1])
    assert HOSTILE not in page
    assert HOSTILE in Shown(page).texts
    assert "\u202e" not in page
    assert TURNED.replace("\u202e", "\\u202e") in Shown(page).texts


@pytest.mark.long
def test_every_link_leads_to_a_page_of_this_site(looked: Looked) -> None:
    links = {link for address in every_address(looked) for link in Shown(looked.text(address)).links}
    assert len(links) > 40
    for link in links - {"#content", "/integrity/chain", "/integrity/files"}:
        assert looked.get(link).status == 200, link


def test_the_first_page_counts_and_lists_the_most_urgent_first(looked: Looked) -> None:
    page = looked.text("/")
    serials = re.findall(r'rowheader"[^>]*><div>\s*<a href="/machine\?serial=([^"]+)"', page)
    assert sorted(serials[:4]) == ["100000", "100001", "100002", "100003"]
    assert serials[4:] == ["K3", "K2", "K5", "K4", "NEW", "K1", "%3Cscript%3Ealert%281%29%3C%2Fscript%3E"]
    counts = dict(re.findall(r'state=(\w+)" class="\w+">\s*<span class="count">(\d+)<', page))
    # K3 twice: it does not conform, and is for that due at once
    assert counts == {"overdue": "5", "failing": "1", "due": "1", "open": "1", "diagnosis": "1", "draft": "5", "never": "2",
                      "order": "2"}  # fmt: skip
    texts = Shown(page).texts
    assert "5 artefacts are out of date: no certificate can rest on them" in texts


@pytest.mark.parametrize(("address", "listed", "not_listed"), [
    ("/?state=failing", ["K3"], ["K1", "K2"]), ("/?state=order", ["K1"], ["K3"]), ("/?text=k3", ["K3"], ["K1"]),
    ("/?place=Hall+2", ["NEW"], ["K1"]), ("/?text=just+BOUGHT", ["NEW"], ["K1"]),
    ("/certificates?decision=fail", ["k-3"], ["k-1"]), ("/certificates?state=withdrawn", ["k-4"], ["k-1"]),
    ("/certificates?text=K-1", ["k-1"], ["k-2"]), ("/certificates?machine=K1", ["k-1", "check-1"], ["sim-1", "k-2"]),
    ("/certificates?origin=simulated", ["sim-1"], ["k-1"]), ("/certificates?text=%25", [], ["k-1"]),
    ("/certificates?since=2026-08-01&until=2026-08-31", ["k-3"], ["k-1", "k-5"]),
    ("/certificates?artefact=BB-7", ["k-1"], ["h-1"]), ("/diagnoses", ["k-5"], ["k-1"]),
    ("/diagnoses?verdict=consistent", ["k-1"], ["k-5", "sim-1"]), ("/artefacts?text=ptb+1", ["BB-7"], ["BB-0"]),
    ("/certificates?text=machine+K3", ["k-3"], ["k-1"]),
])  # fmt: skip
def test_a_list_has_what_was_chosen(looked: Looked, address: str, listed: list[str], not_listed: list[str]) -> None:
    texts = Shown(looked.text(address)).texts
    assert [one for one in listed if one not in texts] == []
    assert [one for one in not_listed if one in texts] == []


@pytest.mark.parametrize("address", [
    "/?stat=draft", "/?state=late", "/?page=0", "/certificates?since=yesterday", "/certificates?origin=imagined",
    "/certificates?since=2026-02-01&until=2026-01-01", "/certificate?entry=1%27", "/file?a=b", "/recorded?entry=1&keep=maybe",
])  # fmt: skip
def test_a_bad_address_is_answered_in_words(looked: Looked, address: str) -> None:
    answer = looked.get(address)
    assert answer.status == 400
    assert "This cannot be shown" in answer.body.decode()


@pytest.mark.parametrize("address", [
    "/nowhere", "/../etc/passwd", "/machine?serial=K77", "/machine", "/certificate?entry=999999", "/certificate",
    "/recorded?entry=1&name=../records.db", "//", "/style.css/",
])  # fmt: skip
def test_what_is_not_there_is_not_found(looked: Looked, address: str) -> None:
    assert looked.get(address).status == 404


def test_one_certificate_shows_its_values_its_diagnosis_its_signatures_and_its_files(looked: Looked) -> None:
    entry = entry_of(looked.place, "k-4")
    texts = Shown(looked.text(f"/certificate?entry={entry}")).texts
    text = " ".join(texts)
    assert "Withdrawn; decision: pass" in text
    assert "Scale error of X 1.2 0.2 to 2.2 8 ppm" in text
    assert "Squareness X–Y −2.00 −2.40 to −1.60 – ″" in text
    assert "98 %" in texts
    assert "5.20 ± 0.60 µm" in text
    assert "Measure next: the bar upright in two places" in texts
    assert text.index("A. Prüfer") < text.index("B. Leiter")
    assert "artefact was damaged" in texts
    for name in ("certificate.html", "certificate.pdf", "posterior.npz", "results.json"):
        answer = looked.get(f"/recorded?entry={entry}&name={name}")
        assert answer.body == (looked.place.parent / "k-4" / name).read_bytes()
    assert looked.get(f"/recorded?entry={entry}&name=records.db").status == 404


def test_a_machine_shows_its_newest_values_against_their_limits(looked: Looked) -> None:
    text = " ".join(Shown(looked.text("/machine?serial=K3")).texts)
    assert "Does not conform: its newest certificate says fail" in text
    assert "Length measurement error E0 ✗ 9.4 ± 1.0 µm, limit 9 µm" in text
    assert "Stated once so far" not in text
    once = " ".join(Shown(looked.text("/machine?serial=K2")).texts)
    assert "Stated once so far Quantity Value 95 % interval Limit Unit Scale error of X 1.2 0.2 to 2.2 8 ppm" in once
    course = looked.text("/machine?serial=k%201")
    assert "Scale error of X, 2 values from 2026-06-01 to 2026-09-01" in course
    assert course.count('class="interim"') == 2
    assert "sim-1" not in course


def test_a_page_of_a_long_list_leads_to_its_neighbours(tmp_path: Path) -> None:
    made(tmp_path / "records.db", 60, 2).close()
    looked = Looked(tmp_path / "records.db")
    first, second, third, beyond = (looked.text(f"/certificates?page={i}&state=draft") for i in (1, 2, 3, 9))
    assert "120 certificates: page 2 of 3" in second
    numbers = [re.findall(r"K-\d{6}-\d{4}-\d\d-\d\d(?=</a>)", page) for page in (first, second, third)]
    days = [number[-10:] for page in numbers for number in page]
    assert [len(page) for page in numbers] == [50, 50, 20]
    assert days == sorted(days, reverse=True)
    assert len({number for page in numbers for number in page}) == 120
    links = Shown(second).links
    assert "/certificates?state=draft" in links
    assert "/certificates?page=3&state=draft" in links
    assert "/certificates?page=4&state=draft" not in Shown(third).links
    assert "/certificates?page=3&state=draft" in Shown(beyond).links
    assert "60 machines: page 2 of 2" in looked.text("/?page=2")


def test_due_dates_are_asked_of_who_serves(laboratory: Path) -> None:
    asked: list[dt.date] = []

    def due(records: object, today: dt.date, of: object) -> dict[str, DueItem]:
        asked.append(today)
        return {
            "K1": DueItem("machine", "K1", "", "", "", None, dt.date(2026, 12, 24), say("it drifts")),
            "K3": DueItem("machine", "K3", "", "", "", None, None, say("nothing is known of it")),
        }

    site = Site(laboratory, due=due, today=lambda: TODAY)
    machine = site.answer(WebRequest("GET", *read_address("/machine?serial=K1"))).body.decode()
    assert "Due soon, on 2026-12-24" in machine
    assert "it drifts" in machine
    assert "nothing is known of it" in site.answer(WebRequest("GET", *read_address("/machine?serial=K3"))).body.decode()
    site.answer(WebRequest("GET", "/"))
    assert len(asked) == 1, "worked out again although the records are the same"


def test_a_machine_is_due_by_its_own_rule_as_the_command_says(tmp_path: Path) -> None:
    """Half a year after 2026-03-02, and the usual year; the record of the second is as long ago."""
    own = {"serial": "H", "name": "Half-yearly", "calibrate": {"every_months": 6}}
    with open_records(tmp_path / "records.db", create=True) as records:
        records.append_all(("report", certificate(serial, dt.date(2026, 3, 2), **further), moment(dt.date(2026, 3, 2)))
                           for serial, further in (("H", {"machine": own}), ("Y", {})))  # fmt: skip
    site = Site(tmp_path / "records.db", today=lambda: TODAY)
    found = {one.serial: one.due for one in site.machines()}
    with open_records(tmp_path / "records.db", read_only=True) as records:
        assert found == {one.serial: one for one in due_in(records, (), TODAY) if one.item == "machine"}
    assert {serial: one and one.due for serial, one in found.items()} == {
        "H": dt.date(2026, 9, 2), "Y": dt.date(2027, 3, 2),
    }  # fmt: skip
    machine = site.answer(WebRequest("GET", *read_address("/machine?serial=H"))).body.decode()
    assert "Overdue since 2026-09-02" in machine
    assert "fixed interval of 6 months" in machine


def test_a_new_entry_is_seen_at_once(tmp_path: Path) -> None:
    records = made(tmp_path / "records.db", 1, 1)
    looked = Looked(tmp_path / "records.db")
    assert "Just bought" not in looked.text("/")
    records.append("machine", {"serial": "N", "name": "Just bought"})
    assert "Just bought" in looked.text("/")
    records.close()


def test_looking_changes_no_byte_of_the_records(tmp_path: Path) -> None:
    place = opened_in(tmp_path)
    with sqlite3.connect(place) as connection:
        connection.execute("PRAGMA wal_checkpoint(TRUNCATE)")
    connection.close()
    before = {path: sha256(path.read_bytes()).hexdigest() for path in tmp_path.rglob("*") if path.is_file()}
    looked = Looked(place)
    for address in every_address(looked):
        looked.get(address)
    looked.site.checking.begin(files=True)
    looked.site.checking.wait(20)
    after = {path: sha256(path.read_bytes()).hexdigest() for path in tmp_path.rglob("*") if path.is_file()}
    assert {path: hash_ for path, hash_ in after.items() if not path.name.endswith(("-wal", "-shm"))} == before
    assert all(path.stat().st_size == 0 for path in after if path.name.endswith("-wal"))


def gone(place: Path) -> None:
    place.rename(place.with_name("moved.db"))


def another(place: Path) -> None:
    place.unlink()
    with sqlite3.connect(place) as connection:
        connection.execute("CREATE TABLE diary (day TEXT)")
    connection.close()


def newer(place: Path) -> None:
    with sqlite3.connect(place) as connection:
        connection.execute("UPDATE alembic_version SET version_num = '9999'")
    connection.close()


def damaged(place: Path) -> None:
    with place.open("r+b") as file:
        file.seek(4096)
        file.write(os.urandom(30_000))


@pytest.mark.parametrize(("spoil", "told"), [
    (gone, "there are no records"), (another, "database of another program"), (newer, "of a newer version"),
    (damaged, "damaged"),
])  # fmt: skip
def test_records_that_change_under_it_are_a_page_in_words(tmp_path: Path, spoil: Any, told: str) -> None:
    place = opened_in(tmp_path)
    with sqlite3.connect(place) as connection:
        connection.execute("PRAGMA wal_checkpoint(TRUNCATE)")
    connection.close()
    looked = Looked(place)
    assert looked.get("/").status == 200
    for path in tmp_path.glob("records.db-*"):
        path.unlink()
    spoil(place)
    answer = looked.get("/certificates")
    assert (answer.status, "The records cannot be read" in answer.body.decode()) == (503, True)
    assert told in answer.body.decode()
    assert looked.get("/style.css").status == 200


def test_without_records_nothing_is_served(tmp_path: Path) -> None:
    with pytest.raises(CmmUqError, match="there are no records"):
        Site(tmp_path / "records.db")


def test_a_fault_is_told_on_its_page_and_the_others_go_on(looked: Looked, monkeypatch: pytest.MonkeyPatch) -> None:
    def fail(view: object, asked: object) -> WebPage:
        raise ZeroDivisionError("<b>")

    monkeypatch.setitem(PAGES, "/file", fail)  # type: ignore[arg-type]
    answer = looked.get("/file")
    assert answer.status == 500
    assert "ZeroDivisionError: &lt;b&gt;" in answer.body.decode()
    assert looked.get("/").status == 200


def test_the_comparison_finds_what_the_records_find(tmp_path: Path) -> None:
    place = opened_in(tmp_path)
    looked = Looked(place)
    assert "Not compared since" in looked.text("/integrity")
    looked.site.answer(WebRequest("POST", "/integrity/chain"))
    looked.site.checking.wait(20)
    assert "The records agree with their chain" in looked.text("/integrity")
    with open_records(place, read_only=True) as records:
        assert records.head()[1] in looked.text("/integrity")
    with sqlite3.connect(place) as connection:
        connection.execute("DROP TRIGGER entries_no_update")
        connection.execute(
            "UPDATE entries SET content = replace(content, '1.234', '1.235') WHERE content LIKE '%1.234%'"
        )
    connection.close()
    with open_records(place, read_only=True) as records:
        findings = records.verify(files=False)
    looked.site.answer(WebRequest("POST", "/integrity/chain"))
    looked.site.checking.wait(20)
    page = Shown(looked.text("/integrity")).texts
    assert findings
    assert all(one.problem in page for one in findings)


def test_only_one_comparison_goes_on_at_a_time(monkeypatch: pytest.MonkeyPatch) -> None:
    begun: list[int] = []

    def opened() -> Any:
        begun.append(1)
        raise CmmUqError("locked") if len(begun) > 1 else ValueError("a fault")

    checking = ChainComparing(opened)
    checking.begin(files=False)
    checking.wait(5)
    assert checking.last is not None
    assert checking.last.failed == "ValueError: a fault"
    checking.begin(files=True)
    checking.wait(5)
    assert (checking.last.failed, checking.last.files, checking.since) == ("locked", True, None)


def test_every_text_of_every_page_is_a_message_or_of_the_records(
    looked: Looked, monkeypatch: pytest.MonkeyPatch
) -> None:
    """As in documents: what stands in none of both could not be said in another language."""
    printed: list[object] = []
    visible = application._visible

    def kept(value: object) -> object:
        printed.append(value)
        return visible(value)

    with monkeypatch.context() as patched:
        patched.setattr(application, "_visible", kept)
        application._environment.cache_clear()
        pages = [looked.text(address) for address in every_address(looked)]
    application._environment.cache_clear()
    with open_records(looked.place, read_only=True) as records:
        known = "\n".join(part for entry in records.entries() for part in (entry.content, entry.hash)) + str(
            looked.place
        )
    known += f"{HOSTILE} {RESULTS} page x"
    texts = [one for one in printed if isinstance(one, Text)]
    assert len(texts) > 500
    assert {text for text in texts if not said(text, known) and text not in known} == set()
    spoken = {" ".join(str(visible(one)).split()) for one in printed if isinstance(one, Text | int)}
    for page in pages:
        shown = Shown(re.sub("<svg.*?</svg>", "", page, flags=re.DOTALL)).texts
        assert {part for text in shown for part in text.split(" · ")} - spoken <= {"✓", "!", "✗"}


@pytest.mark.parametrize("path", sorted((template_folder() / "serve").rglob("*.html")), ids=lambda path: path.stem)
def test_no_template_has_a_word_of_its_own(path: Path) -> None:
    bare = re.sub(r"\{#.*?#\}|\{%.*?%\}|\{\{.*?\}\}", "", path.read_text(encoding="utf-8"), flags=re.DOTALL)
    assert re.findall(r"[A-Za-z]{2,}", " ".join(Shown(bare).texts)) == []


def test_reports_of_parts_are_listed_and_shown_with_their_machine_and_its_certificate(tmp_path: Path) -> None:
    with open_records(tmp_path / "records.db", create=True) as records:
        records.append_all([calibrated(MARCH), part(MARCH), part(MARCH, job="s", number="S-1", origin="simulated")])
    looked = Looked(tmp_path / "records.db")
    texts = [
        " ".join(Shown(looked.text(f"/{at}")).texts) for at in ("parts", "machine?serial=1102", "certificate?entry=2")
    ]
    for text in texts:
        assert all(word in text for word in (f"P-{MARCH}", "Flange", "F-7", "K-1"))
    assert "S-1" not in texts[0]
    assert "S-1" in looked.text("/parts?origin=simulated")
    assert "/parts?machine=1102" in looked.text("/machine?serial=1102")
    assert f"P-{MARCH}" not in looked.text("/certificates")
    assert "Report of a part" in texts[2]
    assert "Values as stated" not in texts[2]
