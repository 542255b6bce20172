"""The verdict of a diagnosis, and what a model leaves held against what repeats scatter by, which no model makes smaller."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import scipy

from cmm_uq.analysis.diagnosis.comparison.explanations import SAME_PLACE
from cmm_uq.base.points import Floats, Ints
from cmm_uq.base.units import MICROMETRE
from cmm_uq.machine.model import RecordingModel
from cmm_uq.machine.model.noise import number_in_reading, repeated_quantity
from cmm_uq.maths.inference.linear_model import reached

_FEWEST = 4  # degrees of freedom of the repeats, and of what they share, from which on the two are compared


@dataclass(frozen=True)
class RepeatComparison:
    """Analysis of variance of the residuals, within repeats of one quantity and between quantities (lack of fit)."""

    repeatability_um: float  # standard deviation of a repeat, of one coordinate
    shared_um: float  # of what all repeats of a quantity share, beyond what their number leaves of that
    p_value: float  # that independent noise alone leaves as much between quantities


def against_repeats(model: RecordingModel) -> RepeatComparison | None:
    """Compare what a model leaves between quantities with the scatter within; nothing of a recording with few repeats.

    Where nothing is repeated, one place of a set-up that is read again, as on the way back, is: but for what the directions of
    approach have in common. F test of lack of fit (Draper & Smith 1998, Applied Regression Analysis, 2.1): exact for normal
    noise that is independent from reading to reading.
    """
    fitted, none = model.estimate().least_squares, np.zeros((int(model.used.sum()), 0))
    left = fitted.residuals / model.artefact.noise_scale[model.used]
    for block, ways in ((repeated_quantity(model, model.used), none), (_read_again(model), _ways(model))):
        _, block = np.unique(block, return_inverse=True)
        block, count = block.ravel(), np.bincount(block.ravel())
        deviation, among = (each - _means(each, block) for each in (left[:, None], ways))
        among = reached(among)
        within = float(np.sum((deviation - among @ (among.T @ deviation)) ** 2))
        own = len(left) - len(count) - among.shape[1]
        between, other = max(float(left @ left) - within, 0.0), fitted.degrees_of_freedom - own
        if min(own, other) >= _FEWEST and within:
            mean, scatter = between / other, within / own
            each = (len(left) - float(count @ count) / len(left)) / (len(count) - 1)  # repeats of a quantity
            shared = float(np.sqrt(max(mean - scatter, 0.0) / each))
            p_value = float(scipy.special.fdtrc(other, own, mean / scatter))
            return RepeatComparison(float(np.sqrt(scatter)) / MICROMETRE, shared / MICROMETRE, p_value)
    return None


def exceeds(repeats: RepeatComparison | None, alpha: float) -> bool:
    return repeats is not None and repeats.p_value < alpha


def verdict_of(*, named: bool, doubtful: bool, modelled: bool) -> str:
    if named:
        return "partial" if doubtful else "explained"
    return "empirical" if modelled else "unexplained"


def _means(columns: Floats, block: Ints) -> Floats:
    """Of columns (m, k) the means over each block of observations, (m, k)."""
    sums = np.zeros((block.max() + 1, columns.shape[1]))
    np.add.at(sums, block, columns)
    return np.asarray((sums / np.bincount(block)[:, None])[block])


def _read_again(model: RecordingModel) -> Ints:
    """Numbers (m,) that observations of one set-up, seen alike, share where all of their points are at the same places."""
    artefact, rows = model.artefact, model.artefact.rows[model.used]
    places = artefact.points.machine_xyz[rows].reshape(len(rows), -1)
    others = np.column_stack([artefact.measurement, number_in_reading(model)])[model.used]
    tree = scipy.spatial.cKDTree(np.column_stack([places, 1e9 * others]))  # further apart than any places
    near = tree.query_pairs(SAME_PLACE, output_type="ndarray")
    graph = scipy.sparse.coo_array((np.ones(len(near)), (near[:, 0], near[:, 1])), shape=(len(rows), len(rows)))
    return np.asarray(scipy.sparse.csgraph.connected_components(graph, directed=False)[1], dtype=np.int64)


def _ways(model: RecordingModel) -> Floats:
    """Directions of approach (m, k) of each used observation, where they were recorded."""
    points, rows = model.artefact.points, model.artefact.rows[model.used]
    found = [points.columns[name][rows].mean(axis=1) for name in points.columns if name.startswith("approach_")]
    return np.column_stack(found) if found else np.zeros((len(rows), 0))
