"""An expanded uncertainty is divided by its own coverage factor, whatever that is, in every place where a job states one."""

from __future__ import annotations

from decimal import Decimal

import pytest

from cmm_uq.jobs.dcc.figures import ValueUncertainty
from cmm_uq.jobs.tables.length_formula import factor_of, with_standard_uncertainty
from tests.jobs.recording.test_references import CERTIFICATE, GAUGE, job


def test_a_table_divides_by_two_and_a_quarter() -> None:
    assert with_standard_uncertainty({"U_um": 4.5, "k": 2.25})["u_um"] == 2.0
    growing = with_standard_uncertainty({"U_um": "0.45 + L/400", "k": 2.25})["u_um"]
    assert (growing.fixed_um, growing.per_mm) == pytest.approx((0.2, 1 / 900))


def test_degrees_of_freedom_stand_for_a_factor_where_none_is_stated() -> None:
    assert factor_of(2.25, 4.0) == 2.25
    assert factor_of(None, 4.0) == pytest.approx(2.78, abs=5e-3)  # t at 95 % (GUM, table G.2)


def test_a_heading_of_a_certificate_divides_by_two_and_a_quarter() -> None:
    found = job(GAUGE, "certificate.csv", CERTIFICATE.replace("U (um) k=2", "U (um) k=2.25"))
    assert found.points.columns["reference_u_um"][:4].tolist() == pytest.approx(
        [u / 2.25 for u in (0.1, 0.12, 0.14, 0.16)]
    )


def test_a_digital_certificate_divides_by_two_and_a_quarter() -> None:
    assert ValueUncertainty(expanded=Decimal("4.5"), factor=Decimal("2.25")).u == 2
