"""``[artefact]``: what every kind of measurement says of its artefact."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, ClassVar, Self

import numpy as np
from pydantic import PrivateAttr, model_validator

from cmm_uq.base.files.table import AnyFloat, Length, Table
from cmm_uq.base.points import Floats, Ints
from cmm_uq.jobs.certified_value import LENGTH, CertifiedValue
from cmm_uq.jobs.expanded import Factor, Freedom, Growing, LengthUncertainty, with_standard_uncertainty
from cmm_uq.jobs.importing.keys import FileKeys
from cmm_uq.jobs.traceability import Traceability


class CertificateFile(FileKeys, Traceability):
    """The artefact's own certificate, and the file that its certified values are read from."""

    file: str | None = None
    """File of what is certified. A DCC (XML) gives number, laboratory, dates and certified values with their uncertainty, of
    every kind; a CSV or a workbook the distances or places of points by their number, which the recording then has not."""


class ArtefactFacts(Table):
    """``[artefact]``: what every kind of measurement has; a kind with more keys has a table of its own.

    ``U_um`` with ``k`` or ``degrees_of_freedom`` may stand for ``u_um``, which is then filled in.
    Without ``length_mm`` the artefact is uncalibrated, unless its certified figures stand in the recording.

    Attributes
    ----------
    with_references : whether they do; its ``u_um`` may then stand without ``length_mm``.
    with_recording : whether there is one; otherwise what ``[machine]`` names is measured.
    with_earlier : whether two recordings of it at two dates can be compared.
    carries_probe : whether its recording itself says how far from the end of the ram each point was, as tip offsets do.
    form_key : key of the form deviation by its certificate, for a kind that has a form to be compared.
    certified_values : that the artefact's digital certificate may state, where they do not stand in the recording.
    """

    with_references: ClassVar[bool] = False
    with_recording: ClassVar[bool] = True
    with_earlier: ClassVar[bool] = False
    carries_probe: ClassVar[bool] = False
    form_key: ClassVar[str | None] = None
    certified_values: ClassVar[tuple[CertifiedValue, ...]] = (LENGTH,)

    kind: str
    """What kind of measurement it is; the further keys of the table depend on it."""
    name: str = ""
    """Name of the artefact on the certificate."""
    serial: str = ""
    """Serial number of the artefact."""
    length_mm: Length | None = None
    """Certified length at 20 °C, of a sphere its diameter; left out for an artefact that is not calibrated."""
    u_um: LengthUncertainty | None = None
    """Standard uncertainty (k = 1) of every certified length of the artefact, a number or a formula of the length as
    `"0.1 + 0.25·L/1000"`; `U_um` with `k` may stand for it."""
    U_um: LengthUncertainty | None = None
    """Expanded uncertainty as the artefact's certificate states it, in place of `u_um`: a number, or a formula of the length
    as `"0.2 + 0.5·L/1000"` or `"Q[0.2; 0.5·L/1000]"`, L in mm; needs `k` or `degrees_of_freedom`."""
    k: Factor | None = None
    """Coverage factor of `U_um`, or of a column `reference_U_um`."""
    degrees_of_freedom: Freedom | None = None
    """Effective degrees of freedom by the certificate; without `k` the factor is Student's t for 95 % by them."""
    cte_per_k: AnyFloat = 0.0
    """Coefficient of thermal expansion of the artefact, 1/K; its recorded temperature `temp_artefact_c` is corrected
    by it."""
    certificate: CertificateFile | None = None
    """The artefact's own certificate, that the results are traceable by."""

    @model_validator(mode="before")
    @classmethod
    def _expanded(cls, data: Any) -> Any:
        return with_standard_uncertainty(data, columns=cls.with_references)

    @model_validator(mode="after")
    def _uncertainty_of_something(self) -> Self:
        if self.degrees_of_freedom is not None and self.u_um is None and not self.with_references:
            raise ValueError(
                "degrees_of_freedom is given without an uncertainty: give U_um or u_um too, or leave it out"
            )
        if self.u_um is not None and self.length_mm is None and not self.with_references:
            raise ValueError("u_um is given without length_mm: give both, or neither for an uncalibrated artefact")
        if abs(self.cte_per_k) > 1e-3:
            raise ValueError(
                f"cte_per_k = {self.cte_per_k:g} is no expansion coefficient: steel has 11.5e-6 per kelvin"
            )
        return self

    def u_of(self, lengths_mm: Floats | float) -> Floats:
        """Standard uncertainty of certified lengths, µm, as stated for them; 0 where nothing is."""
        if isinstance(self.u_um, Growing):
            return self.u_um.at(lengths_mm)
        return np.full(np.shape(lengths_mm), self.u_um or 0.0)

    @property
    def certified(self) -> bool:
        """Whether lengths can be compared with it."""
        return self.length_mm is not None

    @property
    def nominal_only(self) -> bool:
        """Whether the job says that nothing of it is certified."""
        return False

    @property
    def traced(self) -> bool:
        """Whether what is found rests on something of it that is certified, and so on its certificate."""
        return self.certified


class ReferencedFacts(ArtefactFacts):
    """``[artefact]`` of a kind whose certified figures stand in the recording.

    ``nominal`` says that those figures are nominal only: their common scale then stays free.
    """

    with_references: ClassVar[bool] = True

    nominal: bool = False
    """Whether the references in the recording are nominal only: their common scale then stays free."""

    _largest_um: float | None = PrivateAttr(default=None)
    _covariances: tuple[tuple[int, ...], tuple[Floats, ...]] = PrivateAttr(default=((), ()))

    def with_largest(self, u_um: float) -> Self:
        """The same, of whose points by themselves at most this is stated: it holds for points of which nothing is."""
        found = self.model_copy()
        found._largest_um = u_um
        return found

    @property
    def of_other_points(self) -> Self:
        """What is stated of points of which nothing is stated by themselves, as those of a plan."""
        by_points = self.u_um is None and self._largest_um is not None
        return self.model_copy(update={"u_um": self._largest_um}) if by_points else self

    def with_covariances(self, numbers: Sequence[int], covariances: Sequence[Floats]) -> Self:
        """The same with the covariances that a digital certificate gives of its points.

        Parameters
        ----------
        numbers : of the f points.
        covariances : (f, f) µm², for the distances, or for each coordinate.
        """
        found = self.model_copy()
        found._covariances = tuple(numbers), tuple(covariances)
        return found

    def covariances_at(self, numbers: Ints) -> tuple[Ints, tuple[Floats, ...]]:
        """Which certified points those of some numbers (n,) are, and covariances (f, f) µm²; none where one is another."""
        places = {number: i for i, number in enumerate(self._covariances[0])}
        if not places or not set(numbers.tolist()) <= places.keys():
            return np.zeros(0, dtype=np.int64), ()
        index = np.array([places[number] for number in numbers.tolist()], dtype=np.int64)
        return index, self._covariances[1]

    @model_validator(mode="after")
    def _nominal_or_certified(self) -> Self:
        if self.nominal and (self.u_um is not None or self.length_mm is not None):
            raise ValueError(
                "nominal = true says that the recording's references are not certified: leave out length_mm and u_um"
            )
        return self

    @property
    def certified(self) -> bool:
        """Whether lengths can be compared with it."""
        return not self.nominal

    @property
    def nominal_only(self) -> bool:
        """See :attr:`ArtefactFacts.nominal_only`."""
        return self.nominal
