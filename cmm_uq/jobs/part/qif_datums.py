"""Datums of QIF plans and models: simple and common ones, by the features that they are on."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from xml.etree.ElementTree import Element

from cmm_uq.jobs.importing.qif import child
from cmm_uq.jobs.importing.xml_files import local
from cmm_uq.jobs.part.common import BETWEEN
from cmm_uq.jobs.part.drawing import Facts, NotUnderstoodError
from cmm_uq.jobs.part.qif_elements import inside, numbers_in, referred

_PLAIN = ("", "NONE", "REGARDLESS", "NOT_APPLICABLE")
_ORDER = ("PRIMARY", "SECONDARY", "TERTIARY")


def is_plain(condition: str) -> bool:
    """Whether a material condition leaves a tolerance or a datum as it is."""
    return condition in _PLAIN


def datums_of(
    frame: Element | None, by_id: Mapping[str, Element], of_nominal: Mapping[str, str], features: Sequence[Facts]
) -> list[str]:
    """Names of the features of a datum reference frame, in order of precedence; of a common datum with hyphens between them.

    Parameters
    ----------
    frame : the DatumReferenceFrame.
    by_id : elements of the document.
    of_nominal : names of features that are read, by the number of their nominal.
    features : that are read.

    Raises
    ------
    NotUnderstoodError : a datum is none that is read.
    """
    listed = (
        [] if frame is None else [each for group in frame for each in (group if local(group) == "Datums" else (group,))]
    )
    given = [each for each in listed if local(each) == "Datum"]
    found: list[str] = []
    for datum in sorted(given, key=_precedence):
        common = inside(datum, "CompoundDatum")
        parts = [datum] if common is None else [each for each in common if local(each) == "Datum"]
        found.append(BETWEEN.join(_simple(each, by_id, of_nominal, features) for each in parts))
    return found


def _precedence(datum: Element) -> int:
    given = inside(datum, "Precedence")
    word = "" if given is None else "".join(given.itertext()).strip()
    return _ORDER.index(word) if word in _ORDER else len(_ORDER)


def _simple(
    datum: Element, by_id: Mapping[str, Element], of_nominal: Mapping[str, str], features: Sequence[Facts]
) -> str:
    simple = inside(datum, "SimpleDatum")
    if simple is None:
        raise NotUnderstoodError("has a datum of a kind that is not read")
    condition = child(simple, "MaterialModifier")
    if not is_plain(condition):
        raise NotUnderstoodError(f"has a datum at {condition.lower()} material condition, which is not modelled")
    definition = referred(simple, "DatumDefinitionId", by_id)
    label = child(definition, "DatumLabel")
    if inside(definition, "DatumTargetIds") is not None:
        raise NotUnderstoodError(f"is about the datum {label} on datum targets, which are not read")
    named = numbers_in(inside(definition, "FeatureNominalIds"))
    if named and all(number in of_nominal for number in named):
        return BETWEEN.join(of_nominal[number] for number in named)
    pattern = re.compile(rf"(datum[ _-]?)?{re.escape(label)}", re.IGNORECASE)
    same = [one["name"] for one in features if pattern.fullmatch(one["name"])]
    if named or len(same) != 1:
        raise NotUnderstoodError(f"is about the datum {label}, which names no feature that is read")
    return str(same[0])
