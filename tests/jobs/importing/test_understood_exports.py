"""What exports of the last sealed sets taught: where references stand, how places are said, what a comma and a verdict are."""

from __future__ import annotations

import numpy as np
import pytest

from cmm_uq.base.errors import CmmUqError
from cmm_uq.jobs.importing.format import ImportKeys
from cmm_uq.jobs.importing.lengths.places import place_of_line, said_in
from cmm_uq.jobs.importing.recording import UnplacedError, imported

LENGTHS = (30.0, 150.0, 250.0, 400.0)
CALIBRATED = (30.0001, 149.9998, 250.0003, 400.0005)


def asked(rows: list[str], **keys: object) -> tuple[list[float | None], list[float]]:
    """Reference and measured value of each length of a table that leaves open where its lines lie."""
    with pytest.raises(UnplacedError) as error:
        imported("\n".join(rows).encode(), "a.csv", ImportKeys.model_validate(keys))
    (lengths,) = error.value.lengths
    return lengths.reference, lengths.measured


def test_a_verdict_of_one_letter_leaves_no_row_out() -> None:
    rows = [
        f"{k} - axe X;{n};{c};{c + 0.0007:.4f};O" for k in (1, 2, 3) for n, c in zip(LENGTHS, CALIBRATED, strict=True)
    ]
    references, measured = asked(["Position;Nominal (mm);Valeur étalonnée (mm);Mesure 1 (mm);Conforme", *rows])
    assert references == [*CALIBRATED] * 3
    assert np.allclose(np.subtract(measured, references), 0.0007, atol=6e-5)


def test_calibrated_lengths_of_another_table_are_the_references() -> None:
    table = [
        "Nominal (mm);Certified (mm);U (k=2) (µm)",
        *(f"{n};{c};0.3" for n, c in zip(LENGTHS, CALIBRATED, strict=True)),
    ]
    rows = [f"L{k};{n};{n + 0.001 * k:.4f};{n - 0.001 * k:.4f}" for k in (1, 2) for n in LENGTHS]
    references, _ = asked([*table, "", "Line;Nominal (mm);Run 1 (mm);Run 2 (mm)", *rows])
    assert references == [one for _ in (1, 2) for one in CALIBRATED for _ in (1, 2)]


def test_what_a_laser_reads_is_the_reference_where_the_sign_of_the_error_agrees() -> None:
    error = (-1.0, 0.3, 1.6, -0.2)
    rows = [f"{k};{n:.4f};{n - e / 1000:.4f};{e}" for k, (n, e) in enumerate(zip(LENGTHS, error, strict=True), 1)]
    references, measured = asked(["Punto;Lettura MMC (mm);Lettura laser (mm);Errore (µm)", *rows])
    assert measured == [*LENGTHS]
    assert np.allclose(references, np.subtract(LENGTHS, np.divide(error, 1000)), atol=1e-9)


@pytest.mark.parametrize(
    ("text", "place"),
    [
        ("Start X = 100 Y = 200 Z = 150\ndirection (cos) i = 0.6 j = 0.8 k = 0", "from 100,200,150 to 400,600,150"),
        ("D1 da X100 Y100 Z100 a X400 Y500 Z100", "from 100,100,100 to 400,500,100"),
        ("bar centre (450; 600; 300), X axis", "from 200,600,300 to 700,600,300"),
        ("X축과 평행, Y=500, Z=250, X=100 에서 시작", "along X from 100,500,250"),
        ("from (100; 200; 60) towards (130; 240; 60)", "from 100,200,60 to 400,600,60"),
        ("ball centre A (100; 100; 100), ball centre B (600; 100; 100)", "from 100,100,100 to 600,100,100"),
    ],
)
def test_places_as_laboratories_say_them(text: str, place: str) -> None:
    assert place_of_line([said_in(text.split("\n"))], 500.0, 1.0, alone=True) == place


def test_a_comma_that_would_make_a_machine_of_a_hundred_metres_is_decimal() -> None:
    rows = [f'{k},{p},"{100 + 100 * p},981","-{200 + 10 * k},022","120,006"' for k in (1, 2) for p in (1, 2)]
    found = imported("\n".join(["Units: mm", 'Place,Ball,"X","Y","Z"', *rows]).encode(), "a.csv", ImportKeys())
    assert found.columns["x_mm"][0] == 200.981
    small = [f'{k},{p},"{p},981","-{k},022","3,006"' for k in (1, 2) for p in (1, 2)]
    with pytest.raises(CmmUqError, match="can be"):
        imported("\n".join(["Units: mm", 'Place,Ball,"X","Y","Z"', *small]).encode(), "a.csv", ImportKeys())
