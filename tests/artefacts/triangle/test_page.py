"""What the certificate of a triangle standard says."""

from __future__ import annotations

from cmm_uq.certificate.document import Plot
from tests.artefacts.reading import number
from tests.artefacts.simulated import SCALE, SQUARE, blocks, recovered, table

JOB = "triangle-simulated"
ROTATIONS = {
    "rotation_x_x": 4.0, "rotation_x_y": -3.0, "rotation_x_z": 2.0, "rotation_y_x": 1.5, "rotation_y_y": -2.5,
    "rotation_y_z": 3.0, "rotation_z_x": -4.0, "rotation_z_y": 2.0, "rotation_z_z": 5.0,
}  # fmt: skip


def test_the_errors_put_into_the_example_are_found() -> None:
    recovered(JOB, {**SCALE, **SQUARE, **ROTATIONS})


def test_the_source_s_equations_find_them_too() -> None:
    rows = table(JOB, "Scale, squareness, pitch, yaw and roll").rows
    truth = {**SCALE, **SQUARE, **ROTATIONS}
    assert len(rows) == len(truth)
    for (_, by_equations, U, *_), value in zip(rows, truth.values(), strict=True):
        assert abs(number(by_equations) - value) < 2 * number(U)


def test_angles_are_printed_with_their_uncertainty() -> None:
    """A 3-4-5 triangle: 36.87°, 53.13°, 90°; the largest U at the right angle, 0.27″ for 0.1 µm and 0.1 µm; k = 1.96."""
    rows = {row[0]: row[1:] for row in table(JOB, "Sides and angles of the standard at 20 °C").rows}
    assert rows["Angle at 3"] == ("90.000000", "0.27″", "°")
    assert rows["Side 1–2"] == ("500.00000", "0.00024", "mm")


def test_the_picture_says_which_parameter_is_out() -> None:
    """Tolerances of 12 ppm and 8″: scale Z is 14 ppm, squareness XY 12″; YZ with 7.5″ is too near to call."""
    verdicts = {row[0]: row[-1] for row in table(JOB, "Parameters and tolerances").rows}
    assert {name for name, said in verdicts.items() if said == "out"} == {"Scale error of Z", "Squareness X–Y"}
    assert verdicts["Squareness Y–Z"] == "open"
    picture = next(b for b in blocks(JOB) if isinstance(b, Plot) and b.caption.startswith("Each parameter over its"))
    assert picture.alternative == "Out of tolerance: Scale error of Z and Squareness X–Y."
