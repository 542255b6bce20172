"""Whatever a kind of another package reports, and whatever else a job may have, makes a certificate that the schema takes."""

from __future__ import annotations

import hashlib
from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import pytest
from hypothesis import given, strategies as st
from lxml import etree

from cmm_uq.certificate.digital_certificate.certificate import digital_certificate
from cmm_uq.certificate.origin import as_json
from cmm_uq.jobs.dcc import Certificate, read, written
from cmm_uq.jobs.dcc.certificate import Expanded, Real
from cmm_uq.jobs.job import Job
from cmm_uq.jobs.recording.beside import ShortGaugeFacts
from cmm_uq.jobs.tables.artefact import CertificateFile
from tests.artefacts.simulated import results
from tests.certificate.digital_certificate.test_certificate import MEASURED, job_of
from tests.jobs.dcc.schemas import by_lxml

TEXTS = st.text(
    st.characters(codec="utf-8", exclude_categories=("Cc", "Cs"), exclude_characters="\ufffe\uffff"), max_size=9
)
NUMBERS = st.floats(allow_nan=False, allow_infinity=False, min_value=-1e12, max_value=1e12)
KEYS = st.sampled_from(("value", "u", "U", "k", "interval95", "error_um", "u_um", "interval95_um")) | TEXTS
ANYTHING = st.recursive(
    st.none() | st.booleans() | NUMBERS | st.integers(-(10**12), 10**12) | TEXTS,
    lambda inner: st.lists(inner, max_size=4) | st.dictionaries(KEYS.filter(bool), inner, max_size=4),
    max_leaves=12,
)


def checked(data: Mapping[str, Any], job: Job) -> Certificate:
    """A certificate that was written, is valid, and is read as it was made."""
    made = digital_certificate(data, job, html=None)
    text = written(made)
    assert by_lxml("3.2.1").validate(etree.fromstring(text, etree.XMLParser(huge_tree=True)))
    assert read(text, "certificate.xml") == made
    return made


@pytest.mark.long
@given(TEXTS.filter(bool), ANYTHING)
def test_any_report_of_another_package_makes_a_valid_certificate(key: str, value: Any) -> None:
    plain = {
        "schema": "cmm-uq/results/1",
        "software": {"name": "cmm-uq", "version": "1"},
        "job": results(MEASURED)["job"],
    }
    checked({**plain, key: value, **plain}, job_of(MEASURED))


def test_what_stood_before_an_adjustment_priors_and_risks_are_there() -> None:
    data = results(MEASURED)
    as_found = {key: data[key] for key in ("job", "estimates", "accuracy_uncertainty", "conformity")}
    statement = {**data["conformity"][0], "prior": {"mean_um": 0.0, "u_um": 12.5},
                 "global_risks": {"consumer": 0.0123, "producer": 0.25},
                 "mpe": {"a_um": 3.0, "k": 300.0, "b_um": None}}  # fmt: skip
    made = written(checked({**data, "as_found": as_found, "conformity": [statement]}, job_of(MEASURED))).decode()
    assert 'id="as_found.estimates.scale_x.ppm"' in made
    for wanted in (
        'id="conformity.0.prior.u_um"', 'id="conformity.0.global_risks.consumer"', "<si:value>0.0123</si:value>",
        'id="conformity.0.mpe.k"', r"<si:unit>\milli\metre\micro\metre\tothe{-1}</si:unit>",
    ):  # fmt: skip
        assert wanted in made


def test_the_certificate_of_the_artefact_has_the_hash_of_its_file_and_whether_it_was_in_date() -> None:
    job, content = job_of(MEASURED), b"a certificate"
    chain = CertificateFile.model_construct(
        number="C 1", laboratory="PTB", date=None, due=job.facts.job.date, file="c.pdf"
    )
    gauge = ShortGaugeFacts.model_construct(
        file="g.csv", length_mm=25.0, u_um=0.1, cte_per_k=0.0, name="Gauge", serial="G 7", certificate=None
    )
    artefact = job.facts.artefact.model_copy(update={"certificate": chain})
    facts = job.facts.model_copy(update={"artefact": artefact, "short_gauge": gauge})
    whole = checked(results(MEASURED), replace(job, facts=facts, inputs={**job.inputs, "c.pdf": content}))
    assert whole.measurements[0].equipment is not None
    first, second = whole.measurements[0].equipment.equipment
    assert first.certificate is not None
    assert (first.certificate.referral_id, first.certificate.procedure) == ("C 1", "SHA-256")
    assert first.certificate.value == hashlib.sha256(content).hexdigest()
    assert first.certificate.in_validity_range is True
    assert (str(second.name), second.identifications[0].value, second.certificate) == ("Gauge", "G 7", None)
    length = second.quantities[0].value
    assert isinstance(length, Real)
    assert isinstance(length.uncertainty, Expanded)
    assert (length.unit, str(length.uncertainty.uncertainty)) == (r"\milli\metre", "0.0001")


def test_results_json_inside_is_the_file_itself() -> None:
    data = results(MEASURED)
    assert checked(data, job_of(MEASURED)).measurements[0].results[-1].data.parts[0].data == as_json(data)
