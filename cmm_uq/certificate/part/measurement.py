"""What was found of a part: all that its page and its ``results.json`` say, as data."""

from __future__ import annotations

import datetime as dt
from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property
from typing import Literal

import numpy as np

from cmm_uq.analysis.conformity.decision import Outcome, rule_words
from cmm_uq.analysis.conformity.limits import LimitDecision
from cmm_uq.analysis.parts.budget import Budget, Displaced
from cmm_uq.analysis.parts.methods.method import Comparison
from cmm_uq.analysis.parts.plan import Plan
from cmm_uq.analysis.parts.result import Stated
from cmm_uq.analysis.parts.virtual import Circumstances, Virtual
from cmm_uq.analysis.parts.ways import Way
from cmm_uq.base.messages import Text
from cmm_uq.base.points import Floats
from cmm_uq.jobs.part.characteristic import CharacteristicFacts
from cmm_uq.jobs.part.job import PartJob
from cmm_uq.jobs.verdicts import gravest
from cmm_uq.maths.uncertainty.monte_carlo import Simulated

Source = Literal["certificate", "results", "job"]
"""What states the machine: a certificate with its inputs inside, the figures and draws alone, or a job that was analysed."""

MATTERS = 0.05
"""Share of a variance from which on what nobody saw is told by name."""


@dataclass(frozen=True)
class Checked:
    """What the verification of the machine's certificate did, or could not do.

    Parameters
    ----------
    what : in words.
    count : of things compared; 0 of what was left.
    why : it was left; empty where it was done.
    """

    what: str
    count: int = 0
    why: str = ""


@dataclass(frozen=True)
class Standing:
    """The machine's certificate on the day of the measurement.

    Parameters
    ----------
    source : what states the machine.
    files : that were read, as the job names them; the folder of a job that was analysed.
    number, laboratory : of the certificate; empty where it does not say.
    machine, serial : that it is of.
    origin : of the calibration's recording: ``measured``, ``simulated``, ``compensated``.
    date : of the calibration.
    age : of it on the day of the part's measurement.
    valid_until : last day on which it holds; ``None`` where neither it nor the job says so.
    verdict : of the verification; ``ANALYSED`` of a job.
    checked : what was verified, then what was not.
    again : whether everything was computed again.
    trusted : whether signatures were held to trusted certificates.
    draft : whether nobody has issued it.
    given_recording : whether the machine's errors were drawn given the recording of its calibration.
    path : how they were drawn, in a sentence.
    drift : what is reckoned with of changes since the calibration, in a sentence.
    temperature_c : of the calibration; ``None`` where it does not say.
    inputs_sha256 : of the calibration, by name.
    changes : root mean square change of each reported parameter since the calibration, in its unit, as records let expect;
        ``None`` of one where they do not say, and as a whole without records.
    """

    source: Source
    files: tuple[str, ...]
    number: str
    laboratory: str
    machine: str
    serial: str
    origin: str
    date: dt.date
    age: dt.timedelta
    valid_until: dt.date | None
    verdict: str
    checked: tuple[Checked, ...]
    again: bool
    trusted: bool
    draft: bool
    given_recording: bool
    path: Text
    drift: Text
    temperature_c: float | None = None
    inputs_sha256: Mapping[str, str] = field(default_factory=dict)
    changes: Mapping[str, float | None] | None = None


@dataclass(frozen=True)
class Unseen:
    """An error that the calibration left free or did not see, and how much of a characteristic's variance it makes.

    Parameters
    ----------
    characteristic : name of it.
    line : of the budget.
    effect : name of the effect; empty where it is none of a machine.
    title : in words.
    share : of the variance, 0 to 1.
    why : nobody knows it better.
    """

    characteristic: str
    line: str
    effect: str
    title: Text
    share: float
    why: Text


@dataclass(frozen=True)
class Further:
    """What to measure on the machine, so that what is unseen would be seen.

    Parameters
    ----------
    effects : names of those that it is for, of the largest share first.
    setups : how many set-ups of the artefact; 0 where none of it would help.
    text : in a sentence.
    command : line that plans it; empty where there is none.
    file : of the set-ups, to be filled in; empty where there are none.
    missed : names of those that no set-up of the artefact would show.
    """

    effects: tuple[str, ...]
    setups: int
    text: Text
    command: str = ""
    file: str = ""
    missed: tuple[str, ...] = ()


