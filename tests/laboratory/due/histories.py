"""Histories for the tests of drift, and the model written a second time with dense matrices."""

from __future__ import annotations

import datetime as dt
from collections.abc import Sequence
from itertools import product
from typing import Any

import numpy as np
from scipy.stats import multivariate_normal

from cmm_uq.base.points import Floats
from cmm_uq.laboratory.due.drift import WRONG, WRONG_TIMES, YEAR, DriftHistory, DriftPrior
from cmm_uq.laboratory.due.drift_filter import DriftState
from cmm_uq.laboratory.records.facts import RecordedCertificate, RecordedMachine, RecordedValue, Series

FIRST = 730_000.0


def machine(
    years: list[float],
    values: list[float],
    u: float | list[float] = 0.5,
    shared: float | list[float] = 0.0,
    artefacts: str = "",
    adjusted: list[float] | None = None,
) -> DriftHistory:
    n = len(years)
    since = np.full(n, np.nan) if adjusted is None else FIRST + YEAR * np.array(adjusted)
    return DriftHistory(
        FIRST + YEAR * np.array(years), np.array(values, dtype=float), np.broadcast_to(u, n).astype(float),
        np.broadcast_to(shared, n).astype(float), tuple(artefacts or "A" * n), since,
    )  # fmt: skip


USUAL = {
    "rate": 0.0, "rate_sd": 1.0, "walk": 0.7, "first_sd": 3.0, "as_left_sd": 1.0, "steps_per_year": 0.2, "step_sd": 2.5,
    "growth": 0.0, "settle_sd": 0.0, "settle_years": 1.0, "season_sd": 0.0,
}  # fmt: skip
ALL = {"growth": 0.3, "settle_sd": 2.0, "settle_years": 0.8, "season_sd": 1.5}
"""Of all components; none of them is of any in :data:`USUAL`."""


def one_node(**of: float) -> DriftPrior:
    return DriftPrior(**{name: np.array([value]) for name, value in (USUAL | of).items()}, weight=np.ones(1),
                 group=np.zeros(1, dtype=np.int64))  # fmt: skip


def dense(of: DriftHistory, prior: DriftPrior) -> tuple[float, Floats, Floats]:
    """Evidence, and mean and covariance of level, rate, settling, cosine and sine at the last certificate."""
    n, p = len(of.day), {name: float(getattr(prior, name)[0]) for name in USUAL}
    t = (of.day - FIRST) / YEAR
    season = 2 * np.pi * FIRST / YEAR
    names = sorted(set(of.artefact))
    log, means, covariances = [], [], []
    for tale in product(*[(0, 1)] * (2 * n)):
        steps, wrong = tale[:n], tale[n:]
        chance = 0.0
        begun, before = t[0], np.nan
        rows: list[dict[str, float]] = []
        state: dict[str, float] = {"first": 1.0}
        sd = {"first": p["first_sd"], "rate": p["rate_sd"], "cos": p["season_sd"], "sin": p["season_sd"]}
        settles, from_ = "settle", t[0]
        sd[settles] = p["settle_sd"]
        for k in range(n):
            since = (of.adjusted_since[k] - FIRST) / YEAR
            if np.isfinite(since) and not since <= before:
                begun, state = max(since, begun) if k else since, {f"left{k}": 1.0}
                settles, from_ = f"settle{k}", begun
                sd[f"left{k}"], sd[settles] = p["as_left_sd"], p["settle_sd"] * p["as_left_sd"] / p["first_sd"]
            before, gap = since, t[k] - begun
            for name, move in {
                "rate": gap + p["growth"] * ((t[k] - t[0]) ** 2 / 2 - (begun - t[0]) ** 2 / 2),
                settles: np.exp(-(begun - from_) / p["settle_years"]) - np.exp(-(t[k] - from_) / p["settle_years"]),
                "cos": np.cos(season + 2 * np.pi * t[k]) - np.cos(season + 2 * np.pi * begun),
                "sin": np.sin(season + 2 * np.pi * t[k]) - np.sin(season + 2 * np.pi * begun),
            }.items():  # fmt: skip
                state = {**state, name: state.get(name, 0.0) + move}
            state = {**state, f"walk{k}": 1.0}
            sd[f"walk{k}"] = p["walk"] * np.sqrt(gap)
            none = np.exp(-p["steps_per_year"] * gap)
            chance += np.log(none) if not steps[k] else (np.log(1 - none) if none < 1 else -np.inf)
            if steps[k]:
                state, sd[f"step{k}"] = {**state, f"step{k}": 1.0}, p["step_sd"]
            chance += np.log(WRONG if wrong[k] else 1 - WRONG)
            rows.append(state)
            begun = t[k]
        if chance == -np.inf:
            continue
        columns = list(sd)
        wanted = [rows[-1], *({name: 1.0} for name in ("rate", settles, "cos", "sin"))]
        A = np.array([[row.get(name, 0.0) for name in columns] for row in [*rows, *wanted]])
        B = np.array([[u * (a == name) for name in names] for u, a in zip(of.u_artefact, of.artefact, strict=True)])
        full = np.block([[A, np.vstack([B, np.zeros((len(wanted), len(names)))])]])
        S = full @ np.diag([*(sd[name] ** 2 for name in columns), *[1.0] * len(names)]) @ full.T
        own = of.u**2 - of.u_artefact**2 + np.array(wrong) * (WRONG_TIMES**2 - 1) * of.u**2
        S[:n, :n] += np.diag(own)
        mean = A[:, columns.index("rate")] * p["rate"]
        gain = np.linalg.solve(S[:n, :n], S[:n, n:]).T
        log.append(chance + multivariate_normal(mean[:n], S[:n, :n]).logpdf(of.value))
        means.append(mean[n:] + gain @ (of.value - mean[:n]))
        covariances.append(S[n:, n:] - gain @ S[:n, n:])
    weights = np.exp(np.array(log) - np.logaddexp.reduce(log))
    whole = np.einsum("t,ti->i", weights, means)
    off = np.array(means) - whole
    return (
        float(np.logaddexp.reduce(log)),
        whole,
        np.einsum("t,tij->ij", weights, covariances) + np.einsum("t,ti,tj->ij", weights, off, off),
    )


