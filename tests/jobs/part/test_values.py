"""Values of a report are found by their names, in mm and degrees, and told with their line where they are wrong.

The layout of the PC-DMIS report is that of public ones (ddatainfo/conversion), that of QIF of the samples of its community.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from cmm_uq.base.errors import CmmUqError
from cmm_uq.jobs.part.job import TABLES
from cmm_uq.jobs.part.values import Reported
from tests.jobs.part.parts import plate
from tests.jobs.part.test_qif import UNITS

PCDMIS = """DATE=20-Nov-26                       TIME=10:04:11 AM
PART NAME  : PLATE

DIM LOC1= LOCATION OF CYLINDER BORE  UNITS=MM
AX    NOMINAL       +TOL       -TOL       MEAS        DEV     OUTTOL
X       60.000      0.050      0.050     60.015      0.015      0.000 ------#--
Y       40.000      0.050      0.050     39.991     -0.009      0.000 ----#----
D       30.000      0.050      0.050     30.011      0.011      0.000 ----#----
PART NUMBER=PLATE    DATE=20-Nov-26     TIME=10:04:11 AM           PAGE#=2
#7FCFLOC1 = POSITION OF BORE          FIT TO DATUMS=ON  DEV PERPEN CENTERLINE=ON  UNITS=MM
AX    NOMINAL       +TOL       -TOL      BONUS       MEAS         DEV     OUTTOL
X       60.000                                     60.015       0.015
Y       40.000                                     39.991      -0.009
D1                                                        PLANE A AT RFS
TP        RFS      0.100                 0.000      0.036       0.036      0.000 --#------
DIM DIST1= 3D DISTANCE FROM CYLINDER BORE TO PLANE B,SHORTEST=OFF,NO_RADIUS  UNITS=IN
AX    NOMINAL       +TOL       -TOL       MEAS        DEV     OUTTOL
M      1.57480    0.00200    0.00200    1.57445   -0.00035    0.00000 ----#----
DIM ANGL1= 3D ANGLE FROM PLANE A TO PLANE B
AX    NOMINAL       +TOL       -TOL       MEAS        DEV     OUTTOL
A    90°00'00"   0°30'00"   0°30'00"  89°59'42"  -0°00'18"   0°00'00" ----#----
"""
ANGLE = {"name": "6", "what": "angle", "features": ["A", "B"]}
QIF = f"""<?xml version="1.0" encoding="UTF-8"?>
<QIFDocument xmlns="http://qifstandards.org/xsd/qif3" versionQIF="3.0.0">{UNITS}
<Features><FeatureNominals n="1"><CylinderFeatureNominal id="30">
<SubstituteFeatureAlgorithm><SubstituteFeatureAlgorithmEnum>HOW</SubstituteFeatureAlgorithmEnum></SubstituteFeatureAlgorithm>
</CylinderFeatureNominal></FeatureNominals>
<FeatureItems n="1"><CylinderFeatureItem id="45"><FeatureNominalId>30</FeatureNominalId><FeatureName>bore</FeatureName>
</CylinderFeatureItem></FeatureItems></Features>
<Characteristics><CharacteristicItems n="2">
<DiameterCharacteristicItem id="49"><Name>DIAM_B</Name><CharacteristicDesignator><Designator>1</Designator>
</CharacteristicDesignator></DiameterCharacteristicItem>
<AngleBetweenCharacteristicItem id="50"><Name>6</Name></AngleBetweenCharacteristicItem>
</CharacteristicItems></Characteristics>
<MeasurementsResults><MeasurementResultsSet><MeasurementResults id="217"><MeasuredFeatures n="1">
<CylinderFeatureMeasurement id="46"><FeatureItemId>45</FeatureItemId><Axis><AxisPoint>2.362205 1.574803 0</AxisPoint>
<Direction>0 0 -2</Direction></Axis><Diameter>1.18155</Diameter></CylinderFeatureMeasurement></MeasuredFeatures>
<MeasuredCharacteristics><CharacteristicMeasurements n="2">
<DiameterCharacteristicMeasurement id="51"><Status><CharacteristicStatusEnum>PASS</CharacteristicStatusEnum></Status>
<CharacteristicItemId>49</CharacteristicItemId><Value>1.18155</Value></DiameterCharacteristicMeasurement>
<AngleBetweenCharacteristicMeasurement id="52"><CharacteristicItemId>50</CharacteristicItemId><Value>89.995</Value>
</AngleBetweenCharacteristicMeasurement></CharacteristicMeasurements></MeasuredCharacteristics>
</MeasurementResults></MeasurementResultsSet></MeasurementsResults></QIFDocument>""".format(
    unit="inch", factor="0.0254"
)
DMIS = """$$ results of the plate
UNITS/INCH,ANGDEC
FA(bore)=FEAT/CYLNDR,INNER,CART,2.362205,1.574803,-0.47244,$
0,0,1.0,1.18155
FA(B)=FEAT/PLANE,CART,60.0,0.0,-10.0,0.0,-1.0,0.0
FA(LN)=FEAT/LINE,BND,CART,0,0,0,1,1,1
"""


def named(*names: tuple[str, str], more: tuple[dict[str, Any], ...] = ()) -> dict[str, Any]:
    """Characteristics of the plate with their names in the report."""
    by = dict(names)
    asked = [
        {**one, **({"reported_as": by[one["name"]]} if one["name"] in by else {})} for one in TABLES["characteristic"]
    ]
    return {"characteristic": [*asked, *more]}


def reported(content: str, **changes: Any) -> Reported:
    found = plate({"report": content.encode()}, recording={"values": "report"}, **changes).reported
    assert found is not None
    return found


def test_rows_of_a_pc_dmis_report_are_found_by_dimension_and_axis_in_their_units() -> None:
    """1.57445 inches are 39.99103 mm, whose last digit is 0.254 µm; 89°59'42" is 0.3′ less than a right angle."""
    names = (("1", "LOC1.D"), ("2", "#7FCFLOC1.TP"), ("5", "DIST1"))
    found = reported(PCDMIS, **named(*names, more=({**ANGLE, "reported_as": "ANGL1.A"},)))
    values = {name: (one.value, one.step) for name, one in found.values.items()}
    expected = {"1": (30.011, 1e-3), "2": (0.036, 1e-3), "5": (39.99103, 2.54e-4), "6": (89.995, 1 / 3600)}
    assert values == {name: pytest.approx(each) for name, each in expected.items()}
    assert found.values["2"].where.endswith("report line 15")
    assert found.features == {}  # a location without Z, of a feature by another name


