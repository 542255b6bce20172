"""QIF plans: nominal features, tolerances and datums by what they refer to; the rest by name.

Documents as the schema of QIF 3.0 has them, of one plate; its numbers were chosen so that none is another's.
"""

from __future__ import annotations

import math
import re
from contextlib import suppress
from typing import Any

import pytest
from hypothesis import given, strategies as st

from cmm_uq.base.errors import CmmUqError
from cmm_uq.jobs.part.drawing import Drawing
from cmm_uq.jobs.part.qif import drawing_of_qif

UNITS = """<FileUnits><PrimaryUnits>
<AngularUnit><SIUnitName>radian</SIUnitName><UnitName>degree</UnitName>
<UnitConversion><Factor>0.017453292519943295</Factor></UnitConversion></AngularUnit>
<LinearUnit><SIUnitName>meter</SIUnitName><UnitName>{unit}</UnitName>
<UnitConversion><Factor>{factor}</Factor></UnitConversion></LinearUnit></PrimaryUnits></FileUnits>"""
DATUMS = """<DatumDefinitions n="2">
<DatumDefinition id="1"><DatumLabel>A</DatumLabel></DatumDefinition>
<DatumDefinition id="2"><DatumLabel>B</DatumLabel><FeatureNominalIds n="1"><Id>121</Id></FeatureNominalIds></DatumDefinition>
</DatumDefinitions>
<DatumReferenceFrames n="2"><DatumReferenceFrame id="3"><Datums n="1"><Datum><SimpleDatum>
<DatumDefinitionId>1</DatumDefinitionId><MaterialModifier>NONE</MaterialModifier></SimpleDatum></Datum></Datums>
</DatumReferenceFrame>
<DatumReferenceFrame id="4"><Datums n="2">
<Datum><SimpleDatum><DatumDefinitionId>1</DatumDefinitionId><MaterialModifier>NONE</MaterialModifier></SimpleDatum></Datum>
<Datum><SimpleDatum><DatumDefinitionId>2</DatumDefinitionId><MaterialModifier>{modifier}</MaterialModifier></SimpleDatum></Datum>
</Datums></DatumReferenceFrame></DatumReferenceFrames>"""


def feature(
    number: int, kind: str, name: str, nominal: str, definition: str = "", more: str = ""
) -> tuple[str, str, str]:
    return (
        f'<{kind}FeatureDefinition id="{100 + number}">{definition}</{kind}FeatureDefinition>',
        f'<{kind}FeatureNominal id="{120 + number}"><FeatureDefinitionId>{100 + number}</FeatureDefinitionId>{nominal}'
        f"</{kind}FeatureNominal>",
        f'<{kind}FeatureItem id="{140 + number}"><FeatureNominalId>{120 + number}</FeatureNominalId>'
        f"<FeatureName>{name}</FeatureName><DeterminationMode>{more}</DeterminationMode></{kind}FeatureItem>",
    )


def characteristic(
    number: int, kind: str, name: str, features: list[int], definition: str, nominal: str = ""
) -> tuple[str, str, str]:
    ids = "".join(f"<Id>{140 + one}</Id>" for one in features)
    return (
        f'<{kind}CharacteristicDefinition id="{200 + number}">{definition}</{kind}CharacteristicDefinition>',
        f'<{kind}CharacteristicNominal id="{220 + number}"><CharacteristicDefinitionId>{200 + number}'
        f"</CharacteristicDefinitionId>{nominal}</{kind}CharacteristicNominal>",
        f'<{kind}CharacteristicItem id="{240 + number}"><Name>{name}</Name><FeatureItemIds n="{len(features)}">{ids}'
        f"</FeatureItemIds><CharacteristicNominalId>{220 + number}</CharacteristicNominalId></{kind}CharacteristicItem>",
    )


def tolerance(low: float, high: float, *, limit: bool = False) -> str:
    said = "true" if limit else "false"
    limits = f"<MaxValue>{high}</MaxValue><MinValue>{low}</MinValue>"
    return f"<Tolerance>{limits}<DefinedAsLimit>{said}</DefinedAsLimit></Tolerance>"


def zone(width: float, frame: int | None = None, more: str = "") -> str:
    about = f"<DatumReferenceFrameId>{frame}</DatumReferenceFrameId>" if frame else ""
    return f"<ToleranceValue>{width}</ToleranceValue>{about}{more}"