FIRST_of_made = dt.date(2024, 3, 1)
MACHINE = RecordedMachine("1102", "Iota", "DEA", "Iota 1102", "Hall 1")


def value(
    number: float, *, name: str = "scale_x.ppm", u: float = 0.5, u_artefact: float = 0.0, limit: float | None = 8.0
) -> RecordedValue:
    return RecordedValue(name, f"quantity {name}", "ppm", number, u, number - 2 * u, number + 2 * u, u_artefact, limit)


def certificate(day: dt.date, *values: RecordedValue, entry: int = 1, **further: Any) -> RecordedCertificate:
    usual: dict[str, Any] = {
        "job": f"job-{day}", "machine": "1102", "artefact": "BB-7", "kind": "some kind", "origin": "measured",
        "recorded": dt.datetime.combine(day, dt.time(12), dt.UTC), "adjusted_since": None, "state": "released",
        "decision": "pass", "diagnosis": "consistent", "interim": False, "folder": "f", "version": "0.5.0",
        "results_sha256": "", "number": f"K-{day}", "command": "report",
    }  # fmt: skip
    return RecordedCertificate(entry=entry, day=day, values=values or (value(1.0),), **(usual | further))


def series(
    days: Sequence[int],
    values: Sequence[float],
    u: Sequence[float] | float = 0.5,
    u_artefact: Sequence[float] | float = 0.0,
    artefact: Sequence[str] | str = "BB-7",
    adjusted_since: Sequence[int] | int = 0,
    limit: float | None = 8.0,
) -> Series:
    n, start = len(days), FIRST_of_made.toordinal()
    since = np.broadcast_to(np.asarray(adjusted_since), n)
    return Series(
        "scale_x.ppm", "Scale error of x", "ppm", limit, np.asarray(days) + start, np.asarray(values, dtype=float),
        np.broadcast_to(np.asarray(u, dtype=float), n), np.broadcast_to(np.asarray(u_artefact, dtype=float), n),
        np.broadcast_to(np.asarray(artefact), n), np.arange(1, n + 1), np.where(since > 0, since + start, 0),
        np.zeros(n, dtype=bool),
    )  # fmt: skip


def over_tales(state: DriftState) -> tuple[Floats, Floats]:
    """Mean (2 + q, N, K) and covariance (2 + q, 2 + q, N, K) over the tales."""
    weight = np.exp(state.log_weight - state.log_evidence[..., None])
    mean = (weight * state.mean).sum(axis=-1)
    off = state.mean - mean[..., None]
    return mean, (weight * (state.covariance + off[:, None] * off)).sum(axis=-1)