def test_radii_are_doubled_and_what_holds_at_a_material_condition_is_refused() -> None:
    radius = PCDMIS.replace("D       30.000      0.050      0.050     30.011      0.011",
                            "R       15.000      0.025      0.025     15.004      0.004")  # fmt: skip
    found = reported(radius, **named(("1", "LOC1.R")))
    assert (found.values["1"].value, found.values["1"].step) == (pytest.approx(30.008), pytest.approx(2e-3))
    with pytest.raises(CmmUqError, match=r"report line 15: #7FCFLOC1.TP holds at a material condition"):
        reported(PCDMIS.replace("TP        RFS", "TP        MMC"), **named(("2", "#7FCFLOC1.TP")))


def test_a_location_with_all_three_coordinates_is_a_feature() -> None:
    whole = PCDMIS.replace("D       30.000", "Z      -12.000      0.050      0.050    -12.000      0.000      0.000\n"
                           "D       30.000")  # fmt: skip
    features = [{**one, "reported_as": "BORE"} if one["name"] == "bore" else one for one in TABLES["feature"]]
    bore = reported(whole, feature=features).features["bore"]
    assert bore.point is not None
    np.testing.assert_allclose(bore.point, [60.015, 39.991, -12])
    assert (bore.diameter_mm, bore.direction) == (pytest.approx(30.011), None)
    apart = whole.replace("D       30.000", "DIM LOC2= LOCATION OF CYLINDER BORE  UNITS=MM\n"
                          "AX    NOMINAL       +TOL       -TOL       MEAS        DEV     OUTTOL\nD       30.000")  # fmt: skip
    assert reported(apart, feature=features).features["bore"].diameter_mm == pytest.approx(30.011)
    with pytest.raises(CmmUqError, match="has 2 features 'BORE'"):
        reported(whole + whole[whole.index("DIM LOC1") :], feature=features)


def test_results_of_qif_are_found_by_name_or_designator_in_the_units_of_the_document() -> None:
    found = reported(QIF.replace("HOW", "LEASTSQUARES"), **named(more=(ANGLE,)))
    assert {name: one.value for name, one in found.values.items()} == {
        "1": pytest.approx(25.4 * 1.18155), "6": pytest.approx(89.995)}  # fmt: skip
    bore = found.features["bore"]
    assert bore.point is not None
    assert bore.direction is not None
    np.testing.assert_allclose(bore.point, [60.000007, 39.9999962, 0])
    np.testing.assert_allclose(bore.direction, [0, 0, -1])
    assert bore.step == pytest.approx(25.4e-6)  # that of its finest length, 2.362205: 0 is 0.000000


def test_of_several_kinds_by_one_name_the_one_that_is_asked_for_is_taken() -> None:
    """As in the samples of the QIF community: one call-out is the name of a diameter and of a position."""
    item = '<PositionCharacteristicItem id="60"><Name>1</Name></PositionCharacteristicItem></CharacteristicItems>'
    place = (
        '<PositionCharacteristicMeasurement id="61"><CharacteristicItemId>60</CharacteristicItemId><Value>0.001</Value>'
        "</PositionCharacteristicMeasurement></CharacteristicMeasurements>"
    )
    both = QIF.replace("</CharacteristicItems>", item).replace("</CharacteristicMeasurements>", place)
    both = both.replace("<Name>DIAM_B</Name>", "<Name>1</Name>")
    found = reported(both, **named(("2", "1")))
    values = {name: one.value for name, one in found.values.items()}
    assert values == {"1": pytest.approx(25.4 * 1.18155), "2": pytest.approx(0.0254)}
    with pytest.raises(CmmUqError, match="has 2 values '1'"):
        reported(both, **named(("5", "1")))


