"""Quantities of D-SI 2.1 (SmartCom): a value with its unit and uncertainty, lists, and regions of several values.

Of D-SI 2.2 only what it says anew of uncertainty is read: ``measurementUncertaintyUnivariate`` of a value and of a list.
"""

from __future__ import annotations

import datetime as dt
from decimal import Decimal
from typing import Annotated, ClassVar

from cmm_uq.jobs.dcc.fields import FACTOR, PROBABILITY, UNCERTAINTY, Child, Element

Decimals = tuple[Decimal, ...]
Strings = tuple[str, ...]
Time = Annotated[dt.datetime | None, Child("dateTime")]
Factor = Annotated[Decimal, Child("coverageFactor", FACTOR)]
Factors = Annotated[Decimals, Child("coverageFactorXMLList", FACTOR)]
Probability = Annotated[Decimal, Child("coverageProbability", PROBABILITY)]
Probabilities = Annotated[Decimals, Child("coverageProbabilityXMLList", PROBABILITY)]
Distributions = Annotated[Strings, Child("distributionXMLList")]


class _Si(Element):
    SPACE: ClassVar[str] = "si"


class Expanded(_Si):  # expandedUncType
    uncertainty: Annotated[Decimal, Child(simple=UNCERTAINTY)]
    factor: Factor
    probability: Probability
    distribution: str | None = None


class Interval(_Si):  # Coverage interval, which need not be symmetric (``coverageIntervalType``)
    standard: Annotated[Decimal, Child("standardUnc", UNCERTAINTY)]
    low: Annotated[Decimal, Child("intervalMin")]
    high: Annotated[Decimal, Child("intervalMax")]
    probability: Probability
    distribution: str | None = None


class StandardMU(_Si):  # Standard uncertainty; it and the other classes whose names end in MU are of D-SI 2.2
    standard: Annotated[Decimal, Child("valueStandardMU", UNCERTAINTY)]
    distribution: str | None = None


class ExpandedMU(_Si):
    uncertainty: Annotated[Decimal, Child("valueExpandedMU", UNCERTAINTY)]
    factor: Factor
    probability: Probability
    distribution: str | None = None


class IntervalMU(Interval):
    standard: Annotated[Decimal, Child("valueStandardMU", UNCERTAINTY)]


class Univariate(_Si):  # Uncertainty of one value (D-SI 2.2)
    stated: Annotated[StandardMU | ExpandedMU | IntervalMU, Child(("standardMU", "expandedMU", "coverageIntervalMU"))]


class Real(_Si):  # A value (``realQuantityType``); units in D-SI, ``\micro\metre``
    label: str | None = None
    value: Decimal
    unit: str
    time: Time = None
    uncertainty: Annotated[
        Expanded | Interval | Univariate | None,
        Child(("expandedUnc", "coverageInterval", "measurementUncertaintyUnivariate")),
    ] = None


class Constant(_Si):  # A constant (``constantQuantityType``); its uncertainty is a standard uncertainty
    label: str | None = None
    value: Decimal
    unit: str
    time: Time = None
    uncertainty: Annotated[Decimal | None, Child(simple=UNCERTAINTY)] = None
    distribution: str | None = None


class CovarianceElement(_Si):
    value: Decimal
    unit: str


class CovarianceColumn(_Si):
    covariances: Annotated[tuple[CovarianceElement, ...], Child("covariance")]


class EllipsoidalRegion(_Si):  # A region of several values together (``ellipsoidalRegionType``)
    columns: Annotated[tuple[CovarianceColumn, ...], Child("column", within="covarianceMatrix")]
    factor: Factor
    probability: Probability
    distribution: str | None = None


class RectangularRegion(EllipsoidalRegion):
    """The same as a rectangular region (``rectangularRegionType``)."""


Region = Annotated[EllipsoidalRegion | RectangularRegion | None, Child(("ellipsoidalRegion", "rectangularRegion"))]


class Complex(_Si):  # A complex value (``complexQuantityType``), by its parts or by magnitude and phase
    label: str | None = None
    real: Annotated[Decimal | None, Child("valueReal")] = None
    imaginary: Annotated[Decimal | None, Child("valueImag")] = None
    magnitude: Annotated[Decimal | None, Child("valueMagnitude")] = None
    phase: Annotated[Decimal | None, Child("valuePhase")] = None
    unit: str | None = None
    phase_unit: Annotated[str | None, Child("unitPhase")] = None
    time: Time = None
    region: Region = None