HOLE = "<InternalExternal>INTERNAL</InternalExternal><Diameter>9.5</Diameter>"
FEATURES = [
    feature(0, "Plane", "DATUM_A", "<Location>1 2 3</Location><Normal>0 0 1</Normal>"),
    feature(1, "Cylinder", "pin", "<Axis><AxisPoint>10 20 30</AxisPoint><Direction>0 0 -1</Direction></Axis>",
            HOLE.replace("INTERNAL", "EXTERNAL") + "<Length>8</Length>"),
    feature(2, "Circle", "hole", "<Location>4 5 6</Location><Normal>0 0 1</Normal>", HOLE),
    feature(3, "Cone", "sink", "<Axis><AxisPoint>0 0 0</AxisPoint><Direction>0 0 1</Direction></Axis>",
            HOLE + "<HalfAngle>41</HalfAngle>"),
    feature(4, "Point", "stop", "<Location>7 8 9</Location><Normal>-1 0 0</Normal>"),
    feature(5, "Circle", "ring", "<SubstituteFeatureAlgorithm><SubstituteFeatureAlgorithmEnum>MAXINSCRIBED"
            "</SubstituteFeatureAlgorithmEnum></SubstituteFeatureAlgorithm><Location>4 5 6</Location>"
            "<Normal>0 0 1</Normal>", HOLE),
]  # fmt: skip
CHARACTERISTICS = [
    characteristic(0, "Flatness", "1", [0], zone(0.25)),
    characteristic(1, "Diameter", "2", [2], tolerance(-0.1, 0.2), "<TargetValue>9.5</TargetValue>"),
    characteristic(2, "Diameter", "3", [1], tolerance(9.4, 9.6, limit=True)),
    characteristic(3, "Position", "4", [2], zone(0.5, 4, "<MaterialCondition>NONE</MaterialCondition>"
                                                 "<ZoneShape><DiametricalZone/></ZoneShape>")),
    characteristic(4, "Perpendicularity", "5", [1], zone(0.05, 3)),
    characteristic(5, "DistanceBetween", "6", [0, 4], tolerance(-0.5, 0.5), "<TargetValue>6</TargetValue>"),
    characteristic(6, "LinearCoordinate", "7", [4], "<NonTolerance>MEASURED</NonTolerance>", "<Direction>YAXIS</Direction>"),
]  # fmt: skip


def document(
    *further: tuple[str, str, str],
    unit: tuple[str, str] = ("mm", "0.001"),
    modifier: str = "NONE",
    kind: str = "Features",
) -> bytes:
    features, asked = list(FEATURES), list(CHARACTERISTICS)
    (features if kind == "Features" else asked).extend(further)
    parts = [UNITS.format(unit=unit[0], factor=unit[1]), DATUMS.format(modifier=modifier)]
    for what, table in (("Feature", features), ("Characteristic", asked)):
        definitions, nominals, items = ("".join(column) for column in zip(*table, strict=True))
        parts.append(
            f"<{what}s><{what}Definitions>{definitions}</{what}Definitions><{what}Nominals>{nominals}</{what}Nominals>"
            f"<{what}Items>{items}</{what}Items></{what}s>"
        )
    return f'<QIFDocument xmlns="http://qifstandards.org/xsd/qif3" versionQIF="3.0.0">{"".join(parts)}</QIFDocument>'.encode()


def read(*further: tuple[str, str, str], **keys: Any) -> Drawing:
    return drawing_of_qif(document(*further, **keys), "plate.qif")


def named(tables: list[dict[str, Any]]) -> dict[str, dict[str, Any]]:
    return {one["name"]: one for one in tables}


def test_features_are_where_their_nominals_say() -> None:
    found = read()
    assert not found.unknown
    one = named(found.features)
    assert (one["DATUM_A"]["point_mm"], one["DATUM_A"]["direction"]) == ([1, 2, 3], [0, 0, 1])
    # from the start of the axis half of its length along it
    assert (one["pin"]["point_mm"], one["pin"]["length_mm"], one["pin"]["inner"]) == ([10, 20, 26], 8, False)
    assert (one["hole"]["diameter_mm"], one["hole"]["inner"]) == (9.5, True)
    assert one["sink"]["angle_deg"] == pytest.approx(82)
    # no end is said: half of the diameter along the axis, with the point in its middle and the diameter there
    assert one["sink"]["point_mm"] == pytest.approx([0, 0, 9.5 / 4])
    assert one["sink"]["diameter_mm"] == pytest.approx(9.5 + 2 * 9.5 / 4 * math.tan(math.radians(41)))
    assert one["stop"] == {"name": "stop", "kind": "point", "point_mm": [7, 8, 9], "direction": [-1, 0, 0]}
    assert one["ring"]["association"] == "maximum_inscribed"