def test_an_association_other_than_that_of_the_job_is_refused() -> None:
    with pytest.raises(
        CmmUqError, match="'bore' was associated by maximum_inscribed, and by the job it is by least_squares"
    ):
        reported(QIF.replace("HOW", "MAXINSCRIBED"))


def test_actual_features_of_dmis_are_read_over_lines_and_in_their_unit() -> None:
    bore = reported(DMIS).features["bore"]
    assert bore.point is not None
    np.testing.assert_allclose(bore.point, [60.000007, 39.9999962, -11.999976])
    assert bore.diameter_mm == pytest.approx(25.4 * 1.18155)


def test_a_csv_has_characteristics_and_features() -> None:
    text = "characteristic,value_mm,value_deg,feature,x_mm,y_mm,z_mm,i,j,k,diameter_mm\n1,30.0110,,,,,,,,,\n"
    text += "6,,89.995,,,,,,,,\n,,,bore,60.01,39.99,-10,0,0,1,30.011\n"
    found = reported(text, **named(more=(ANGLE,)))
    assert (found.values["1"].value, found.values["1"].step) == (30.011, pytest.approx(1e-4))
    assert (found.values["6"].angle, found.values["6"].step) == (True, pytest.approx(1e-3))
    assert found.features["bore"].step == pytest.approx(1e-4)


HEAD = "characteristic,value_mm\n"
CUT = PCDMIS[: PCDMIS.index("     30.011")]


@pytest.mark.parametrize(("content", "changes", "words"), [
    (HEAD + "1,30.01\n7,2\n", {}, "no characteristic or feature '7' in the job"),
    (HEAD + "1,30.01\n1,30.02\n", {}, "has 2 values '1', and which of them is of this part is not known"),
    (HEAD + "1,nan\n", {}, "report line 2: has 'nan' where a number belongs"),
    (HEAD + "1,1e999\n", {}, "report line 2: has '1e999' where a number belongs"),
    (HEAD + "1,\n", {}, "report line 2: has no value where one belongs"),
    (HEAD + "1\n", {}, "has 1 cells where the header has 2"),
    ("characteristic,value_deg\n1,3.5\n", {}, "'1' is an angle, and the job asks for size"),
    ("characteristic,value_inch\n1,1.18\n", {}, "has a column 'value_inch'"),
    ("name,value_mm\n1,1.18\n", {}, "has a column 'name'"),
    ("value_mm\n1.18\n", {}, "has neither a column 'characteristic' nor 'feature'"),
    (HEAD, {}, "has no rows"),
    ("", {}, "report"),
    (PCDMIS, {}, "has none of the job's characteristics or features; it has LOC1.X, LOC1.Y"),
    (PCDMIS, named(("1", "LOC1.E")), r"characteristic.* reported_as: .*has no value 'LOC1.E' \(did you mean|LOC1"),
    (CUT, named(("1", "LOC1.D")), "report line 8: .*(DEV|MEAS)"),
    (PCDMIS.replace("30.011      0.011", "30.011      0.021"), named(("1", "LOC1.D")), "report line 8: MEAS 30.011 is not"),
    (PCDMIS.replace("UNITS=IN", "UNITS=XX"), named(("5", "DIST1")), "the unit 'XX' is no length"),
    (PCDMIS + PCDMIS[PCDMIS.index("DIM LOC1"):], named(("1", "LOC1.D")), "has 2 values 'LOC1.D'"),
    (QIF[:1500], {}, "report"),
    (QIF.replace("<Value>1.18155</Value>", ""), {}, r"DiameterCharacteristicMeasurement id 51: has no Value \(PASS\)"),
    (QIF.replace("1.18155</Value>", "x</Value>"), {}, "has 'x' where a number belongs"),
    (DMIS.replace(",1.18155", ""), {}, "is no CYLNDR in CART with 7 numbers"),
    (DMIS.replace("UNITS/INCH,ANGDEC\n", ""), {}, "does not say its unit of length"),
    (DMIS.replace("0,0,1.0,1.18155", "0,0,0.0,1.18155"), {}, "has a direction of no length"),
])  # fmt: skip
def test_what_is_wrong_with_a_report_is_told_with_its_line(content: str, changes: dict[str, Any], words: str) -> None:
    with pytest.raises(CmmUqError, match=words):
        reported(content, **changes)


@pytest.mark.parametrize("recording", [{}, {"file": "points.csv", "values": "report"}])
def test_a_recording_is_of_points_or_of_values(recording: dict[str, str]) -> None:
    with pytest.raises(CmmUqError, match="give either file with the measured points, or values"):
        plate(recording=recording)
