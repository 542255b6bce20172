"""Pictures of more values than can be told apart: the largest are drawn, and the caption says how many of all."""

from __future__ import annotations

import numpy as np

from cmm_uq.base.messages import say
from cmm_uq.certificate.plots.labels import MOST, shown, told
from cmm_uq.certificate.plots.residuals import length_plot, volume_plot
from cmm_uq.certificate.plots.vectors import vector_plot


def test_few_values_are_all_drawn_and_the_caption_stays() -> None:
    assert np.array_equal(shown([np.arange(float(MOST))]), np.arange(MOST))
    assert told(say("Residuals."), 20, 20) == "Residuals."


def test_of_many_the_largest_of_each_series_and_what_is_flagged_are_drawn_and_no_more_than_the_most() -> None:
    random = np.random.default_rng(1)
    first, second, flagged = (
        random.standard_normal(50_000),
        random.standard_normal(50_000),
        np.zeros(50_000, dtype=bool),
    )
    flagged[[17, 40_000]] = True
    rows = shown([first, second], flagged)
    assert len(rows) == len(np.unique(rows)) == MOST
    assert {17, 40_000, int(np.argmax(np.abs(first))), int(np.argmin(second)), int(np.argmax(second))} <= set(
        rows.tolist()
    )
    assert np.diff(rows).max() < 100  # the others are spread over all


def test_every_picture_of_a_large_recording_says_how_many_it_draws_and_stays_small() -> None:
    count, random = 20_000, np.random.default_rng(2)
    values, words = random.standard_normal(count), {"caption": say("Residuals."), "alternative": say("a")}
    places = random.uniform(0, 500, (count, 3))
    pictures = (
        length_plot(np.arange(count), values, values, expanded_before_um=1.0, expanded_after_um=1.0,
                    reference=say("zero"), **words),
        volume_plot(places, values, **words),
        vector_plot(places[:, :2], [(say("Residuals"), places[:, 1:])], **words),
    )  # fmt: skip
    for picture in pictures:
        assert picture.caption.startswith(f"Residuals. Drawn are {MOST} of {count}")
        assert len(picture.svg) < 500_000


def test_of_few_that_are_drawn_half_are_the_largest() -> None:
    sizes = np.zeros(1000)
    sizes[[3, 500, 999]] = 5.0
    rows = shown([sizes], most=20)
    assert len(rows) == 20
    assert {3, 500, 999} <= set(rows.tolist())