def test_tolerances_datums_and_limits_are_those_that_are_referred_to() -> None:
    assert read().characteristics == [
        {"name": "1", "what": "flatness", "features": ["DATUM_A"], "tolerance_mm": 0.25},
        {"name": "2", "what": "size", "features": ["hole"], "lower_mm": 9.4, "upper_mm": 9.7},
        {"name": "3", "what": "size", "features": ["pin"], "lower_mm": 9.4, "upper_mm": 9.6},
        {"name": "4", "what": "position", "features": ["hole"], "datums": ["DATUM_A", "pin"], "tolerance_mm": 0.5},
        {"name": "5", "what": "perpendicularity", "features": ["pin"], "datums": ["DATUM_A"], "tolerance_mm": 0.05},
        {"name": "6", "what": "distance", "features": ["DATUM_A", "stop"], "lower_mm": 5.5, "upper_mm": 6.5},
        {"name": "7", "what": "y", "features": ["stop"]},
    ]


@pytest.mark.parametrize(("diameter", "ends", "middle", "length"), [
    ("0", "<LargeEndDistance>8</LargeEndDistance>", 4, 8),
    ("10", "<LargeEndDistance>8</LargeEndDistance><SmallEndDistance>2</SmallEndDistance>", 5, 6),
    ("10", "<LargeEndDistance>5</LargeEndDistance>", 0, 10),  # at 45° its tip lies 5 mm behind its point
])  # fmt: skip
def test_a_cone_is_told_between_its_ends(diameter: str, ends: str, middle: float, length: float) -> None:
    definition = HOLE.replace("9.5", diameter) + "<FullAngle>90</FullAngle>" + ends
    cone = feature(6, "Cone", "c", "<Axis><AxisPoint>0 0 0</AxisPoint><Direction>0 0 1</Direction></Axis>", definition)
    found = named(read(cone).features)["c"]
    assert found["point_mm"][2] == pytest.approx(middle, abs=1e-9)
    assert found["length_mm"] == pytest.approx(length)
    assert found["diameter_mm"] == pytest.approx(float(diameter) + 2 * middle)  # at 45° as much wider as farther


def test_what_the_plan_leaves_open_is_an_example() -> None:
    opened = read().open_keys
    assert set(opened["DATUM_A"]) == {"strategy", "length_mm", "width_mm"}
    assert opened["pin"] == ["strategy"]
    assert "stop" not in opened


def test_inches_become_millimetres_and_not_degrees() -> None:
    found = read(unit=("inch", "0.0254"))
    assert named(found.features)["pin"]["point_mm"] == pytest.approx([254, 508, 660.4])
    assert named(found.features)["sink"]["angle_deg"] == pytest.approx(82)
    assert named(found.characteristics)["2"]["upper_mm"] == pytest.approx(9.7 * 25.4)


SLOT = feature(6, "OppositeParallelLines", "slot", "")
NO_SIDE = feature(6, "Circle", "open", "<Location>4 5 6</Location><Normal>0 0 1</Normal>", "<Diameter>3</Diameter>")
MADE = feature(6, "Point", "made", "<Location>4 5 6</Location><Normal>0 0 1</Normal>", "", "<Constructed/>")
NURBS = feature(6, "Plane", "bent", "<SubstituteFeatureAlgorithm>NURBS</SubstituteFeatureAlgorithm>")
MAXIMUM = "<MaterialCondition>MAXIMUM</MaterialCondition>"
PROJECTED = "<ProjectedToleranceZoneValue>12</ProjectedToleranceZoneValue>"
STATISTICAL = "<StatisticalCharacteristic>true</StatisticalCharacteristic>"
ELONGATED = "<ZoneShape><DiametricalZone><ElongatedZone>true</ElongatedZone></DiametricalZone></ZoneShape>"
ASSOCIATED = """<SubstituteFeatureAlgorithm><SubstituteFeatureAlgorithmEnum>{}</SubstituteFeatureAlgorithmEnum>
</SubstituteFeatureAlgorithm>"""
*_OF, ITEM = characteristic(7, "Diameter", "8", [2], tolerance(9, 10, limit=True))
OF_ITS_OWN = (*_OF, ITEM.replace("<CharacteristicNom", ASSOCIATED.format("MAXINSCRIBED") + "<CharacteristicNom"))
SCAN = feature(8, "Circle", "scan", "<Location>4 5 6</Location><Normal>0 0 1</Normal>", HOLE,
               "<Constructed><FromScan/></Constructed>")  # fmt: skip


