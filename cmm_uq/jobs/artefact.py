"""``[artefact]``: what every kind of measurement says of its artefact."""

from __future__ import annotations

from typing import Any, ClassVar, Self

from pydantic import model_validator

from cmm_uq.jobs.certified_value import LENGTH, CertifiedValue
from cmm_uq.jobs.expanded import ExpandedUncertainty, with_standard_uncertainty
from cmm_uq.jobs.importing.keys import FileKeys
from cmm_uq.jobs.table import AnyFloat, Length, Table, Uncertainty
from cmm_uq.jobs.traceability import Traceability


class CertificateFile(FileKeys, Traceability):
    """The artefact's own certificate, and the file that its certified values are read from."""

    file: str | None = None
    """File of what is certified. A DCC (XML) gives number, laboratory, dates and certified values with their uncertainty, of
    every kind; a CSV or a workbook the distances or places of points by their number, which the recording then has not."""


class ArtefactFacts(Table):
    """``[artefact]``: what every kind of measurement has; a kind with more keys has a table of its own.

    ``U_um`` with ``k`` may stand for ``u_um``.
    Without ``length_mm`` the artefact is uncalibrated, unless its certified figures stand in the recording.

    Attributes
    ----------
    with_references : whether they do; its ``u_um`` may then stand without ``length_mm``.
    with_recording : whether there is one; otherwise what ``[machine]`` names is measured.
    with_earlier : whether two recordings of it at two dates can be compared.
    carries_probe : whether its recording itself says how far from the end of the ram each point was, as tip offsets do.
    form_key : key of the form deviation by its certificate, for a kind that has a form to be compared.
    certified_values : that the artefact's digital certificate may state, where they do not stand in the recording.
    instead : tables whose keys may stand in place of others.
    """

    instead: ClassVar[tuple[type[Table], ...]] = (ExpandedUncertainty,)
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
    u_um: Uncertainty | None = None
    """Standard uncertainty (k = 1) of what is certified of the artefact; `U_um` with `k` may stand for it."""
    cte_per_k: AnyFloat = 0.0
    """Coefficient of thermal expansion of the artefact, 1/K; its recorded temperature `temp_artefact_c` is corrected
    by it."""
    certificate: CertificateFile | None = None
    """The artefact's own certificate, that the results are traceable by."""

    @model_validator(mode="before")
    @classmethod
    def _expanded(cls, data: Any) -> Any:
        return with_standard_uncertainty(data)

    @model_validator(mode="after")
    def _uncertainty_of_something(self) -> Self:
        if self.u_um is not None and self.length_mm is None and not self.with_references:
            raise ValueError("u_um is given without length_mm: give both, or neither for an uncalibrated artefact")
        if abs(self.cte_per_k) > 1e-3:
            raise ValueError(
                f"cte_per_k = {self.cte_per_k:g} is no expansion coefficient: steel has 11.5e-6 per kelvin"
            )
        return self

    @property
    def certified(self) -> bool:
        """Whether lengths can be compared with it."""
        return self.length_mm is not None

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