@dataclass(frozen=True, eq=False)
class PartFound:
    """A part's measurement, with its uncertainty and what follows.

    Parameters
    ----------
    job : that was read.
    plan, given : geometry, and circumstances with the machine's state.
    virtual, simulated : virtual measurements, and what they say of the errors.
    stated : of each characteristic, in the order of the plan; mm and rad.
    measured : (c,) values of the measured points, before their mean error is taken off; ``None`` where nothing was measured.
    budget : shares by cause.
    unseen : what the calibration left free or did not see, by characteristic in the order of the plan, largest first.
    further : what to measure on the machine for that.
    judged : by characteristic; ``None`` where the drawing has no limits.
    together : probability that all limits are kept at once; ``None`` without measured points or limits.
    ways : as planned, then what would change u.
    displaced : contact points.
    origin_mm : where the part's origin lies in coordinates of the machine, or about which place it does.
    standing : the machine's certificate.
    methods : other methods on this part beside this one; ``None`` where the job has none.
    digits : of u that were asked for; ``None`` where the number of draws was.
    seed : of everything random.
    asked : virtual measurements that were asked for, of which ``digits`` may need more.
    files : that come with the page, by name.
    warnings : what the reader must know before using a figure.
    """

    job: PartJob
    plan: Plan
    given: Circumstances
    virtual: Virtual
    simulated: Simulated
    stated: tuple[Stated, ...]
    measured: Floats | None
    budget: Budget
    unseen: tuple[Unseen, ...]
    further: Further | None
    judged: tuple[LimitDecision | None, ...]
    together: float | None
    ways: tuple[Way, ...]
    displaced: Displaced
    origin_mm: tuple[float, float, float]
    standing: Standing
    methods: Comparison | None = None
    digits: int | None = None
    seed: int = 0
    asked: int = 0
    warnings: tuple[Text, ...] = ()
    files: Mapping[str, bytes] = field(default_factory=dict)

    @property
    def characteristics(self) -> list[CharacteristicFacts]:
        """As the job has them, in order."""
        return list(self.job.facts.characteristic)

    @cached_property
    def correlation(self) -> Floats:
        """(c, c) of the errors; of a characteristic without any spread 0 beside the diagonal."""
        spread = np.where(self.simulated.u > 0, self.simulated.u, 1.0)
        found = self.simulated.covariance / np.outer(spread, spread)
        np.fill_diagonal(found, 1.0)
        return np.asarray(found)

    @cached_property
    def margins(self) -> Floats:
        """(c,) distance of each value from its nearest limit, inwards, in standard uncertainties; ``nan`` without either."""
        found = np.full(len(self.stated), np.nan)
        for i, (stated, judged) in enumerate(zip(self.stated, self.judged, strict=True)):
            if judged is None or stated.value is None or not stated.u:
                continue
            sides = [judged.upper - stated.value] if judged.upper is not None else []
            sides += [stated.value - judged.lower] if judged.lower is not None else []
            found[i] = min(sides) / stated.u
        return found

    @property
    def nearest(self) -> int | None:
        """Place of the characteristic with the least margin; ``None`` where nothing is decided."""
        return None if np.isnan(self.margins).all() else int(np.nanargmin(self.margins))

    @property
    def outcomes(self) -> list[Outcome]:
        """Of the characteristics that were decided on."""
        return [one.outcome for one in self.judged if one is not None and one.outcome is not None]

    @property
    def outcome(self) -> str | None:
        """Of the part: the gravest of its characteristics; ``None`` where nothing is decided."""
        return gravest(self.outcomes) if self.outcomes else None

    @property
    def judged_by(self) -> Text:
        """The decision rule, in words."""
        return rule_words(self.job.facts.decision.rule)

    @property
    def conforming(self) -> bool:
        """Whether nothing that was decided is anything but a pass."""
        return self.outcome in (None, "pass")
