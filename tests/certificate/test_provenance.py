"""What a certificate was made from, and that no clock is read."""

from __future__ import annotations

import ast
import hashlib
import json
import re
import tomllib
from collections import defaultdict
from collections.abc import Iterable
from importlib.metadata import distributions, version
from pathlib import Path

import pytest
from prov.model import ProvActivity, ProvAgent, ProvDerivation, ProvDocument, ProvEntity, ProvUsage

from cmm_uq import __version__
from cmm_uq.certificate.document import Document
from cmm_uq.certificate.render import render_html, render_pdf
from cmm_uq.certificate.results import provenance as installation
from cmm_uq.certificate.results.contents import head
from cmm_uq.certificate.results.provenance import provenance, same_but_for_the_platform
from tests.certificate.test_clauses import REPLACED, complete
from tests.certificate.test_completeness import WHOLE
from tests.conftest import ROOT
from tests.sources import calls_of

OUTPUTS = {"results.json": b"{}", "a b(1).csv": b"1\n"}


def made(**job: object) -> bytes:
    one = complete(job={**WHOLE["job"], "number": "K-2", **job})
    return provenance(one, head(one) | {"sampling": {"seed": 7}}, OUTPUTS)


def test_the_prov_package_reads_it_whole() -> None:
    document = ProvDocument.deserialize(content=made(replaces=REPLACED))
    names = {str(one.identifier) for one in document.get_records(ProvEntity)}
    assert {"file:job.toml", "file:ballbar.csv", "file:results.json", "file:a%20b%281%29.csv", "package:numpy"} <= names
    assert {str(one.identifier) for one in document.get_records(ProvActivity)} == {"cmm-uq:recording", "cmm-uq:report"}
    assert {str(one.identifier) for one in document.get_records(ProvAgent)} == {"cmm-uq:program", "cmm-uq:laboratory"}
    used = {str(one.args[1]) for one in document.get_records(ProvUsage)}
    assert {"file:job.toml", "file:ballbar.csv", "package:scipy", "cmm-uq:platform"} <= used
    (derived,) = document.get_records(ProvDerivation)
    assert [str(one) for one in derived.args[:2]] == ["cmm-uq:certificate", "cmm-uq:replaced"]
    again = ProvDocument.deserialize(content=document.serialize())
    assert again == document


def test_it_has_the_hashes_of_inputs_and_outputs_the_seed_the_dates_and_the_versions() -> None:
    job, graph = complete(), json.loads(made())
    for name, content in {**job.inputs, **OUTPUTS}.items():
        (told,) = (one for one in graph["entity"].values() if one.get("prov:label") == name)
        assert told["cmm-uq:sha256"] == hashlib.sha256(content).hexdigest()
        assert told["prov:type"] == ("input" if name in job.inputs else "output")
    assert graph["activity"]["cmm-uq:report"]["cmm-uq:seed"] == 7
    assert graph["activity"]["cmm-uq:recording"]["cmm-uq:date"] == {"$": "2004-09-01", "type": "xsd:date"}
    assert graph["entity"]["cmm-uq:certificate"]["cmm-uq:issued"] == {"$": "2030-01-01", "type": "xsd:date"}
    assert graph["entity"]["package:emcee"]["cmm-uq:version"] == version("emcee")
    assert graph["agent"]["cmm-uq:program"]["cmm-uq:version"] == __version__


def test_without_a_certificate_replaced_or_a_laboratory_neither_is_named() -> None:
    one = complete(laboratory={"name": ""})
    graph = json.loads(provenance(one, head(one), {}))
    assert "wasDerivedFrom" not in graph
    assert "cmm-uq:laboratory" not in graph["agent"]
    assert "cmm-uq:seed" not in graph["activity"]["cmm-uq:report"]
    ProvDocument.deserialize(content=json.dumps(graph))


def test_another_platform_is_no_other_provenance_and_another_hash_is(monkeypatch: pytest.MonkeyPatch) -> None:
    here, other_date = made(), made(number="K-3")
    with monkeypatch.context() as patched:
        patched.setattr("cmm_uq.certificate.results.provenance.machine", lambda: {"kernels": "Haswell"})
        patched.setattr("cmm_uq.certificate.results.provenance.packages", lambda: {"numpy": "2.0.0"})
        patched.setattr("cmm_uq.certificate.results.provenance.environment", lambda: {"packages": "numpy==2.0.0"})
        there = made()
    assert there != here
    assert same_but_for_the_platform(here, there)
    assert not same_but_for_the_platform(here, other_date)
    altered = here.replace(hashlib.sha256(OUTPUTS["results.json"]).hexdigest().encode(), b"0" * 64)
    assert not same_but_for_the_platform(here, altered)


@pytest.mark.parametrize("odd", [b"[]", b"{}", b'{"entity": []}', b'{"entity": {"package:numpy": 1}}'])
def test_what_is_no_provenance_is_never_the_same(odd: bytes) -> None:
    assert not same_but_for_the_platform(odd, made())


def test_the_platform_names_the_kernels_that_decide_over_last_bits_and_no_machine() -> None:
    told = installation.machine()
    assert set(told) == {"python", "system", "processor", "instructions", "blas", "kernels"}
    assert told["python"].startswith("CPython 3.")
    assert told["blas"]


