"""A small certificate by hand, for tests."""

from __future__ import annotations

import datetime as dt
from decimal import Decimal

from cmm_uq.jobs.dcc import Certificate
from cmm_uq.jobs.dcc.certificate import (
    Administrative,
    Attached,
    CalibrationLaboratory,
    Contact,
    CoreData,
    Data,
    DccQuantity,
    DccResult,
    IdentificationNumber,
    Item,
    Items,
    Location,
    Measurement,
    Method,
    PerformanceLocation,
    Person,
    Software,
    Somebody,
    rich,
    words,
)
from cmm_uq.jobs.dcc.quantities import Expanded, Real

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
    somebody = Contact(name=words({"en": "Laboratory", "de": "Labor"}), location=Location(city=("Braunschweig",)))
    method = Method(name=words("Comparison"), norms=("ISO 10360-2:2009",))
    data = Data(parts=(DccQuantity(name=words("Length"), value=value, ref_type=("basic_measuredValue",)),))
    result = DccResult(name=words("Length"), data=data)
    return Certificate(
        administrative=Administrative(
            software=(Software(name=words("cmm-uq"), release="1"),),
            core=CoreData(
                country="DE",
                languages=("en", "de"),
                mandatory_languages=("en",),
                identifier="4711",
                begin=dt.date(2026, 3, 1),
                end=dt.date(2026, 3, 2),
                location=PerformanceLocation(place="laboratory"),
            ),
            items=Items(
                items=(
                    Item(
                        name=words("Ball bar"),
                        identifications=(IdentificationNumber(issuer="manufacturer", value="12"),),
                        id="bar",
                    ),
                )
            ),
            laboratory=CalibrationLaboratory(contact=somebody),
            persons=(Person(person=Somebody(name=words('A < B & "C"'))),),
            customer=somebody,
        ),
        measurements=(Measurement(name=words("Calibration"), methods=(method,), results=(result,), ref_id=("bar",)),),
        document=Attached(
            file_name="a.html", mime_type="text/html", data=bytes(range(256)), description=rich("a", "b")
        ),
    )
