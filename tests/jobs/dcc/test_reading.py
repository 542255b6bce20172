"""What is no certificate is refused with line and XPath; nothing of another file, and nothing endless, is read."""

from __future__ import annotations

import pytest

from cmm_uq.base.errors import CmmUqError
from cmm_uq.base.files.limits import XML_ATTRIBUTES, XML_DEPTH, XML_ELEMENTS
from cmm_uq.jobs.dcc import read, unread, written
from tests.jobs.dcc.certificates import certificate

GOOD = written(certificate()).decode()
CORE = "/dcc:digitalCalibrationCertificate/dcc:administrativeData/dcc:coreData"
HEAD = '<?xml version="1.0" encoding="UTF-8"?>\n'
BOMB = HEAD + '<!DOCTYPE a [<!ENTITY b "bb"><!ENTITY c "&b;&b;">]>\n<a>&c;</a>'
OUTSIDE = HEAD + '<!DOCTYPE a [<!ENTITY b SYSTEM "file:///etc/passwd">]>\n<a>&b;</a>'


def refused(text: str | bytes) -> CmmUqError:
    with pytest.raises(CmmUqError) as caught:
        read(text if isinstance(text, bytes) else text.encode(), "c.xml")
    return caught.value


@pytest.mark.long
@pytest.mark.parametrize(("text", "told"), [
    (BOMB, "line 2: has a document type"), (OUTSIDE, "line 2: has a document type"),
    ("", "is no XML: no element found"), ("<a>", "is no XML: no element found"), ("<a/>", "is no DCC: its root is a"),
    (HEAD + "<a>" * (XML_DEPTH.most + 2), f"more than {XML_DEPTH.most} levels"),
    ("<a " + " ".join(f"b{i}='1'" for i in range(XML_ATTRIBUTES.most + 1)) + "/>", f"more than {XML_ATTRIBUTES.most} attr"),
    ("<a>" + "<b/>" * XML_ELEMENTS.most + "</a>", f"more than {XML_ELEMENTS.most} elements"),
])  # fmt: skip
def test_what_is_no_certificate_is_refused(text: str, told: str) -> None:
    assert told in str(refused(text))


def test_bytes_that_are_no_text_are_refused() -> None:
    assert "is no XML" in str(refused(b"\xff\xfe\x00\x01"))


@pytest.mark.parametrize(("change", "to", "told", "where"), [
    ("<dcc:uniqueIdentifier>4711", "<dcc:uniqueIdentifier> ", "is not a text without spaces", f"{CORE}/dcc:uniqueIdentifier"),
    ("<dcc:uniqueIdentifier>4711</dcc:uniqueIdentifier>", "", "dcc:coreData has no dcc:uniqueIdentifier", CORE),
    ("<dcc:countryCodeISO3166_1>DE", "<dcc:countryCodeISO3166_1>Germany", "is not a country", CORE),
    ("2026-03-01", "1 March", "'1 March' is not a date", f"{CORE}/dcc:beginPerformanceDate"),
    ("2026-03-01", "2026-03-03", "began on 2026-03-03 and ended on 2026-03-02", CORE),
    ("<dcc:mandatoryLangCodeISO639_1>en", "<dcc:mandatoryLangCodeISO639_1>fr", "mandatory language 'fr' is not used", CORE),
    ("404.23570", "404,23570", "'404,23570' is not a number", "si:value"),
    ("404.23570", "1e999", "'1e999' is not a number", "si:value"),
    ("404.23570", "9" * 101, "is not a number", "si:value"),
    ("<si:coverageFactor>2.00", "<si:coverageFactor>0.5", "is not a coverage factor", "si:coverageFactor"),
    ("<si:coverageProbability>0.95", "<si:coverageProbability>95", "is not a probability", "si:coverageProbability"),
    ("<si:uncertainty>0.0100", "<si:uncertainty>-0.01", "is not a number, 0 or more", "si:uncertainty"),
    ("si:value>", "si:Value>", "si:Value has no place here. Did you mean 'si:value'?", "si:Value"),
    ('id="bar"', 'id="bar" refid="x"', "has no attribute refid", "dcc:item"),
    ('refId="bar"', 'refId="ball"', "refId 'ball' is the id of nothing", "dcc:measurementResult"),
    ('<dcc:item id="bar">', '<dcc:item id="bar">words', "has text between its elements", "dcc:item"),
    ("<dcc:issuer>manufacturer", "<dcc:issuer>maker", "is not one of manufacturer", "dcc:issuer"),
    ("<dcc:dataBase64>", "<dcc:dataBase64>!", "is not base64", "dcc:document/dcc:dataBase64"),
])  # fmt: skip
def test_what_is_wrong_is_told_with_its_place(change: str, to: str, told: str, where: str) -> None:
    text = GOOD.replace(change, to)
    assert text != GOOD
    error = refused(text)
    every = [error, *error.also]
    assert any(told in str(one) and where in (one.where or "") and ", line " in (one.where or "") for one in every)


def test_order_and_number_of_elements_are_those_of_the_schema() -> None:
    label, value = "<si:label>L</si:label>", "<si:value>404.23570</si:value>"
    flat = "".join(line.strip() for line in GOOD.splitlines())
    assert "si:label stands behind what has to follow it" in str(refused(flat.replace(label + value, value + label)))
    assert "si:value is there 2 times" in str(refused(flat.replace(value, value * 2)))


def test_an_id_is_there_once() -> None:
    twice = GOOD.replace("<dcc:measurementResult ", '<dcc:measurementResult id="bar" ')
    assert "id 'bar' is that of line" in str(refused(twice))


def test_all_that_is_wrong_is_told_at_once_and_a_long_list_ends() -> None:
    error = refused(GOOD.replace("404.23570", "x").replace("2.00", "y"))
    assert len(error.also) == 1
    many = refused(GOOD.replace("<si:label>", '<si:label a="1">' + "<b/>" * 1000))
    assert 0 < len(many.also) < 100


def test_of_a_later_version_what_it_has_beyond_3_2_1_is_left_out_and_listed() -> None:
    later = GOOD.replace('"3.2.1"', '"3.3.0"').replace(
        "</dcc:usedMethod>", "<dcc:link>https://ptb.de</dcc:link></dcc:usedMethod>"
    )
    found = read(later.encode(), "c.xml")
    assert found.with_changes(version="3.2.1") == certificate()
    assert [path.rpartition("/")[2] for path in unread(later.encode(), "c.xml")] == ["dcc:link"]
    assert "dcc:link has no place here" in str(refused(later.replace('"3.3.0"', '"3.2.1"')))
    assert "is not version 3" in str(refused(GOOD.replace('schemaVersion="3.2.1"', 'schemaVersion="2.4.0"')))


def test_uncertainties_of_d_si_2_2_are_read() -> None:
    """They are where DCC 3.3 certificates have them."""
    expanded = GOOD[GOOD.index("<si:expandedUnc>") : GOOD.index("</si:expandedUnc>") + len("</si:expandedUnc>")]
    later = expanded.replace("expandedUnc", "expandedMU").replace("si:uncertainty", "si:valueExpandedMU")
    wrapped = f"<si:measurementUncertaintyUnivariate>{later}</si:measurementUncertaintyUnivariate>"
    found = read(GOOD.replace('"3.2.1"', '"3.3.0"').replace(expanded, wrapped).encode(), "c.xml")
    value = found.measurements[0].results[0].data.parts[0].value
    assert str(value.uncertainty.stated.uncertainty) == "0.0100"
