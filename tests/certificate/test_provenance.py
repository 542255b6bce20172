"""``provenance.json``: W3C PROV that another library reads, the same on every run, with the platform in one place."""

from __future__ import annotations

import hashlib
import json
from importlib.metadata import version

import pytest
from prov.model import ProvActivity, ProvAgent, ProvDerivation, ProvDocument, ProvEntity, ProvUsage

from cmm_uq import __version__
from cmm_uq.certificate.results import provenance as installation
from cmm_uq.certificate.results.contents import head
from cmm_uq.certificate.results.provenance import provenance, same_but_for_the_platform
from tests.certificate.test_clauses import REPLACED, complete
from tests.certificate.test_completeness import WHOLE

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
