"""A turning table with faults of its own: estimated where it is named, and found where nobody names it."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import cmm_uq
from cmm_uq.app.commands.reading import read_job
from cmm_uq.artefacts import artefact_of
from cmm_uq.base.points import Floats
from cmm_uq.machine.model import RecordingModel
from cmm_uq.machine.model.noise import repeated_quantity
from cmm_uq.machine.physics.catalogue import effects

AXIS = np.array([450.0, 600.0, -350.0])
BALLS = np.array([[x, y, z] for x, y, z in (
    (180, 0, 0), (-180, 20, 0), (0, 190, 150), (10, -170, 150), (120, 110, 300), (-110, -120, 300),
)], dtype=np.float64)  # fmt: skip
ARCSECOND = np.pi / 648000
TRUE = {
    "rotary_location_c_x.um": 30.0, "rotary_location_c_y.um": -20.0, "rotary_tilt_c_x.angle_arcsec": 15.0,
    "rotary_tilt_c_y.angle_arcsec": -6.0, "rotary_positioning_c_1.amplitude_arcsec": 8.0,
    "rotary_positioning_c_1.phase_rad": 0.5,
}  # fmt: skip
LOCATION = ["rotary_location_c_x", "rotary_location_c_y", "rotary_tilt_c_x", "rotary_tilt_c_y"]


def job(folder: Path, named: list[str], *, seed: int, eccentric: float = 8.0, noise_um: float = 0.3) -> Path:
    """Six balls on a table that turns about another axis than stated, with an encoder beside that axis; exact motions."""
    random, lines = np.random.default_rng(seed), []
    offset, tilt = np.array([0.030, -0.020, 0.0]), Rotation.from_rotvec(ARCSECOND * np.array([15.0, -6.0, 0.0]))
    for repeat, degrees in enumerate(np.arange(0.0, 360.0, 30.0), 1):
        c = np.radians(degrees)
        turned = Rotation.from_rotvec([0, 0, c + ARCSECOND * eccentric * np.cos(c + 0.5)])
        # where the balls are: about the true axis, from where they were laid at 0
        there = AXIS + offset + (tilt * turned * tilt.inv()).apply(BALLS - offset)
        read: Floats = there - AXIS + random.normal(0, 1e-3 * noise_um, there.shape)
        table = Rotation.from_rotvec([0, 0, -c]).apply(read)  # as the controller turns it back
        lines += [
            f"1,{i},{repeat},{','.join(f'{v:.6f}' for v in p)},{','.join(f'{v:g}' for v in b)},{degrees:g}"
            for i, (p, b) in enumerate(zip(table, BALLS, strict=True), 1)
        ]
    head = "measurement,point,repeat,x_mm,y_mm,z_mm,reference_x_mm,reference_y_mm,reference_z_mm,c_deg"
    (folder / "recording.csv").write_text("\n".join([head, *lines]) + "\n", encoding="utf-8")
    (folder / "job.toml").write_text(
        f"""
[job]
id = "table"
date = 2026-01-01
origin = "simulated"
[machine]
name = "m"
chain = "XYZ|C"
travel_mm = {{ x = [0, 900], y = [0, 1200], z = [-600, 0] }}
origin_mm = {AXIS.tolist()}
[artefact]
kind = "plate"
u_um = 0.1
[recording]
file = "recording.csv"
[model]
effects = {named}
""".replace("'", '"'),
        encoding="utf-8",
    )
    return folder


def test_location_tilt_and_eccentric_encoder_are_estimated(tmp_path: Path) -> None:
    found = cmm_uq.report(job(tmp_path, [*LOCATION, "rotary_positioning_c_1"], seed=3), seed=1).estimates
    for name, true in TRUE.items():
        row = found.loc[name]
        assert abs(row["value"] - true) < 3 * row["u"], name
        assert row["u"] < 0.1 * abs(true), name


@pytest.mark.long(but="True")
@pytest.mark.parametrize(("eccentric", "probable"), [(3.0, True), (0.0, False)])
def test_a_concealed_eccentric_encoder_is_found_and_no_other_fault(
    tmp_path: Path, eccentric: float, *, probable: bool
) -> None:
    found = cmm_uq.diagnose(job(tmp_path, LOCATION, seed=4, eccentric=eccentric), seed=1)
    assert found.diagnosis["verdict"] == ("explained" if probable else "consistent")
    if probable:
        assert "rotary_positioning_c_1" in {each["effect"] for each in found.diagnosis["effects"]}
        row = found.effects.loc["rotary_positioning_c_1.amplitude_arcsec"]
        assert abs(row["value"] - eccentric) < 3 * row["u"]


def test_readings_at_another_angle_are_no_repeats_in_one_place(tmp_path: Path) -> None:
    """An offset that repeats share would be the location of the axis: of twelve angles each has its own."""
    read = read_job(job(tmp_path, LOCATION, seed=5))
    model = RecordingModel(artefact_of(read.facts.artefact, read.points), effects(LOCATION))
    shared = repeated_quantity(model, model.used)
    assert len(np.unique(shared)) == len(shared) == 12 * 6 * 3