@pytest.mark.parametrize(("kind", "item", "name", "why"), [
    ("Features", SLOT, "slot", "is a feature of kind OppositeParallelLines"),
    ("Features", NO_SIDE, "open", "does not say whether it is a hole or a shaft"),
    ("Features", MADE, "made", "is constructed of other features"),
    ("Features", NURBS, "bent", "is to be associated by NURBS"),
    ("Asked", characteristic(7, "PointProfile", "8", [4], zone(1.0)), "8", "is the profile of a surface at a point"),
    ("Asked", characteristic(7, "Position", "8", [2], zone(0.5, 4, MAXIMUM)), "8", "holds at maximum material condition"),
    ("Asked", characteristic(7, "Position", "8", [2], zone(0.0, 4)), "8", "has no tolerance above 0"),
    ("Asked", characteristic(7, "SurfaceProfile", "8", [0], zone(0.5)), "8", "is the profile of a surface,"),
    ("Asked", characteristic(7, "LineProfile", "8", [0], zone(0.5)), "8", "is the profile of a line, which is not"),
    ("Asked", characteristic(7, "Flatness", "8", [0], zone(0.5, None, "<FreeState>true</FreeState>")), "8", "the free state"),
    ("Asked", characteristic(7, "Flatness", "8", [0], zone(0.5, None, "<ToleranceZonePerUnitArea/>")), "8", "per unit of"),
    ("Asked", characteristic(7, "Position", "8", [2], zone(0.5, 4, PROJECTED)), "8", "has a projected tolerance zone"),
    ("Asked", characteristic(7, "Flatness", "8", [0], zone(0.5, None, "<Unheard>1</Unheard>")), "8", "says Unheard, which is"),
    ("Features", SCAN, "scan", "is scanned: what scanning adds"),
    ("Asked", characteristic(7, "Flatness", "8", [1], zone(0.5)), "8", "is a flatness of a cylinder, which is not read"),
    ("Asked", characteristic(7, "Parallelism", "8", [1], zone(0.5)), "8", "names no datum"),
    ("Asked", characteristic(7, "DistanceBetween", "8", [0], tolerance(-1, 1)), "8", "is a distance of 1 features"),
    ("Asked", characteristic(7, "Flatness", "8", [9], zone(0.5)), "8", "is of the feature '149', which is not read"),
    ("Asked", characteristic(7, "Diameter", "8", [2], tolerance(-0.1, 0.1)), "8", "limits about a value that is not there"),
    ("Asked", characteristic(7, "Flatness", "8", [0], "<ToleranceValue>wide</ToleranceValue>"), "8",
     "has 'wide' where a number"),
    ("Asked", characteristic(7, "Position", "8", [2], zone(0.5, 4, "<ZoneShape><NonDiametricalZone/></ZoneShape>")), "8",
     "zone of shape NonDiametricalZone"),
    ("Asked", characteristic(7, "AngleBetween", "8", [0, 1], tolerance(-1, 1),
                             "<AnalysisMode>TWODIMENSIONAL</AnalysisMode><TargetValue>0</TargetValue>"), "8",
     "is an angle in the analysis TWODIMENSIONAL"),
    ("Asked", characteristic(7, "Flatness", "8", [0], zone(0.5, None, STATISTICAL)), "8", "is a statistical tolerance"),
    ("Asked", characteristic(7, "Position", "8", [2], zone(0.5, 4, ELONGATED)), "8", "says ElongatedZone, which is"),
    ("Asked", OF_ITS_OWN, "8", "has an association of its own"),
    ("Features", feature(8, "Plane", "set", "<Location>1 2 3</Location><Normal>0 0 1</Normal>", more="<Set/>"), "set",
     "is set, not measured"),
    ("Asked", characteristic(7, "Position", "8", [2], zone(0.5, 99)), "8", "DatumReferenceFrameId to nothing that is there"),
])  # fmt: skip
def test_what_is_not_understood_is_told_by_name(kind: str, item: tuple[str, str, str], name: str, why: str) -> None:
    found = read(item, kind=kind)
    with pytest.raises(CmmUqError, match=why) as raised:
        found.settled([], "plate.qif")
    assert f"'{name}'" in raised.value.problem
    assert found.settled([name], "plate.qif") == [name]
    assert len(found.characteristics) == len(CHARACTERISTICS)
    assert len(found.features) == len(FEATURES)


