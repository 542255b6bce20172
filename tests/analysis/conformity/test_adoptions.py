"""National names of standards are taken for the edition that they adopt; editions that adopt another one are not."""

from __future__ import annotations

import pytest

from cmm_uq.analysis.conformity.standards import names, standard_named
from cmm_uq.jobs.tables.adoptions import nearest

TAKEN = {
    "JIS B 7440-2:2013": "ISO 10360-2:2009", "JIS B 7440-2": "ISO 10360-2:2009", "JIS B 7440-5:2013": "ISO 10360-5:2010",
    "GB/T 16857.2-2017": "ISO 10360-2:2009", "GB/T 16857.5-2017": "ISO 10360-5:2010", "GBT 16857.2": "ISO 10360-2:2009",
    "DIN EN ISO 10360-2:2010-06": "ISO 10360-2:2009", "BS EN ISO 10360-2": "ISO 10360-2:2009",
    "NF EN ISO 10360-5:2020": "ISO 10360-5:2020", "UNE-EN ISO 10360-5:2011": "ISO 10360-5:2010",
    "KS B ISO 10360-2:2015": "ISO 10360-2:2009", "ANSI/ASME B89.4.1": "ASME B89.4.1-1997",
}  # fmt: skip


@pytest.mark.parametrize(("name", "standard"), TAKEN.items())
def test_a_national_name_is_that_of_what_it_adopts_and_the_certificate_says_so(name: str, standard: str) -> None:
    found, own = standard_named(name), standard_named(standard)
    assert found is not None
    assert own is not None
    assert (found.name, found.characteristics, found.clauses) == (standard, own.characteristics, own.clauses)
    assert len(found.remarks) == len(own.remarks) + 1
    assert f"{name} is taken for the adoption of {standard}: " in found.remarks[-1]


@pytest.mark.parametrize(
    "name", ["JIS B 7440-2:2003", "GB/T 16857.2-2006", "DIN EN ISO 10360-2:2002", "KS B ISO 10360-2:2003"]
)
def test_an_edition_that_adopts_an_older_text_is_refused_with_the_one_decided_here(name: str) -> None:
    assert standard_named(name) is None
    assert nearest(name, names()) == "It adopts an edition of ISO 10360-2: decided here is 'ISO 10360-2:2009'"


def test_of_two_editions_a_name_without_its_year_is_none() -> None:
    assert standard_named("DIN EN ISO 10360-5") is None
    assert "'ISO 10360-5:2010' or 'ISO 10360-5:2020'" in nearest("DIN EN ISO 10360-5", names())
    assert "ISO 230-2" not in nearest("GB/T 16857.6-2006", names())
    assert nearest("ISO 10360-2", names()) == "Did you mean 'ISO 10360-2:2009'?"
