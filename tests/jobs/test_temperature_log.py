from __future__ import annotations

import numpy as np
import pytest

from cmm_uq.base.errors import CmmUqError
from cmm_uq.jobs.recording.temperature_log import parse_temperature_log

LOG = b"""time_s,x1_c,x2_c,x3_c,y1_c,y2_c,z1_c,table_c
0,20.0,20.3,20.6,21,22,19,18
60,20.6,20.9,21.2,21,22,20,18
120,21.2,21.5,21.8,22,23,,18
"""


def test_a_scale_is_at_the_mean_of_its_thermocouples():
    log = parse_temperature_log(LOG.replace(b",,18", b",21,18"), "log.csv")
    np.testing.assert_allclose(
        log.at([0, 30, 60, 90]), [[20.3, 21.5, 19], [20.6, 21.5, 19.5], [20.9, 21.5, 20], [21.2, 22, 20.5]]
    )


def test_the_spread_of_the_thermocouples_is_kept():
    log = parse_temperature_log(LOG.replace(b",,18", b",21,18"), "log.csv")
    np.testing.assert_allclose(log.spread_at([0.0]), [[0.6, 1.0, 0.0]], atol=1e-12)


def test_a_thermocouple_that_fell_out_is_stood_in_for_by_the_others():
    log = parse_temperature_log(LOG.replace(b",22,23,,", b",,23,21,"), "log.csv")
    np.testing.assert_allclose(log.at([120.0]), [[21.5, 23, 21]])


def test_a_scale_without_any_temperature_is_refused():
    with pytest.raises(CmmUqError, match=r"log\.csv line 4: no temperature of z1_c"):
        parse_temperature_log(LOG, "log.csv")


def test_sensors_can_be_named():
    log = parse_temperature_log(LOG, "log.csv", {"x": ["x2_c"], "y": ["y1_c", "y2_c"], "z": ["table_c"]})
    np.testing.assert_allclose(log.at([0.0]), [[20.3, 21.5, 18]])
    with pytest.raises(CmmUqError, match="no column 'x9_c'"):
        parse_temperature_log(LOG, "log.csv", {"x": ["x9_c"], "y": ["y1_c"], "z": ["z1_c"]})
    with pytest.raises(CmmUqError, match="no thermocouple of scale z"):
        parse_temperature_log(LOG, "log.csv", {"x": ["x1_c"], "y": ["y1_c"]})


def test_dates_are_times():
    text = b"time,x1_c,y1_c,z1_c\n2004-06-01T10:00:00,20,20,20\n2004-06-01T10:10:00,21,21,21\n"
    log = parse_temperature_log(text, "log.csv")
    assert log.at(log.times[:1] + 300)[0].tolist() == [20.5, 20.5, 20.5]


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        (b"60,", b"0,", "line 3: is not later than the line before"),
        (b"time_s", b"clock", "no column time_s or time"),
        (b"20.6,20.9", b"293.6,20.9", "line 3: x1_c = 293.6 °C"),
        (b"20.6,20.9", b"warm,20.9", "line 3: x1_c = 'warm' is no number"),
        (b"time_s,", b"time,", "line 2: time = '0' is no date"),
    ],
)
def test_what_is_wrong_is_named_with_its_line(old, new, message):
    with pytest.raises(CmmUqError, match=message):
        parse_temperature_log(LOG.replace(old, new, 1).replace(b",,18", b",21,18"), "log.csv")


@pytest.mark.parametrize("time", [-1.0, 121.0, np.nan])
def test_no_temperature_is_known_before_or_after_the_log(time):
    with pytest.raises(CmmUqError, match="the log reaches from 0 to 120 s"):
        parse_temperature_log(LOG.replace(b",,18", b",21,18"), "log.csv").at([60.0, time])