def test_a_datum_at_maximum_material_condition_is_not_understood() -> None:
    found = read(modifier="MAXIMUM")
    assert [one.name for one in found.unknown] == ["4"]
    assert "has a datum at maximum material condition" in found.unknown[0].why


@pytest.mark.parametrize("more", [
    "<DatumTranslation><DatumTranslationAllowed>true</DatumTranslationAllowed></DatumTranslation>",
    "<DegreesOfFreedom><DegreeOfFreedom>Z</DegreeOfFreedom></DegreesOfFreedom>", "<ReducedDatum>PT</ReducedDatum>",
    "<ConstrainOrientation>true</ConstrainOrientation>", "<DistanceVariable>true</DistanceVariable>",
])  # fmt: skip
def test_what_alters_a_datum_is_not_understood(more: str) -> None:
    """A datum that fixes less, or something else, than its feature; the same switched off is none."""
    found = read(modifier=f"NONE</MaterialModifier>{more}<MaterialModifier>NONE")
    assert [one.name for one in found.unknown] == ["4"]
    assert f"says {more[1:].partition('>')[0]}, which is not read" in found.unknown[0].why
    off = read(modifier=f"NONE</MaterialModifier>{more.replace('true', 'false')}<MaterialModifier>NONE")
    assert bool(off.unknown) != ("true" in more)


def test_an_exact_or_auxiliary_dimension_is_not_toleranced() -> None:
    said = tolerance(9, 10, limit=True) + "<DimensionType>{}</DimensionType>"
    for sort in ("BASIC_OR_TED", "REFERENCE_OR_AUXILIARY"):
        found = read(characteristic(7, "Diameter", "8", [2], said.format(sort)), kind="Asked")
        assert found.characteristics[-1] == {"name": "8", "what": "size", "features": ["hole"]}


def test_the_association_of_an_item_goes_before_that_of_its_nominal() -> None:
    nominal = "<Location>4 5 6</Location><Normal>0 0 1</Normal>"
    definition, of, item = feature(8, "Circle", "own", nominal + ASSOCIATED.format("LEASTSQUARES"), HOLE)
    item = item.replace("<DeterminationMode>", ASSOCIATED.format("MAXINSCRIBED") + "<DeterminationMode>")
    assert read((definition, of, item), kind="Features").features[-1]["association"] == "maximum_inscribed"


def test_without_units_there_are_no_lengths() -> None:
    bare = document().replace(b"LinearUnit", b"OtherUnit")
    with pytest.raises(CmmUqError, match="does not say its unit of length"):
        drawing_of_qif(bare, "plate.qif")
    parted = bare.replace(b"</QIFDocument>", b'<ExternalQIFReferences n="1"/></QIFDocument>')
    with pytest.raises(CmmUqError, match="refers to other QIF documents, which are not read"):
        drawing_of_qif(parted, "plate.qif")


def test_a_unit_without_its_factor_is_the_metre_and_no_inch() -> None:
    """QIF: a unit without ``UnitConversion`` is that of the SI, whatever its name."""
    without = re.sub(rb"<Factor>[^<]*</Factor>", b"", document(unit=("inch", "0.0254")))
    with pytest.raises(CmmUqError, match="'inch' has no Factor to metres"):
        drawing_of_qif(without, "plate.qif")


def test_statistics_and_rules_plan_no_feature() -> None:
    with pytest.raises(CmmUqError, match="is of no feature"):
        drawing_of_qif(b'<QIFDocument xmlns="http://qifstandards.org/xsd/qif3"/>', "rules.qif")


@given(at=st.integers(0, 20_000), cut=st.integers(0, 12), put=st.sampled_from(["", "9", "x", "nan", "1e999", " 1"]))
def test_a_damaged_plan_is_read_or_refused_in_words(at: int, cut: int, put: str) -> None:
    text = document().decode()
    at %= len(text)
    with suppress(CmmUqError):
        found = drawing_of_qif((text[:at] + put + text[at + cut :]).encode(), "plate.qif")
        found.settled(["*"], "plate.qif")
        assert found.features
        assert found.characteristics


