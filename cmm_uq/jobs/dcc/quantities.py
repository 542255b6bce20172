"""Quantities of D-SI 2.1 (SmartCom): a value with its unit and uncertainty, lists, and regions of several values.

Of D-SI 2.2 only what it says anew of uncertainty is read: ``measurementUncertaintyUnivariate`` of a value and of a list.
"""

from __future__ import annotations

import datetime as dt
from decimal import Decimal
from typing import Annotated, ClassVar

from cmm_uq.jobs.dcc.fields import (
    DATE_TIME,
    DATE_TIMES,
    DECIMAL,
    DECIMALS,
    FACTOR,
    FACTORS,
    PROBABILITIES,
    PROBABILITY,
    STRING,
    STRINGS,
    UNCERTAINTIES,
    UNCERTAINTY,
    Child,
    Choice,
    Element,
    Many,
)

Decimals = tuple[Decimal, ...]
Label = Annotated[str | None, Child("label", STRING)]
Time = Annotated[dt.datetime | None, Child("dateTime", DATE_TIME)]
Distribution = Annotated[str | None, Child("distribution", STRING)]
Distributions = Annotated[tuple[str, ...], Child("distributionXMLList", STRINGS)]


class _Si(Element):
    """Of the namespace of D-SI."""

    SPACE: ClassVar[str] = "si"


class Expanded(_Si):
    """Expanded uncertainty (``expandedUncType``)."""

    uncertainty: Annotated[Decimal, Child("uncertainty", UNCERTAINTY)]
    factor: Annotated[Decimal, Child("coverageFactor", FACTOR)]
    probability: Annotated[Decimal, Child("coverageProbability", PROBABILITY)]
    distribution: Distribution = None


class Interval(_Si):
    """Coverage interval, which need not be symmetric (``coverageIntervalType``)."""

    standard: Annotated[Decimal, Child("standardUnc", UNCERTAINTY)]
    low: Annotated[Decimal, Child("intervalMin", DECIMAL)]
    high: Annotated[Decimal, Child("intervalMax", DECIMAL)]
    probability: Annotated[Decimal, Child("coverageProbability", PROBABILITY)]
    distribution: Distribution = None


class StandardMU(_Si):
    """Standard uncertainty (D-SI 2.2)."""

    standard: Annotated[Decimal, Child("valueStandardMU", UNCERTAINTY)]
    distribution: Distribution = None


class ExpandedMU(_Si):
    """Expanded uncertainty (D-SI 2.2)."""

    uncertainty: Annotated[Decimal, Child("valueExpandedMU", UNCERTAINTY)]
    factor: Annotated[Decimal, Child("coverageFactor", FACTOR)]
    probability: Annotated[Decimal, Child("coverageProbability", PROBABILITY)]
    distribution: Distribution = None


class IntervalMU(_Si):
    """Coverage interval (D-SI 2.2)."""

    standard: Annotated[Decimal, Child("valueStandardMU", UNCERTAINTY)]
    low: Annotated[Decimal, Child("intervalMin", DECIMAL)]
    high: Annotated[Decimal, Child("intervalMax", DECIMAL)]
    probability: Annotated[Decimal, Child("coverageProbability", PROBABILITY)]
    distribution: Distribution = None


class Univariate(_Si):
    """Uncertainty of one value (D-SI 2.2)."""

    stated: Annotated[StandardMU | ExpandedMU | IntervalMU, Choice(("standardMU", "expandedMU", "coverageIntervalMU"))]


class Real(_Si):
    r"""A value (``realQuantityType``); units in D-SI, ``\micro\metre``."""

    label: Label = None
    value: Annotated[Decimal, Child("value", DECIMAL)]
    unit: Annotated[str, Child("unit", STRING)]
    time: Time = None
    uncertainty: Annotated[
        Expanded | Interval | Univariate | None,
        Choice(("expandedUnc", "coverageInterval", "measurementUncertaintyUnivariate")),
    ] = None


class Constant(_Si):
    """A constant (``constantQuantityType``); its uncertainty is a standard uncertainty."""

    label: Label = None
    value: Annotated[Decimal, Child("value", DECIMAL)]
    unit: Annotated[str, Child("unit", STRING)]
    time: Time = None
    uncertainty: Annotated[Decimal | None, Child("uncertainty", UNCERTAINTY)] = None
    distribution: Distribution = None


class CovarianceElement(_Si):
    """An element of a covariance matrix."""

    value: Annotated[Decimal, Child("value", DECIMAL)]
    unit: Annotated[str, Child("unit", STRING)]


class CovarianceColumn(_Si):
    """A column of a covariance matrix."""

    covariances: Annotated[tuple[CovarianceElement, ...], Many("covariance")]


class Region(_Si):
    """A region of several values together (``ellipsoidalRegionType``, ``rectangularRegionType``)."""

    columns: Annotated[tuple[CovarianceColumn, ...], Many("column", within="covarianceMatrix")]
    factor: Annotated[Decimal, Child("coverageFactor", FACTOR)]
    probability: Annotated[Decimal, Child("coverageProbability", PROBABILITY)]
    distribution: Distribution = None


class EllipsoidalRegion(Region):
    """An ellipsoid."""


class RectangularRegion(Region):
    """A rectangular region."""


class Complex(_Si):
    """A complex value (``complexQuantityType``), by its parts or by magnitude and phase."""

    label: Label = None
    real: Annotated[Decimal | None, Child("valueReal", DECIMAL)] = None
    imaginary: Annotated[Decimal | None, Child("valueImag", DECIMAL)] = None
    magnitude: Annotated[Decimal | None, Child("valueMagnitude", DECIMAL)] = None
    phase: Annotated[Decimal | None, Child("valuePhase", DECIMAL)] = None
    unit: Annotated[str | None, Child("unit", STRING)] = None
    phase_unit: Annotated[str | None, Child("unitPhase", STRING)] = None
    time: Time = None
    region: Annotated[
        EllipsoidalRegion | RectangularRegion | None, Choice(("ellipsoidalRegion", "rectangularRegion"))
    ] = None


