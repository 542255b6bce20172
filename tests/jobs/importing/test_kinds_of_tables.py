"""Plates without Z, plates by deviations of several passes, spheres on rotary tables; tables that hold no points at all."""

from __future__ import annotations

import numpy as np
import pytest

from cmm_uq.base.errors import CmmUqError
from cmm_uq.jobs.importing.format import ImportKeys
from cmm_uq.jobs.importing.recording import ImportedTable, imported

GRID = [(60.0 * i + 0.0013 * j, 60.0 * j - 0.0021 * i) for j in range(4) for i in range(4)]


def read(lines: list[str], name: str = "a.csv") -> ImportedTable:
    return imported("\n".join(lines).encode(), name, ImportKeys())


@pytest.mark.parametrize(
    "head",
    ["Hul nr.;X kalibreret [mm];Y kalibreret [mm];X målt [mm];Y målt [mm]",
     "Hole;X calibrated [mm];Y calibrated [mm];X measured [mm];Y measured [mm]",
     "Bohrung;X kalibriert [mm];Y kalibriert [mm];X Istwert [mm];Y Istwert [mm]"],
)  # fmt: skip
def test_holes_of_a_plate_without_z_lie_in_one_plane(head: str) -> None:
    rows = [f"{n};{x:.5f};{y:.5f};{x + 0.0004:.4f};{y - 0.0003 * n:.4f}" for n, (x, y) in enumerate(GRID, 1)]
    found = read([head, *rows])
    assert found.columns["z_mm"].tolist() == [0.0] * 16
    np.testing.assert_allclose(found.columns["y_mm"], [y - 0.0003 * n for n, (_, y) in enumerate(GRID, 1)], atol=5.1e-5)
    assert "has no Z" in found.recognised.columns["z_mm"]
    assert found.columns["point"].tolist() == [*range(1, 17)]


def test_a_ring_that_stays_where_it_is_is_no_plate() -> None:
    rows = [f"{n};{x / 1e4:.4f};{y / 1e4:.4f}" for n, (x, y) in enumerate(GRID, 1)]
    with pytest.raises(CmmUqError, match="z_mm"):
        read(["No.;Centre X (mm);Centre Y (mm)", *rows])


def test_lengths_along_two_axes_are_no_plate() -> None:
    rows = [f"{n};{50 * n + n % 2 / 1e3:.4f};{70 * n + n % 3 / 1e3:.4f}" for n in range(1, 7)]
    with pytest.raises(CmmUqError):
        read(["No.;X axis [mm];Y axis [mm]", *rows])


@pytest.mark.parametrize(
    "heads",
    [("Калібровані координати, мм", "Відхилення, прохід {}, мкм"), ("Calibrated [mm]", "Deviation, pass {} [um]"),
     ("Kalibriert [mm]", "Abweichung, Durchgang {} [µm]")],
)  # fmt: skip
def test_deviations_of_several_passes_are_repeats_of_calibrated_places(heads: tuple[str, str]) -> None:
    calibrated, deviation = heads
    above = ["", calibrated, "", "", *(text for k in (1, 2) for text in (deviation.format(k), "", ""))]
    three = [(x, y, 0.01 * (n % 3)) for n, (x, y) in enumerate(GRID)]
    off = [[(n % 5 - 2 + k, 5 * k - n % 4, n % 3 - 1) for n in range(16)] for k in (0, 1)]  # µm
    rows = [
        ";".join([f"{n + 1}", *(f"{c:.4f}" for c in three[n]), *(f"{d:.1f}" for k in (0, 1) for d in off[k][n])])
        for n in range(16)
    ]
    columns = read([";".join(above), "Kugel;X;Y;Z;X;Y;Z;X;Y;Z", *rows]).columns
    xyz = np.column_stack([columns[f"{axis}_mm"] for axis in "xyz"])
    for k in (0, 1):
        own = columns["repeat"] == k + 1
        np.testing.assert_allclose(xyz[own], np.round(three, 4) + np.array(off[k]) / 1000, atol=1e-9)
        assert columns["point"][own].tolist() == [*range(1, 17)]


@pytest.mark.parametrize(
    ("title", "angle"),
    [("Drehtisch, ISO 10360-3", "Winkel [°]"), ("Rotary table", "Angle (deg)"), ("Plateau tournant", "Position (°)")],
)
def test_spheres_on_a_table_are_numbered_by_sphere_and_position(title: str, angle: str) -> None:
    angles = [*range(0, 361, 45), *range(315, -1, -45)]
    rows = [
        f"{n};{c};{200 + n % 3 / 1e4:.4f};{n / 1e4:.4f};20.0000;{-200 + n % 2 / 1e4:.4f};0.0200;{420 + n / 1e4:.4f}"
        for n, c in enumerate(angles)
    ]
    head = [f"{title};;;;;;;", f"No.;{angle};Sphere A;;;Sphere B;;", ";;x [mm];y [mm];z [mm];x [mm];y [mm];z [mm]"]
    columns = read([*head, *rows]).columns
    assert columns["c_deg"][columns["point"] == 1].tolist() == angles
    assert columns["repeat"][columns["point"] == 2].tolist() == [*range(1, 18)]
    assert columns["z_mm"][columns["point"] == 2].tolist() == [round(420 + n / 1e4, 4) for n in range(17)]
    turned = [
        f"{n};{c};{200 * np.cos(np.radians(c)):.4f};{200 * np.sin(np.radians(c)):.4f};20.0000;"
        f"{-200 * np.cos(np.radians(c)):.4f};{-200 * np.sin(np.radians(c)):.4f};420.0000"
        for n, c in enumerate(angles)
    ]
    with pytest.raises(CmmUqError, match="of a table that turned"):
        read([*head, *turned])


@pytest.mark.parametrize(
    ("lines", "what"),
    [
        (["Fecha;Hora;Aire (°C);Regla X (°C)", *(f"09/03/2026;18:{n:02};20,{n:02};19,9{n % 9}" for n in range(12))],
         "temperatures by time"),
        (["Zeit,Lufttemperatur [°C]", *(f"2026-03-01 10:{n:02},20.{n:02}" for n in range(12))], "temperatures by time"),
        (["Rechtwinkligkeit;µm/m", "XY;-3,3", "XZ;4,6", "YZ;1,1"], "squarenesses"),
        (["Perpendicolarità;Prova;um/m", "XY;1;-3,34", "XY;2;-3,27", "XZ;1;4,75"], "squarenesses"),
        (["Result;Value [µm];MPE [µm]", "P_FTU;1,2;1,9", "P_STU;0,4;1,9"], "results of a probing test"),
    ],
)  # fmt: skip
def test_what_holds_no_points_says_what_it_is(lines: list[str], what: str) -> None:
    with pytest.raises(CmmUqError, match=what) as error:
        read(lines)
    assert error.value.fix