class ExpandedList(_Si):  # Expanded uncertainties of a list: one a value, or one for all
    uncertainties: Annotated[Decimals, Child("uncertaintyXMLList", UNCERTAINTY)]
    factors: Factors
    probabilities: Probabilities
    distributions: Distributions = ()


class IntervalList(_Si):
    standards: Annotated[Decimals, Child("standardUncXMLList", UNCERTAINTY)]
    lows: Annotated[Decimals, Child("intervalMinXMLList")]
    highs: Annotated[Decimals, Child("intervalMaxXMLList")]
    probabilities: Probabilities
    distributions: Distributions = ()


class ExpandedListMU(_Si):
    uncertainties: Annotated[Decimals, Child("valueExpandedMUXMLList", UNCERTAINTY)]
    factors: Factors
    probabilities: Probabilities
    distributions: Distributions = ()


class StandardListMU(_Si):
    standards: Annotated[Decimals, Child("valueStandardMUXMLList", UNCERTAINTY)]
    distributions: Distributions = ()


class UnivariateList(_Si):  # Uncertainties of the values of a list, each by itself (D-SI 2.2)
    stated: Annotated[StandardListMU | ExpandedListMU, Child(("standardMUXMLList", "expandedMUXMLList"))]


class RealList(_Si):  # Values with their units (``realListXMLListType``): a unit a value, or one for all
    labels: Annotated[Strings, Child("labelXMLList")] = ()
    values: Annotated[Decimals, Child("valueXMLList")]
    units: Annotated[Strings, Child("unitXMLList")]
    times: Annotated[tuple[dt.datetime, ...], Child("dateTimeXMLList")] = ()
    uncertainty: Annotated[
        ExpandedList | IntervalList | UnivariateList | None,
        Child(("expandedUncXMLList", "coverageIntervalXMLList", "measurementUncertaintyUnivariateXMLList")),
    ] = None
    region: Annotated[
        EllipsoidalRegion | RectangularRegion | None, Child(("ellipsoidalRegionXMLList", "rectangularRegionXMLList"))
    ] = None


class ListUncertainty(_Si):  # Uncertainty of every value of a list alike (``listUnivariateUncType``)
    stated: Annotated[Expanded | Interval, Child(("expandedUnc", "coverageInterval"))]


class RealInList(_Si):  # A value in a list; its unit may be the list's
    label: str | None = None
    value: Decimal
    unit: str | None = None
    time: Time = None
    uncertainty: Annotated[Expanded | Interval | None, Child(("expandedUnc", "coverageInterval"))] = None


class Reals(_Si):  # Values one by one (``realListType``)
    label: str | None = None
    time: Time = None
    unit: Annotated[str | None, Child("listUnit")] = None
    uncertainty: Annotated[ListUncertainty | None, Child("listUnivariateUnc")] = None
    values: Annotated[tuple[RealInList, ...], Child("real")]
    region: Region = None


class Bivariate(_Si):  # Region of every value of a list alike (``listBivariateUncType``)
    region: Region = None


class Complexes(_Si):  # Complex values one by one (``complexListType``)
    label: str | None = None
    time: Time = None
    unit: Annotated[str | None, Child("listUnit")] = None
    phase_unit: Annotated[str | None, Child("listUnitPhase")] = None
    uncertainty: Annotated[Bivariate | None, Child("listBivariateUnc")] = None
    values: Annotated[tuple[Complex, ...], Child("complex")]
    region: Region = None


class Lists(_Si):  # Lists of lists (``listType`` of D-SI)
    label: str | None = None
    time: Time = None
    lists: Annotated[tuple[Reals | Complexes | Lists, ...], Child(("realList", "complexList", "list"))]


class Hybrid(_Si):  # The same quantity in several units (``hybridType``); the first is that of the certificate
    values: Annotated[
        tuple[Real | Complex | Lists | Reals | RealList | Complexes | Constant, ...],
        Child(("real", "complex", "list", "realList", "realListXMLList", "complexList", "constant")),
    ]
