"""How the axes are read, on a certificate: as stated, by whom, and what the recording says to it."""

from __future__ import annotations

import numpy as np
import pytest

from cmm_uq.analysis.machine.state import StatementEvidence
from cmm_uq.base.points import Machine
from cmm_uq.certificate.sections.regions import (
    readings_data,
    readings_table,
    readings_warnings,
    shrinking,
    smaller_by,
)
from cmm_uq.jobs.tables.machine import AxisFacts

GRATING = AxisFacts(names=["x"], reading="exposed optical grating", source="Data sheet S-1, 2024", period_mm=0.02,
                    deviation=[[1000.0, 3.0], [10.0, 0.3]])  # fmt: skip
SCREW = AxisFacts(names=["z"], reading="ball screw and rotary encoder", source="Nameplate", period_mm=5.0, grade=3)
MACHINE = Machine("A", read_by={"x": GRATING, "z": SCREW})


def test_a_table_has_what_was_stated_by_whom_and_what_is_taken_of_it() -> None:
    found = readings_table(MACHINE, (StatementEvidence("x", 0.01), StatementEvidence("z", 1e6)))
    assert found is not None
    x, z = (tuple(map(str, row)) for row in found.rows)
    periodic = "0.2 µm within one period of 0.02 mm; 3 µm within 1000 mm; 0.3 µm within 10 mm"
    assert x == ("X", "exposed optical grating", periodic,
                 "2", "Data sheet S-1, 2024", "supports it")  # fmt: skip
    assert z == ("Z", "ball screw and rotary encoder", "3 µm within one period of 5 mm; 6 µm within 300 mm", "–", "Nameplate",
                 "denies it: not used")  # fmt: skip
    notes = " ".join(map(str, found.notes))
    assert "HEIDENHAIN, Exposed Linear Encoders" in notes
    assert "ISO 3408-3:2006, v300p and v2πp of tolerance grade 3" in notes
    assert "RLS, LMA10" in notes


@pytest.mark.parametrize(("ratio", "words"), [(np.nan, "shows nothing of it"), (2.0, "shows little of it")])
def test_a_recording_that_says_little_says_so(ratio: float, words: str) -> None:
    found = readings_table(Machine("A", read_by={"x": GRATING}), (StatementEvidence("x", ratio),))
    assert found is not None
    assert str(found.rows[0][-1]) == words


def test_a_machine_of_which_nothing_is_stated_has_no_table() -> None:
    assert readings_table(Machine("A"), ()) is None
    assert readings_data(Machine("A"), ()) == []


def test_what_is_denied_or_exceeded_is_a_warning() -> None:
    large = {"play as stated": np.full(100, 2.5), "periodic as stated": np.full(100, 0.9), "play": np.full(100, 2.5)}
    said = [("x", 21.0), ("y", 19.0), ("periodic_scale_z", 4321.0), ("periodic_scale_y", 19.0)]
    texts = [str(text) for text in readings_warnings([StatementEvidence(*one) for one in said], large)]
    assert texts == [
        "The recording denies how these axes are stated to be read, so that nothing of it is used: X.",
        "The recording denies the bound that is stated, so that it is not used: Periodic scale error of Z. It is 4300 "
        "times as probable without it.",
        "The recording shows more than is stated, and is followed: Play of axes that are stated, over what is stated 2.5 "
        "(2.5 to 2.5).",
    ]


def test_results_have_what_was_stated_what_is_taken_and_what_the_recording_says() -> None:
    x, z = readings_data(MACHINE, (StatementEvidence("x", 0.01), StatementEvidence("z", 1e6)))
    assert x["stated"] == {"reading": "exposed optical grating", "source": "Data sheet S-1, 2024", "period_mm": 0.02,
                           "deviation": [[1000.0, 3.0], [10.0, 0.3]]}  # fmt: skip
    assert x["taken"] == {
        "within": [[1000.0, 3.0], [10.0, 0.3]],
        "period_mm": 0.02,
        "interpolation_um": 0.2,
        "play_um": 2.0,
    }
    assert (x["recording_against"], x["used"]) == (0.01, True)
    assert (z["recording_against"], z["used"]) == (1e6, False)


def test_an_error_that_was_not_seen_has_what_would_show_or_bound_it() -> None:
    free, stated = Machine("A"), MACHINE
    assert str(shrinking("hysteresis_x", free)) == (
        "faces of a gauge that are met from both sides, or a statement of how X is read"
    )
    assert str(shrinking("hysteresis_x", stated)) == "faces of a gauge that are met from both sides"
    assert str(shrinking("periodic_scale_y", stated)).startswith("positions along the axis that lie closer than half")
    assert "how Y is read" in str(shrinking("periodic_scale_y", stated))
    for name in ("rotation_x_y", "straightness_y_z", "scale_curvature_x"):
        assert str(shrinking(name, free)) == "a calibrated ring, ball or gauge at the place of the part"
    assert not shrinking("tip size A", free)


@pytest.mark.parametrize(("share", "part"), [(0.0, 0.0), (0.36, 0.2), (0.75, 0.5), (1.0, 1.0), (1.02, 1.0)])
def test_what_is_known_takes_its_share_of_the_variance_off_u(share: float, part: float) -> None:
    """Of u = 5 with parts 3 and 4, knowing the 3 leaves 4: a share of 0.36, a fifth."""
    assert smaller_by(share) == pytest.approx(part)
