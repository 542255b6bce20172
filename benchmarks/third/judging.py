"""What of a diagnosis is right, by the truth and by what an oracle could know."""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from scipy import stats

from benchmarks.second.artefacts import SIX
from benchmarks.second.cases import UNSEEN
from benchmarks.second.judging import hit, of_oracle
from benchmarks.third.cases import Hidden
from benchmarks.third.forms import DICTIONARY, FORMS, Outside
from benchmarks.third.known import left_by, rivals, versions
from benchmarks.third.oracle import alike

Record = Mapping[str, Any]
QUIET = ("consistent", "undetermined")
"""Verdicts that assert nothing."""
DECIDED = float(np.log(20.0))
NEEDS_PROOF = ("squareness", "ratio")
"""Kinds in which one effect may be two others in a ratio: the one is right only where the others are said with it."""


@dataclass(frozen=True)
class Name:
    """An effect or a form that a diagnosis asserts."""

    name: str
    probability: float
    right: bool
    wrong: bool  # not right, and not in one class with what is
    form: bool


@dataclass
class Judged:
    """One case, counted; what does not apply is ``None``."""

    name: str
    kind: str
    cause: str
    design: str
    noise: str
    root_lambda: float
    verdict: str
    alarm: bool | None = None
    oracle_sees: bool | None = None
    oracle_sees_form: bool | None = None
    oracle_finds: bool | None = None  # where it is, told the noise alone
    located: bool | None = None
    taken: tuple[float, float] | None = None  # part of the held-out rms that goes, here and by the oracle
    decided: bool | None = None  # whether the oracle names the form
    form_named: bool | None = None  # rightly
    form_said: str | None = None
    found: tuple[bool, bool] | None = None  # here and by the oracle
    names: list[Name] = field(default_factory=list)
    classes: list[tuple[int, int]] = field(
        default_factory=list
    )  # members, and those that the oracle parts from the truth


def judged(found: Hidden, truth: Record, said: Record, oracle: Record) -> Judged:
    """Count one case."""
    outside, kind = found.outside, str(truth["kind"])
    cause = outside.form if outside else ", ".join(sorted({_family(name) for name in truth["hidden"]})) or "nothing"
    one = Judged(
        found.one.name, kind, cause, truth["design"], truth["noise"]["kind"], truth["root_lambda"], said["verdict"]
    )
    every, effects = versions(found.seen), [each["effect"] for each in said.get("effects", ())]
    one.alarm = said["verdict"] not in QUIET if kind == "nothing" else None
    fits = bool(effects) and left_by(found, effects, every) < UNSEEN
    own = rivals(found) if found.errors else {}
    for each in said.get("effects", ()):
        group = group_of(each, said)
        good = _effect(found, kind, each["effect"], group, own, every, effects if fits else [])
        together = float(each.get("probability_together", each["probability"]))
        one.names.append(Name(each["effect"], together if group else float(each["probability"]), good, not good, False))
        stood_for = [one for one in stand_ins(each, said) if all(name in every for name in (*one[0], *one[1]))]
        if stood_for and found.errors:
            one.classes.append((1 + len(stood_for), _parted(found, effects, stood_for, every)))
    if outside is None:
        if kind != "nothing":
            names = {each["effect"]: {"group": group_of(each, said)} for each in said.get("effects", ())}
            told = {"hidden": truth["hidden"], "rivals": own}
            one.found = hit(told, {"effects": names, "groups": []}) or fits, hit(told, of_oracle(oracle))
        one.names += [_form(found, each, None) for each in forms_of(said)]
        return one
    return _judge_outside(one, found, outside, said, oracle, fits)


def _judge_outside(one: Judged, found: Hidden, outside: Outside, said: Record, oracle: Record, fits: bool) -> Judged:
    one.oracle_sees, one.oracle_sees_form = oracle["p_covariate"] <= 0.01, oracle["p_form"] <= 0.01
    if "p_anywhere" in oracle:
        one.oracle_finds = oracle["p_anywhere"] <= 0.01 and bool(set(outside.of) & set(oracle["best"]))
    one.located = said["verdict"] not in QUIET and (fits or bool(set(outside.of) & covariates(said)))
    before, after = held_out(said)
    taken = 1 - after / before if before > 0 else 0.0
    one.taken = taken, 1 - oracle["heldout_after_um"] / oracle["heldout_before_um"]
    odds = oracle["log_odds"]
    one.decided = outside.form in DICTIONARY and min(odds.values()) >= DECIDED
    forms = [_form(found, each, odds) for each in forms_of(said)]
    one.names += forms
    # an effect of the catalogue that is the very form names it too
    one.form_named = any(name.right and name.name == outside.form for name in forms) or fits
    one.form_said = ", ".join([*(name.name for name in forms), *(["as an effect"] if fits else [])]) or None
    return one


def _effect(found: Hidden, kind: str, name: str, group: set[str], own: dict[str, list[str]],
            every: dict[str, list[np.ndarray]], fitting: list[str]) -> bool:  # fmt: skip
    """Whether an effect that is named is there, or is said to be one with what is, or is it for all that is seen."""
    hidden = set(found.sizes)
    if name in hidden or group & hidden or any(all(h in text for h in hidden) for text in group if hidden):
        return True
    if found.outside is not None and any(" " in text and _words(found.outside) & set(text.split()) for text in group):
        return True
    if kind in NEEDS_PROOF:
        return False
    if found.outside is not None and name in SIX:  # against a prediction: of a bend the best straight line is a scale
        return 0.5 * (float(np.linalg.norm(found.signal)) ** 2 - left_by(found, [name], every) ** 2) > DECIDED
    if any(name in alike_ for alike_ in own.values()):
        return True
    return name in fitting and left_by(found, [each for each in fitting if each != name], every) >= UNSEEN