def installed(monkeypatch: pytest.MonkeyPatch, folder: Path, **packages: str) -> dict[str, str]:
    """What is said of an environment with these packages."""
    for name, number in packages.items():
        head = f"Metadata-Version: 2.4\nName: {name}\nVersion: {number}\r\nSummary: Name: none\n\nName: other\nVersion: 0\n"
        place = folder / f"{name}-{number}.dist-info"
        place.mkdir(parents=True)
        (place / "METADATA").write_text(head, newline="")
    (folder / "broken-1.dist-info").mkdir()
    monkeypatch.setattr(installation, "distributions", lambda: distributions(path=[str(folder)]))
    return installation.environment.__wrapped__()


def test_an_environment_of_the_lock_is_named_by_its_hash_and_any_other_by_its_packages(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    lock = (ROOT / "pylock.toml").read_bytes()
    packages = {one["name"]: one["version"] for one in tomllib.loads(lock.decode())["packages"] if "version" in one}
    by_lock = {"lock": "pylock.toml", "sha256": hashlib.sha256(lock).hexdigest()}
    assert installed(monkeypatch, tmp_path / "a", **packages, pip="1", **{"cmm-uq": "9"}) == by_lock
    assert installed(monkeypatch, tmp_path / "b", numpy=packages["numpy"], Jinja2=packages["jinja2"]) == by_lock
    listed = "jinja2==0.1 numpy==1.0"
    other = {"packages": listed, "sha256": hashlib.sha256(listed.encode()).hexdigest()}
    assert installed(monkeypatch, tmp_path / "c", numpy="1.0", Jinja2="0.1") == other
    monkeypatch.undo()
    here = {re.sub(r"[-_.]+", "-", one.metadata["Name"]).lower(): one.version for one in distributions()}
    monkeypatch.setattr(installation, "LOCK", tmp_path / "pylock.toml")
    assert installation.environment.__wrapped__()["packages"] == " ".join(
        f"{name}=={here[name]}" for name in sorted(here)
    )
    assert "lock" not in installed(monkeypatch, tmp_path / "d", **packages)


CLOCKS = {
    "now",
    "today",
    "utcnow",
    "time_ns",
    "localtime",
    "gmtime",
    "ctime",
    "perf_counter",
    "monotonic",
    "process_time",
}
READ = {
    "cmm_uq/base/output": {"monotonic"}, "cmm_uq/app/commands/jobs": {"now"}, "cmm_uq/app/commands/parts": {"now"},
    "cmm_uq/laboratory/live": {"now"}, "cmm_uq/laboratory/live/instruments": {"now", "time_ns", "monotonic"},
    "cmm_uq/laboratory/records": {"now"}, "cmm_uq/app/cli": {"now"}, "cmm_uq/app/commands/laboratory": {"now"},
    "cmm_uq/laboratory/schedule": {"now", "time", "monotonic"}, "cmm_uq/certificate/sign": {"now"},
    "cmm_uq/app/serve": {"now", "monotonic"}, "cmm_uq/certificate/verify": {"now"}, "cmm_uq/app/desk": {"monotonic"},
}  # fmt: skip
"""How long a command waits for another one's lock, or for what it is writing when it is interrupted; the date that a new job
begins with, for its reader to change; when a reading came, and when a simulated instrument sends one; when something was
recorded or sent, on which day something is due, when something was signed, or whether that lies ahead, and how long a job, a
lock, a cluster or a browser is waited for. No certificate and no results.json has any of these."""


def clocks(calls: Iterable[ast.Call]) -> set[str]:
    """Clocks that calls of a module read, by the names of ``time`` and ``datetime``."""
    named = [call.func for call in calls if isinstance(call.func, ast.Attribute)]
    of_time = {
        "time" for call in named if call.attr == "time" and isinstance(call.value, ast.Name) and call.value.id == "time"
    }
    return {call.attr for call in named if call.attr in CLOCKS} | of_time


def test_no_room_reads_a_clock_but_these() -> None:
    read = defaultdict(set)
    for path in (ROOT / "cmm_uq").rglob("*.py"):
        read[path.parent.relative_to(ROOT).as_posix()] |= clocks(calls_of(path))
    assert {room: names for room, names in read.items() if names} == READ


@pytest.mark.parametrize("call", ["dt.datetime.now()", "date.today()", "time.time()", "time.perf_counter()"])
def test_a_clock_would_be_found(call: str) -> None:
    assert clocks(node for node in ast.walk(ast.parse(call)) if isinstance(node, ast.Call))


@pytest.mark.parametrize("epoch", ["0", "4102444800"])
def test_the_epoch_of_a_reproducible_build_changes_no_byte(
    epoch: str, certificate: Document, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.delenv("SOURCE_DATE_EPOCH", raising=False)
    before = render_html(certificate), render_pdf(certificate, {"job.toml": b"[job]"})
    monkeypatch.setenv("SOURCE_DATE_EPOCH", epoch)
    assert (render_html(certificate), render_pdf(certificate, {"job.toml": b"[job]"})) == before
