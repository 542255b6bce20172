"""A small certificate by hand, for tests."""

from __future__ import annotations

import datetime as dt
from decimal import Decimal

from cmm_uq.jobs.dcc import Certificate, certificate as dcc
from cmm_uq.jobs.dcc.certificate import Expanded, Real
from tests.jobs.dcc.texts import rich, words

LENGTH = Real(
    label="L",
    value=Decimal("404.23570"),
    unit=r"\milli\metre",
    uncertainty=Expanded(
        uncertainty=Decimal("0.0100"), factor=Decimal("2.00"), probability=Decimal("0.95"), distribution="normal"
    ),
)


def certificate(value: Real = LENGTH) -> Certificate:
    """Of a ball bar with one length."""
    somebody = dcc.Contact(
        name=words({"en": "Laboratory", "de": "Labor"}), location=dcc.Location(city=("Braunschweig",))
    )
    method = dcc.Method(name=words("Comparison"), norms=("ISO 10360-2:2009",))
    data = dcc.Data(parts=(dcc.DccQuantity(name=words("Length"), value=value, ref_type=("basic_measuredValue",)),))
    result = dcc.DccResult(name=words("Length"), data=data)
    return Certificate(
        administrative=dcc.Administrative(
            software=(dcc.Software(name=words("cmm-uq"), release="1"),),
            core=dcc.CoreData(
                country="DE",
                languages=("en", "de"),
                mandatory_languages=("en",),
                identifier="4711",
                begin=dt.date(2026, 3, 1),
                end=dt.date(2026, 3, 2),
                location=dcc.PerformanceLocation(place="laboratory"),
            ),
            items=dcc.Items(
                items=(
                    dcc.Item(
                        name=words("Ball bar"),
                        identifications=(dcc.IdentificationNumber(issuer="manufacturer", value="12"),),
                        id="bar",
                    ),
                )
            ),
            laboratory=dcc.CalibrationLaboratory(contact=somebody),
            persons=(dcc.Person(person=dcc.Somebody(name=words('A < B & "C"'))),),
            customer=somebody,
        ),
        measurements=(
            dcc.Measurement(name=words("Calibration"), methods=(method,), results=(result,), ref_id=("bar",)),
        ),
        document=dcc.Attached(
            file_name="a.html", mime_type="text/html", data=bytes(range(256)), description=rich("a", "b")
        ),
    )