COMMON = """<DatumReferenceFrame id="5"><Datums n="2">
<Datum><SimpleDatum><DatumDefinitionId>1</DatumDefinitionId></SimpleDatum><Precedence><PrecedenceEnum>SECONDARY</PrecedenceEnum>
</Precedence></Datum>
<Datum><CompoundDatum n="2">
<Datum><SimpleDatum><DatumDefinitionId>2</DatumDefinitionId></SimpleDatum><SequenceNumber>1</SequenceNumber></Datum>
<Datum><SimpleDatum><DatumDefinitionId>6</DatumDefinitionId></SimpleDatum></Datum>
</CompoundDatum><Precedence><PrecedenceEnum>PRIMARY</PrecedenceEnum></Precedence></Datum></Datums></DatumReferenceFrame>
<DatumDefinition id="6"><DatumLabel>C</DatumLabel><FeatureNominalIds><Id>122</Id></FeatureNominalIds></DatumDefinition>"""


def test_a_compound_datum_is_a_common_one_and_datums_stand_by_their_precedence() -> None:
    whole = document(characteristic(7, "Position", "8", [5], zone(0.5, 5)), kind="Asked").decode()
    found = drawing_of_qif(
        whole.replace("</DatumReferenceFrames>", COMMON + "</DatumReferenceFrames>").encode(), "plate.qif"
    )
    assert not found.unknown
    assert found.characteristics[-1]["datums"] == ["pin-hole", "DATUM_A"]


def test_a_value_may_name_a_unit_of_its_own() -> None:
    """A tolerance of half an inch in a plan in mm; an unexplained unit is told."""
    width = '<ToleranceValue linearUnit="{}">0.5</ToleranceValue>'
    found = read(characteristic(7, "Flatness", "8", [0], width.format("inch")), kind="Asked")
    assert found.characteristics[-1]["tolerance_mm"] == pytest.approx(12.7)
    strange = read(characteristic(7, "Flatness", "8", [0], width.format("cubit")), kind="Asked")
    assert [one.why for one in strange.unknown] == ["has the unit 'cubit', which the document does not explain"]


def test_a_model_with_product_information_gives_what_its_datums_and_tolerances_are_of() -> None:
    """Without items that plan a measurement: nominals, each of a pattern on its own; datum features by label."""
    hole = "<Location>{} 5 6</Location><Normal>0 0 1</Normal>"
    ids = "<Name>holes</Name><FeatureNominalIds><Id>122</Id><Id>129</Id></FeatureNominalIds><TargetValue>9.5</TargetValue>"
    features = [*FEATURES, feature(9, "Circle", "", hole.format(40), HOLE)]
    asked = characteristic(7, "Diameter", "", [], tolerance(-0.1, 0.1), ids)
    parts = [UNITS.format(unit="mm", factor="0.001"), DATUMS.format(modifier="NONE")]
    parts += [text for definition, nominal, _ in [*features, asked] for text in (definition, nominal)]
    found = drawing_of_qif(f"<QIFDocument>{''.join(parts)}</QIFDocument>".encode(), "model.qif")
    assert not found.unknown
    assert [(one["name"], one["kind"]) for one in found.features] == [
        ("B", "cylinder"), ("feature 122", "circle"), ("feature 129", "circle")]  # fmt: skip
    assert [(one["name"], one["features"]) for one in found.characteristics] == [
        ("holes 122", ["feature 122"]), ("holes 129", ["feature 129"])]  # fmt: skip


@pytest.mark.parametrize(
    ("angle", "read_so"), [("60", True), ("120", True), ("30", True), ("", True), ("45", False), ("61", False)]
)
def test_a_basic_angle_that_is_not_that_of_the_nominals_is_refused(angle: str, *, read_so: bool) -> None:
    """It was evaluated at the angle of the nominal features, 60°, whatever the characteristic says."""
    said = f"<Angle>{angle}</Angle>" * bool(angle)
    slope = feature(6, "Plane", "slope", f"<Location>0 0 0</Location><Normal>{3**0.5 / 2} 0 0.5</Normal>")
    asked = characteristic(7, "Angularity", "8", [6], said + zone(0.1, 3))
    FEATURES.append(slope)
    try:
        found = read(asked, kind="Characteristics")
    finally:
        FEATURES.remove(slope)
    assert ("8" in named(found.characteristics)) == read_so
    assert [one.why for one in found.unknown] == ([] if read_so else [
        f"is an angularity of {angle}°, and its nominal features stand at 60°"
    ])  # fmt: skip
