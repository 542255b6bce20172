"""In which cases a run of the second study falls short of what was asked, in its own numbers."""

from __future__ import annotations

from collections import Counter, defaultdict
from collections.abc import Iterable, Mapping, Sequence

from benchmarks.second import judging
from benchmarks.second.cases import EFFECTS, FAULTS
from benchmarks.second.judging import proportion

Pairs = Sequence[tuple[dict, dict]]
_FEW = 20
"""Intervals of a parameter below which their share says little."""


def why(pairs: Pairs, both: Sequence[tuple[dict, dict, dict]], kinds: Mapping[str, tuple[int, int]], apart: Sequence[tuple],
        ) -> list[str]:  # fmt: skip
    """Of each row of what was asked, where it is not kept.

    Parameters
    ----------
    pairs, both : truths with what was said, and with what the oracles said.
    kinds : false alarms and recordings of each kind of noise.
    apart : tenths of probability in which what was said and what was right do not agree.
    """
    short = {kind.removeprefix("nothing, "): counts for kind, counts in kinds.items() if counts[1]}
    outside = [(t, f) for t, f in pairs if t["kind"] == "outside" and not judging.recognised(f)]
    return [
        "more than 2 % of " + _listed(f"{kind} ({n} of {m})" for kind, (n, m) in short.items() if n > 0.02 * m),
        _listed(f"{kind} {100 * proportion(*c)[1]:.1f} %" for kind, c in short.items() if proportion(*c)[1] > 0.04),
        _listed(_blamed(pairs)), "by the oracle alone " + _listed(_by_the_oracle(both)),
        _listed(f"said {mean:.3f} and {right} of {count} right" for count, mean, right, *_ in apart), _listed(_held(pairs)),
        _listed(f"{', '.join(t['hidden'])} ({f['verdict']})" for t, f in outside),
    ]  # fmt: skip


def _blamed(pairs: Pairs) -> list[str]:
    return [
        f"{', '.join(blamed)} (case {t['name']}: {t['design']}, {t.get('fault', t['kind'])})"
        for t, f in pairs if t["kind"] in FAULTS and (blamed := judging.machine_blamed(f))
    ]  # fmt: skip


def _by_the_oracle(both: Sequence[tuple[dict, dict, dict]]) -> list[str]:
    missed: dict[str, list[bool]] = defaultdict(list)
    for t, f, o in both:
        if t["kind"] in EFFECTS:
            missed[t["kind"]].append(judging.hit(t, judging.of_oracle(o["estimates"])) and not judging.hit(t, f))
    return [f"{sum(own)} of {len(own)} of *{kind}*" for kind, own in missed.items() if any(own)]


def _held(pairs: Pairs) -> list[str]:
    held: dict[str, list[bool]] = defaultdict(list)
    for t, f in pairs:
        for parameter, hit in judging.covered(t, f) if t["kind"] != "unresolved period" else ():
            held[parameter].append(hit)
    return [
        f"`{name}` {sum(own)} of {len(own)}" for name, own in sorted(held.items())
        if len(own) >= _FEW and not 0.93 <= sum(own) / len(own) <= 0.97
    ]  # fmt: skip


def _listed(words: Iterable[str]) -> str:
    """Words with commas, those that are the same once with their number."""
    counted = Counter(words)
    return ", ".join(f"{count} × {word}" if count > 1 else word for word, count in counted.items()) or "none by itself"
