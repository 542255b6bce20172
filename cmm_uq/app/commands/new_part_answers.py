"""A new job of a part from answers: tables that are held against the readers of a job one by one, and the machine's files."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from pydantic import ValidationError

from cmm_uq.base.errors import CmmUqError
from cmm_uq.base.files.content import content_of
from cmm_uq.base.files.limits import TABLE_BYTES
from cmm_uq.jobs.file_names import RESULTS
from cmm_uq.jobs.part.characteristic import CharacteristicFacts
from cmm_uq.jobs.part.checks import unfit
from cmm_uq.jobs.part.common import members
from cmm_uq.jobs.part.drawing_checked import probed_of
from cmm_uq.jobs.part.freedoms import freedoms
from cmm_uq.jobs.part.job import POSTERIOR
from cmm_uq.jobs.part.probed import Probed

Facts = dict[str, Any]

FOLDER = "machine"
_WHOLE = (".pdf", ".xml")
_FIX = "Name the certificate (PDF), or the folder that the machine's report wrote"


@dataclass
class Answers:
    """What was said so far; what is empty stays that of the example.

    Parameters
    ----------
    part, stylus, alignment : keys of these tables.
    machine : files that state the machine, by name inside the job's folder.
    features, characteristics : tables, in order.
    """

    part: Facts = field(default_factory=dict)
    stylus: Facts = field(default_factory=dict)
    alignment: Facts = field(default_factory=dict)
    machine: Mapping[str, bytes] = field(default_factory=dict)
    features: list[Facts] = field(default_factory=list)
    characteristics: list[Facts] = field(default_factory=list)
    probed: dict[str, Probed] = field(default_factory=dict)

    @property
    def certificate(self) -> str:
        """What ``[machine_state] certificate`` names: the certificate alone, or the folder of all files."""
        return next((name for name in self.machine if name.lower().endswith(_WHOLE)), FOLDER)

    def free_name(self, name: str) -> str:
        """A name that no feature has.

        Raises
        ------
        CmmUqError : one has it.
        """
        return _free(name, self.probed)

    def free_tolerance(self, name: str) -> str:
        """A name that no tolerance has; see :meth:`free_name`."""
        return _free(name, [one["name"] for one in self.characteristics])

    def add_feature(self, given: Facts) -> None:
        """Take a feature.

        Raises
        ------
        CmmUqError : the readers of a job refuse it.
        """
        self.probed[given["name"]] = probed_of(given)
        self.features.append(given)

    def aligned(self, datums: Sequence[str]) -> Facts:
        """``[alignment]`` by datums in order, or by best fit where there are none.

        Raises
        ------
        CmmUqError : a name of nothing, or datums that leave the part free.
        """
        if not datums:
            return {"best_fit": True}
        named = [tuple(self.probed[each] for each in members(name, self.probed)) for name in datums]
        if free := freedoms(named):
            raise CmmUqError(f"these datums leave free {', '.join(free)}", fix="Add a feature that fixes it")
        return {"datums": list(datums)}

    def add_characteristic(self, given: Facts) -> None:
        """Take a tolerance.

        Raises
        ------
        CmmUqError : the readers of a job refuse it.
        """
        try:
            facts = CharacteristicFacts.model_validate(given)
        except ValidationError as error:
            raise CmmUqError(error.errors()[0]["msg"].removeprefix("Value error, ")) from None
        for name in (*facts.features, *facts.datums):
            members(name, self.probed)
        if found := unfit(facts, self.probed):
            raise CmmUqError(found[0], fix=found[2])
        self.characteristics.append(given)


def _free(name: str, taken: Any) -> str:
    if name in taken:
        raise CmmUqError(f"{name!r} is there already", fix="Give it another name")
    return name


def certificate_files(path: Path) -> dict[str, bytes]:
    """What states a machine, as it goes into the folder of a part's job.

    Parameters
    ----------
    path : the certificate, results.json, or the folder of both.

    Raises
    ------
    CmmUqError : nothing of the kind lies there.
    """
    if path.is_dir():
        whole = sorted(one for one in path.glob("certificate*.pdf") if one.is_file())
        chosen = whole[:1] or [path / RESULTS, path / POSTERIOR]
    else:
        chosen = [path] if path.suffix.lower() in _WHOLE else [path, path.parent / POSTERIOR]
    return {f"{FOLDER}/{one.name}": content_of(one, TABLE_BYTES, _FIX) for one in chosen}