class ExpandedList(_Si):
    """Expanded uncertainties of a list: one a value, or one for all."""

    uncertainties: Annotated[Decimals, Child("uncertaintyXMLList", UNCERTAINTIES)]
    factors: Annotated[Decimals, Child("coverageFactorXMLList", FACTORS)]
    probabilities: Annotated[Decimals, Child("coverageProbabilityXMLList", PROBABILITIES)]
    distributions: Distributions = ()


class IntervalList(_Si):
    """Coverage intervals of a list."""

    standards: Annotated[Decimals, Child("standardUncXMLList", UNCERTAINTIES)]
    lows: Annotated[Decimals, Child("intervalMinXMLList", DECIMALS)]
    highs: Annotated[Decimals, Child("intervalMaxXMLList", DECIMALS)]
    probabilities: Annotated[Decimals, Child("coverageProbabilityXMLList", PROBABILITIES)]
    distributions: Distributions = ()


class ExpandedListMU(_Si):
    """Expanded uncertainties of a list (D-SI 2.2)."""

    uncertainties: Annotated[Decimals, Child("valueExpandedMUXMLList", UNCERTAINTIES)]
    factors: Annotated[Decimals, Child("coverageFactorXMLList", FACTORS)]
    probabilities: Annotated[Decimals, Child("coverageProbabilityXMLList", PROBABILITIES)]
    distributions: Distributions = ()


class StandardListMU(_Si):
    """Standard uncertainties of a list (D-SI 2.2)."""

    standards: Annotated[Decimals, Child("valueStandardMUXMLList", UNCERTAINTIES)]
    distributions: Distributions = ()


class UnivariateList(_Si):
    """Uncertainties of the values of a list, each by itself (D-SI 2.2)."""

    stated: Annotated[StandardListMU | ExpandedListMU, Choice(("standardMUXMLList", "expandedMUXMLList"))]


class RealList(_Si):
    """Values with their units (``realListXMLListType``): a unit a value, or one for all."""

    labels: Annotated[tuple[str, ...], Child("labelXMLList", STRINGS)] = ()
    values: Annotated[Decimals, Child("valueXMLList", DECIMALS)]
    units: Annotated[tuple[str, ...], Child("unitXMLList", STRINGS)]
    times: Annotated[tuple[dt.datetime, ...], Child("dateTimeXMLList", DATE_TIMES)] = ()
    uncertainty: Annotated[
        ExpandedList | IntervalList | UnivariateList | None,
        Choice(("expandedUncXMLList", "coverageIntervalXMLList", "measurementUncertaintyUnivariateXMLList")),
    ] = None
    region: Annotated[
        EllipsoidalRegion | RectangularRegion | None, Choice(("ellipsoidalRegionXMLList", "rectangularRegionXMLList"))
    ] = None


class ListUncertainty(_Si):
    """Uncertainty of every value of a list alike (``listUnivariateUncType``)."""

    stated: Annotated[Expanded | Interval, Choice(("expandedUnc", "coverageInterval"))]


class RealInList(_Si):
    """A value in a list; its unit may be the list's."""

    label: Label = None
    value: Annotated[Decimal, Child("value", DECIMAL)]
    unit: Annotated[str | None, Child("unit", STRING)] = None
    time: Time = None
    uncertainty: Annotated[Expanded | Interval | None, Choice(("expandedUnc", "coverageInterval"))] = None


class Reals(_Si):
    """Values one by one (``realListType``)."""

    label: Label = None
    time: Time = None
    unit: Annotated[str | None, Child("listUnit", STRING)] = None
    uncertainty: Annotated[ListUncertainty | None, Child("listUnivariateUnc")] = None
    values: Annotated[tuple[RealInList, ...], Many("real")]
    region: Annotated[
        EllipsoidalRegion | RectangularRegion | None, Choice(("ellipsoidalRegion", "rectangularRegion"))
    ] = None


class Bivariate(_Si):
    """Region of every value of a list alike (``listBivariateUncType``)."""

    region: Annotated[
        EllipsoidalRegion | RectangularRegion | None, Choice(("ellipsoidalRegion", "rectangularRegion"))
    ] = None


class Complexes(_Si):
    """Complex values one by one (``complexListType``)."""

    label: Label = None
    time: Time = None
    unit: Annotated[str | None, Child("listUnit", STRING)] = None
    phase_unit: Annotated[str | None, Child("listUnitPhase", STRING)] = None
    uncertainty: Annotated[Bivariate | None, Child("listBivariateUnc")] = None
    values: Annotated[tuple[Complex, ...], Many("complex")]
    region: Annotated[
        EllipsoidalRegion | RectangularRegion | None, Choice(("ellipsoidalRegion", "rectangularRegion"))
    ] = None


class Lists(_Si):
    """Lists of lists (``listType`` of D-SI)."""

    label: Label = None
    time: Time = None
    lists: Annotated[tuple[Reals | Complexes | Lists, ...], Choice(("realList", "complexList", "list"), many=True)]


class Hybrid(_Si):
    """The same quantity in several units (``hybridType``); the first is that of the certificate."""

    values: Annotated[
        tuple[Real | Complex | Lists | Reals | RealList | Complexes | Constant, ...],
        Choice(("real", "complex", "list", "realList", "realListXMLList", "complexList", "constant"), many=True),
    ]
