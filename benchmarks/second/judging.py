"""What is right about what was found: nothing here looks at a recording, only at truths and at what was said."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np
from scipy import stats

from benchmarks.concealed.physics import holds
from benchmarks.second.cases import FAULTS

OF_THE_ARTEFACT = ("artefact", "thermal_artefact")
"""Beginnings of the names of effects that are no machine's."""


def proportion(hits: int, count: int) -> tuple[float, float]:
    """Clopper and Pearson's 95 % interval of a proportion."""
    low = stats.beta.ppf(0.025, hits, count - hits + 1) if hits else 0.0
    high = stats.beta.ppf(0.975, hits + 1, count - hits) if hits < count else 1.0
    return float(low), float(high)


def group_of(name: str, found: dict) -> set[str]:
    """What is named and all that is said to be indistinguishable from it."""
    own = found["effects"][name].get("group", ())
    return {name, *own}.union(*(group for group in found["groups"] if name in group))


def of_oracle(found: dict) -> dict:
    """What an oracle finds, told as a diagnosis: names alone."""
    return {"effects": {name: {} for name in found["effects"]}, "groups": []}


def hit(truth: dict, found: dict) -> bool:
    """Whether all that is hidden is named, alone or in a group, or else what nobody could tell from it."""
    said = set().union(*(group_of(name, found) for name in found["effects"]))
    return bool(truth["hidden"]) and all({name, *truth["rivals"].get(name, ())} & said for name in truth["hidden"])


def innocent(truth: dict, found: dict) -> list[str]:
    """Effects that are named and are not there, nor named together with one that is, nor all that could be seen of one."""
    rivals = set().union(*truth["rivals"].values()) if truth["rivals"] else set()
    return [
        name for name in found["effects"] if not group_of(name, found) & set(truth["hidden"]) and name not in rivals
    ]


def machine_blamed(found: dict) -> list[str]:
    """Effects of the machine that are named without a word of the artefact."""
    return [
        name for name in found["effects"]
        if not any(each.startswith(OF_THE_ARTEFACT) for each in group_of(name, found))
    ]  # fmt: skip


def artefact_named(found: dict) -> bool:
    """Whether the artefact is named, alone or in a group."""
    said = set().union(*(group_of(name, found) for name in found["effects"]))
    return any(each.startswith(OF_THE_ARTEFACT) for each in said)


def recognised(found: dict) -> bool:
    """Whether it is said that something is there that no known effect accounts for."""
    return found["verdict"] in ("unexplained", "partial")


def there(name: str, truth: dict, group: Iterable[str]) -> tuple[bool, bool]:
    """Whether an effect that is named is there; and whether it or one of its group is.

    Of an artefact's fault: whether it is the effect that the fault is, or one that nobody could tell from it.
    """
    if truth["kind"] in FAULTS:
        right = {*truth["is"], *truth["alike"]}
        return name in right, bool({name, *group} & right)
    function = truth["kind"] == "outside" and any(" " in each for each in group)  # no effect, but one of no known form
    return name in truth["hidden"], function or bool(set(group) & set(truth["hidden"]))


def told(name: str, truth: dict, found: dict) -> tuple[float, bool]:
    """Probability said of an effect that is named, and whether it is there.

    Effects of an artefact that are one and the same in this recording are one statement: its probability is that of all
    explanations that remain with any of them, whichever of them is named, and whether or not it is true.
    """
    said = float(found["effects"][name]["probability"])
    if truth["kind"] not in FAULTS:
        return said, there(name, truth, ())[0]
    same = next((set(each) for each in truth["same"] if name in each), {name})
    if len(same) > 1:
        said = max(said, min(1.0, sum(p for p, effects in found.get("remaining", ()) if same & set(effects))))
    return said, bool(same & set(truth["is"])) or name in truth["alike"]


def covered(truth: dict, found: dict) -> list[tuple[str, bool]]:
    """For every parameter of every hidden effect that is named, whether its interval holds the truth."""
    listed = []
    for name, size in truth["hidden"].items():
        said = found["effects"].get(name)
        for parameter, (_, _, low, high) in said["parameters"].items() if said else ():
            listed.append((parameter, holds(truth, name, size, parameter, low, high)))
    return listed


def period_told(truth: dict, found: dict) -> bool:
    """Whether the interval of a hidden period holds it, or one of the others that are said to fit is within a tenth of it."""
    (name,) = truth["hidden"]
    held = dict(covered(truth, found)).get("period_mm", False)
    others = found["effects"][name].get("periods", ())
    return held or any(abs(other / truth["period"] - 1) < 0.1 for other in others)


def same(found: dict) -> bool:
    """Whether rows in order gave the same verdict, effects, groups and values to a thousandth of u."""
    other = found["in_order"]
    if any(found[key] != other[key] for key in ("verdict", "groups")) or list(found["effects"]) != list(
        other["effects"]
    ):
        return False
    return all(
        abs(row[0] - other["effects"][name]["parameters"][key][0]) <= 1e-3 * max(row[1], 1e-300)
        for name, said in found["effects"].items() for key, row in said["parameters"].items()
    )  # fmt: skip


def tenths(
    said: list[float], right: list[bool]
) -> list[tuple[int, float, int, tuple[float, float], tuple[float, float]]]:
    """Of each tenth of said probability: how many, their mean, how many right, the interval of the part that was right, and
    that of the mean of as many trials as were made, if each was right as often as was said (normal approximation, within
    0 and 1)."""
    p, good = np.array(said), np.array(right)
    found = []
    for tenth in range(10):
        own = np.minimum((p * 10).astype(int), 9) == tenth
        count = int(own.sum())
        if count:
            mean, spread = float(p[own].mean()), 1.96 * float(np.sqrt(np.sum(p[own] * (1 - p[own])))) / count
            expected = max(mean - spread, 0.0), min(mean + spread, 1.0)
            found.append((count, mean, int(good[own].sum()), proportion(int(good[own].sum()), count), expected))
    return found
