"""Certificates of artefacts, as a laboratory would issue them; ``python -m tests.jobs.dcc.artefacts`` writes the sample."""

from __future__ import annotations

import datetime as dt
from collections.abc import Sequence
from decimal import Decimal

from cmm_uq.jobs.dcc import Certificate, certificate as dcc, written
from tests.conftest import ROOT
from tests.jobs.dcc.certificates import certificate
from tests.jobs.dcc.texts import words

K, P, MM = Decimal(2), Decimal("0.95"), r"\milli\metre"
DUE = dcc.StatementMetadata(ref_type=("basic_recalibration",), date=dt.date(2028, 3, 2))


def value(
    name: str, number: str, U: str | None = None, unit: str = MM, ref_type: str = "basic_measuredValue"
) -> dcc.DccQuantity:
    """One value with its expanded uncertainty in the same unit."""
    stated = None if U is None else dcc.Expanded(uncertainty=Decimal(U), factor=K, probability=P)
    return dcc.DccQuantity(
        name=words(name), ref_type=(ref_type,), value=dcc.Real(value=Decimal(number), unit=unit, uncertainty=stated)
    )


def listed(
    name: str, numbers: str, Us: str | None = None, unit: str = MM, covariance: Sequence[Sequence[str]] = ()
) -> dcc.DccQuantity:
    """A list of values, with one uncertainty for all or one a value."""
    stated = None if Us is None else dcc.ExpandedList(
        uncertainties=_decimals(Us), factors=(K,), probabilities=(P,)
    )  # fmt: skip
    region = None
    if covariance:
        unit_ = unit + r"\tothe{2}"
        columns = tuple(
            dcc.CovarianceColumn(
                covariances=tuple(dcc.CovarianceElement(value=Decimal(one), unit=unit_) for one in row)
            )
            for row in covariance
        )
        region = dcc.EllipsoidalRegion(columns=columns, factor=K, probability=P)
    found = dcc.RealList(values=_decimals(numbers), units=(unit,), uncertainty=stated, region=region)
    return dcc.DccQuantity(name=words(name), value=found)


def issued(
    *parts: dcc.DccQuantity, item: str = "Ball bar", result: str = "Certified values", table: bool = False
) -> Certificate:
    """A certificate of one item with one result, due on a day."""
    held = (dcc.QuantityList(parts=parts),) if table else parts
    made = certificate()
    (old,) = made.administrative.items.items
    items = made.administrative.items.with_changes(items=(old.with_changes(name=words(item)),))
    core = made.administrative.core.with_changes(identifier="D-K-4711", issued=dt.date(2026, 3, 5))
    found = dcc.DccResult(name=words(result), data=dcc.Data(parts=held))
    administrative = made.administrative.with_changes(
        items=items, core=core, statements=(DUE,), persons=(dcc.Person(person=dcc.Somebody(name=words("A. Huber"))),)
    )  # fmt: skip
    measurement = dcc.Measurement(name=words("Calibration"), results=(found,))
    return made.with_changes(administrative=administrative, measurements=(measurement,), document=None)


def _decimals(text: str) -> tuple[Decimal, ...]:
    return tuple(Decimal(part) for part in text.split())


BALL_BAR = issued(value("Nominal length", "404"), value("Length between the centres", "404.2357", "0.0030"))
SPHERE = issued(
    value("Diameter", "25.0012", "0.0002"), value("Form deviation", "0.10", "0.05", r"\micro\metre"), item="Sphere"
)
STEP_GAUGE = issued(
    listed("Face", "1 2 3 4", unit=r"\one"),
    listed("Certified length", "0 20.00013 40.00008 60.00031", "0 0.0002 0.0003 0.0004"),
    item="Step gauge", table=True,
)  # fmt: skip
PLATE = issued(
    listed("Ball", "1 2 3 4", unit=r"\one"), listed("X calibrated", "0 83.00012 0.00021 83.00043", "0.0006"),
    listed("Y calibrated", "0 0 83.00034 83.00051", "0.0008"), listed("Z calibrated", "0 -0.00102 0.00044 0.00007", "0.0010"),
    item="Ball plate", result="Places of the balls", table=True,
)  # fmt: skip
TRIANGLE = issued(
    listed("Block length", "480.00010 280.00005 380.00020", "0.0002 0.0002 0.0003"),
    listed("Cylinder diameter", "20.0001 20.0002 19.9999", "0.0002"), item="Triangle",
)  # fmt: skip
SAMPLE = ROOT / "docs" / "import" / "samples" / "plate-certificate.xml"

if __name__ == "__main__":
    SAMPLE.write_bytes(written(PLATE))