def _parted(
    found: Hidden, effects: list[str], stood_for: list[tuple[set[str], set[str]]], every: dict[str, list[np.ndarray]]
) -> int:
    """How many members of a class the recording, its noise known, parts from the best of them by likelihoods of 20 : 1."""
    y = found.seen.rest @ found.one.y
    sets = [effects, *([*(name for name in effects if name not in gone), *come] for gone, come in stood_for)]
    left = np.array([left_by(found, [*dict.fromkeys(one)], every, y) for one in sets])
    return int(np.sum(0.5 * (left**2 - left.min() ** 2) > DECIDED))


def stand_ins(effect: Record, said: Record) -> list[tuple[set[str], set[str]]]:
    """What is said to stand in the place of an effect: what goes, and what comes, each effect or set of them once."""
    name = effect["effect"]
    alone = [*effect.get("group", ()), *(o for one in said.get("indistinguishable", ()) if name in one for o in one)]
    found = [({name}, {other}) for other in alone if other != name]
    found += [({*one["instead_of"]}, {*one["effects"]}) for one in effect.get("alternatives", ())]
    return [one for k, one in enumerate(found) if one not in found[:k]]


def _words(outside: Outside) -> set[str]:
    """How a group may speak of a function of a covariate."""
    return {"time"} if outside.of == ("time_s",) else {name[0].upper() for name in outside.of if name.endswith("_mm")}


def group_of(effect: Record, said: Record) -> set[str]:
    """All that is said to be one with an effect."""
    name = effect["effect"]
    listed = [text for key in ("group", "class", "classes", "members") for text in _texts(effect.get(key, ()))]
    listed += [other for one in effect.get("alternatives", ()) for other in (*one["effects"], *one["instead_of"])]
    more = [each for group in said.get("indistinguishable", ()) if name in group for each in group]
    return {*listed, *more} - {name}


def _texts(value: Any) -> Iterator[str]:
    if isinstance(value, str):
        yield value
    elif isinstance(value, Mapping):
        for each in value.values():
            yield from _texts(each)
    elif isinstance(value, list | tuple):
        for each in value:
            yield from _texts(each)


def forms_of(said: Record) -> list[Record]:
    """Functions that have a form with a name."""
    functions = (said.get("empirical") or {}).get("functions", ())
    return [each for each in functions if each.get("form")]


def _form(found: Hidden, function: Record, odds: Mapping[str, float] | None) -> Name:
    """A form that is named: right where it is the truth, or is it for all that is seen; in a class by the oracle's odds."""
    form, outside = function["form"], found.outside
    name, probability = str(form["name"]), float(form.get("probability") or 0.0)
    of, along = covariates_of(function), function.get("along")
    placed = outside is not None and of == set(outside.of) and along in (None, "xyz"[outside.along])
    right = bool(outside is not None and placed and name == outside.form)
    near = False
    if not right and outside is not None and placed and odds is not None:
        near = odds.get(name, np.inf) < DECIDED
    if not right and not near and found.errors and name in FORMS and name in DICTIONARY:
        near = _same(found, name, of, along, bool(function.get("scale")))
    return Name(name, probability, right or near, not (right or near), True)


def _same(found: Hidden, form: str, of: set[str], along: Any, scale: bool) -> bool:
    """Whether a form of some covariates is, for all that is seen, what is hidden."""
    placed, context = found.one.placed, found.one.context
    values = {f"{a}_mm": placed.true[:, i] for i, a in enumerate("xyz")}
    values |= {key: value for key, value in context.items() if np.ndim(value) == 1}
    names = sorted(of)
    if not names or not all(name in values for name in names) or along not in ("x", "y", "z"):
        return False
    spans = tuple((float(values[name].min()), float(values[name].max())) for name in names)
    if any(high <= low for low, high in spans):
        return False
    return alike(found, form, Outside(form, tuple(names), spans, "xyz".index(along), scale, {})) < UNSEEN


def covariates_of(function: Record) -> set[str]:
    """Of a function: one covariate or two, as a list or as one text."""
    of = function.get("of") or ()
    return set(of) if isinstance(of, list | tuple) else {name for name in re.split(r"[^\w]+", str(of)) if name}


def covariates(said: Record) -> set[str]:
    """Covariates of which a diagnosis says that something lies in them."""
    found = {str(place["covariate"]) for place in said.get("where", ())}
    for function in (said.get("empirical") or {}).get("functions", ()):
        found |= covariates_of(function)
    return found


def held_out(said: Record) -> tuple[float, float]:
    """Held-out rms before and after: of the empirical model, where there is one that predicts what was held out."""
    of = said.get("empirical") or {}
    of = of if of.get("predicts", True) and of.get("heldout_rms_after_um") is not None else said["improvement"]
    return float(of["heldout_rms_before_um"]), float(of["heldout_rms_after_um"])


def _family(name: str) -> str:
    return re.sub(r"(_[xyz]{1,2})+$", "", name)


def calibration(names: list[Name]) -> float:
    """p-value of as many right as were, were each as often right as was said (normal approximation, two-sided)."""
    p, right = np.array([name.probability for name in names]), np.array([name.right for name in names], dtype=float)
    spread = float(np.sqrt(np.sum(p * (1 - p))))
    return float(2 * stats.norm.sf(abs(float(np.sum(right - p))) / spread)) if spread > 0 else 1.0
