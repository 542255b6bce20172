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
from cmm_uq.analysis.machine.influence import PriorInfluence
from cmm_uq.analysis.parts.budget import PointErrors, VarianceShares, Way
from cmm_uq.analysis.parts.methods.method import MethodComparison
from cmm_uq.analysis.parts.plan import Plan
from cmm_uq.analysis.parts.result import StatedCharacteristic
from cmm_uq.analysis.parts.virtual import MeasurementConditions, Virtual
from cmm_uq.base.messages import Text
from cmm_uq.base.points import Floats
from cmm_uq.jobs.part.feature import CharacteristicFacts
from cmm_uq.jobs.part.job import PartJob
from cmm_uq.jobs.verdicts import gravest
from cmm_uq.maths.uncertainty.monte_carlo import Simulated

# what states the machine: a certificate with its inputs inside, the figures and draws alone, or a job that was analysed
Source = Literal["certificate", "results", "job"]
MATTERS = 0.05  # share of a variance from which on what nobody saw is told by name


@dataclass(frozen=True)
class VerificationCheck:
    """What the verification of the machine's certificate did, or could not do."""

    what: str  # in words
    count: int = 0  # of things compared; 0 of what was left
    why: str = ""  # it was left; empty where it was done


@dataclass(frozen=True)
class CertificateStatus:
    """The machine's certificate on the day of the measurement."""

    source: Source  # what states the machine
    files: tuple[str, ...]  # that were read, as the job names them; the folder of a job that was analysed
    # number, laboratory: of the certificate; empty where it does not say
    number: str
    laboratory: str
    # machine, serial: that it is of
    machine: str
    serial: str
    origin: str  # of the calibration's recording: ``measured``, ``simulated``, ``compensated``
    date: dt.date
    age: dt.timedelta  # of it on the day of the part's measurement
    valid_until: dt.date | None  # last day on which it holds; ``None`` where neither it nor the job says so
    verdict: str  # of the verification; ``ANALYSED`` of a job
    checked: tuple[VerificationCheck, ...]  # what was verified, then what was not
    again: bool  # whether everything was computed again
    trusted: bool  # whether signatures were held to trusted certificates
    draft: bool  # whether nobody has issued it
    given_recording: bool  # whether the machine's errors were drawn given the recording of its calibration
    path: Text  # how they were drawn, in a sentence
    drift: Text  # what is reckoned with of changes since the calibration, in a sentence
    temperature_c: float | None = None  # of the calibration; ``None`` where it does not say
    inputs_sha256: Mapping[str, str] = field(default_factory=dict)  # of the calibration, by name
    # root mean square change of each reported parameter since the calibration, in its unit, as records let expect; ``None``
    # of one where they do not say, and as a whole without records
    changes: Mapping[str, float | None] | None = None


@dataclass(frozen=True)
class UnseenError:
    """An error that the calibration left free or did not see, and how much of a characteristic's variance it makes."""

    characteristic: str
    line: str  # of the budget
    effect: str  # name of the effect; empty where it is none of a machine
    title: Text  # in words
    share: float  # of the variance, 0 to 1
    why: Text  # nobody knows it better


@dataclass(frozen=True)
class FurtherSetUps:
    """What to measure on the machine, so that what is unseen would be seen."""

    effects: tuple[str, ...]  # names of those that it is for, of the largest share first
    setups: int  # how many set-ups of the artefact; 0 where none of it would help
    text: Text  # in a sentence
    command: str = ""  # line that plans it; empty where there is none
    file: str = ""  # of the set-ups, to be filled in; empty where there are none
    missed: tuple[str, ...] = ()  # names of those that no set-up of the artefact would show


@dataclass(frozen=True, eq=False)
class PartMeasurement:
    """A part's measurement, with its uncertainty and what follows."""

    job: PartJob
    # plan, given: geometry, and circumstances with the machine's state
    plan: Plan
    given: MeasurementConditions
    # virtual, simulated: virtual measurements, and what they say of the errors
    virtual: Virtual
    simulated: Simulated
    stated: tuple[StatedCharacteristic, ...]  # of each characteristic, in the order of the plan; mm and rad
    # (c,) values of the measured points, before their mean error is taken off; ``None`` where nothing was measured
    measured: Floats | None
    budget: VarianceShares  # shares by cause
    # what the calibration left free or did not see, by characteristic in the order of the plan, largest first
    unseen: tuple[UnseenError, ...]
    further: FurtherSetUps | None  # what to measure on the machine for that
    judged: tuple[LimitDecision | None, ...]  # by characteristic; ``None`` where the drawing has no limits
    together: float | None  # probability that all limits are kept at once; ``None`` without measured points or limits
    ways: tuple[Way, ...]  # as planned, then what would change u
    displaced: PointErrors  # contact points
    # where the part's origin lies in coordinates of the machine, or about which place it does
    origin_mm: tuple[float, float, float]
    standing: CertificateStatus  # the machine's certificate
    methods: MethodComparison | None = (
        None  # other methods on this part beside this one; ``None`` where the job has none
    )
    digits: int | None = None  # of u that were asked for; ``None`` where the number of draws was
    seed: int = 0  # of everything random
    asked: int = 0  # virtual measurements that were asked for, of which ``digits`` may need more
    warnings: tuple[Text, ...] = ()  # what the reader must know before using a figure
    files: Mapping[str, bytes] = field(default_factory=dict)  # that come with the page, by name
    influence: tuple[PriorInfluence, ...] = ()  # what other priors of the machine's errors would change

    @property
    def characteristics(self) -> list[CharacteristicFacts]:
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
        return rule_words(self.job.facts.decision.rule)

    @property
    def conforming(self) -> bool:
        """Whether nothing that was decided is anything but a pass."""
        return self.outcome in (None, "pass")
