"""What the noise of a recording could be like: which observations repeat a quantity, follow one another, see one direction."""

from __future__ import annotations

import numpy as np

from cmm_uq.diagnosis.comparison.unknown_functions import directions, mean_of
from cmm_uq.diagnosis.noise import Kind, kinds, order_of, tails
from cmm_uq.model import MeasurementModel
from cmm_uq.points import Ints


def noise_kinds(model: MeasurementModel) -> list[Kind]:
    """Kinds of noise of the used observations."""
    time = model.artefact.points.columns.get("time_s")
    order = order_of(None if time is None else mean_of(model, time), int(model.used.sum()))
    least_squares, linear = model.estimate().least_squares, model.estimate().linear
    return [
        *kinds(repeated_quantity(model), order, directions(model)),
        tails(least_squares.residuals / linear.noise_scale),
    ]


def repeated_quantity(model: MeasurementModel) -> Ints:
    """Numbers (m,) that used observations share when they repeat one quantity: one point, or pair, of one placing."""
    artefact = model.artefact
    key = np.column_stack([artefact.measurement, _points_of(model), _direction(model)])
    _, number = np.unique(key, axis=0, return_inverse=True)
    return np.asarray(number.ravel()[model.used], dtype=np.int64)


def _points_of(model: MeasurementModel) -> Ints:
    return np.sort(model.artefact.points.point[model.artefact.rows], axis=1)


def _direction(model: MeasurementModel) -> Ints:
    """Which of the observations of one reading each is (m,): the coordinates of a point are observations of their own."""
    artefact = model.artefact
    key = np.column_stack([artefact.measurement, artefact.repeat, _points_of(model)])
    _, reading = np.unique(key, axis=0, return_inverse=True)
    order = np.argsort(reading.ravel(), kind="stable")
    first = np.concatenate([[True], np.diff(reading.ravel()[order]) > 0])
    place = np.arange(len(order))
    direction = np.empty_like(place)
    direction[order] = place - np.maximum.accumulate(np.where(first, place, 0))
    return direction
