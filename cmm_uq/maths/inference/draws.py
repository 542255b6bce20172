"""The draws of a posterior by name and by chain, as other programs read them; what noise leaves uncertain of a sum.

A chain is the path of one walker of one ensemble, as the sampler ran it. Draws of several walkers strung together would look
independent to a program that estimates autocorrelation along a chain, and be counted several times over. Where only some draws
were kept, a chain is an ensemble, with the paths of its walkers one behind the other.
"""

from __future__ import annotations

import io
import zipfile
from collections.abc import Iterator, Mapping
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np
import scipy

from cmm_uq.base.errors import CmmUqError, suggestion
from cmm_uq.base.points import Floats, Ints
from cmm_uq.base.values import dataclass
from cmm_uq.maths.inference.ensembles import ENSEMBLES, bulk_ess, normal_scores, rhat, split
from cmm_uq.maths.inference.noise import Components, Sizes
from cmm_uq.maths.inference.slow import root

if TYPE_CHECKING:
    import pandas as pd

EPOCH = (1980, 1, 1, 0, 0, 0)  # of the members of an archive, the first that the format knows: the clock is never read
_COVERAGE = 0.975


@dataclass(frozen=True, eq=False, repr=False)
class Draws(Mapping[str, Floats]):
    """Draws of named quantities; by its name, each is an array (chain, draw)."""

    units: Mapping[str, str]  # of each quantity, as printed, by its name; in the order of ``array``
    array: Floats  # (chain, draw, quantity). Chains of one ensemble follow each other.
    every: int = 1  # which of the draws were kept: each, or each second, …

    def __getitem__(self, name: str) -> Floats:
        if name not in self.units:
            raise KeyError(f"{name!r}: {suggestion(name, self.names)}")
        return np.asarray(self.array[:, :, self.names.index(name)])

    def __iter__(self) -> Iterator[str]:
        return iter(self.units)

    def __len__(self) -> int:
        return len(self.units)

    def __repr__(self) -> str:
        chains, draws, _ = self.array.shape
        return f"Draws of {', '.join(self.names)}: {chains} chains of {draws}"

    @property
    def names(self) -> list[str]:
        return list(self.units)

    @cached_property
    def _scores(self) -> Floats:
        return normal_scores(split(self.array))

    @cached_property
    def rhat_max(self) -> float:
        """Largest rank-normalised split R-hat, each walker a chain; ``nan`` with nothing drawn."""
        return rhat(self.array, self._scores) if len(self) else float("nan")

    @cached_property
    def ess_bulk_min(self) -> float:
        """Smallest bulk effective sample size, each walker a chain; ``nan`` with nothing drawn."""
        return bulk_ess(self.array, self._scores) if len(self) else float("nan")

    @cached_property
    def covariance(self) -> pd.DataFrame:
        """Covariance of the quantities, each in its unit."""
        import pandas as pd

        flat = self.array.reshape(-1, len(self))
        matrix = np.atleast_2d(np.cov(flat, rowvar=False)) if len(self) else np.zeros((0, 0))
        return pd.DataFrame(matrix, index=self.names, columns=self.names)

    def thinned(self, most: int) -> Draws:
        """Every so many-th draw of each chain, so that there are at most so many numbers."""
        chains, draws, quantities = self.array.shape
        kept = max(1, most // max(1, chains * quantities))
        every = -(-draws // kept)
        return Draws(self.units, np.ascontiguousarray(self.array[:, ::every]), every * self.every)

    def as_npz(self) -> bytes:
        """NumPy's archive of the draws; always the same bytes.

        ``centre`` (quantity,) is their mean, ``draws`` (chain, draw, quantity) are deviations from it, which single precision
        has to 10⁻⁷ of themselves; beside them ``names``, ``units`` and ``every``.
        """
        centre = self.array.mean(axis=(0, 1))
        arrays = {
            "centre": centre.astype("<f8"), "draws": np.ascontiguousarray(self.array - centre, dtype="<f4"),
            "names": _texts(self.units), "units": _texts(self.units.values()), "every": np.array(self.every, dtype="<i8"),
        }  # fmt: skip
        archive = io.BytesIO()
        with zipfile.ZipFile(archive, "w", zipfile.ZIP_STORED) as members:
            for name, array in arrays.items():
                member = io.BytesIO()
                np.lib.format.write_array(member, array, version=(1, 0) if array.dtype.kind != "U" else (3, 0))
                entry = zipfile.ZipInfo(f"{name}.npy", EPOCH)
                entry.create_system = 3  # the same on every system
                members.writestr(entry, member.getvalue())
        return archive.getvalue()

    @classmethod
    def of_npz(cls, content: bytes, where: str) -> Draws:
        fix = "Give posterior.npz as cmm-uq report wrote it"
        try:
            with zipfile.ZipFile(io.BytesIO(content)) as archive:
                if sum(member.file_size for member in archive.infolist()) > 2 * max(len(content), 1):
                    raise ValueError("its parts are larger than the file")
            with np.load(io.BytesIO(content), allow_pickle=False) as arrays:
                names, units, every = arrays["names"].tolist(), arrays["units"].tolist(), int(arrays["every"])
                array = np.asarray(arrays["centre"] + arrays["draws"].astype(np.float64))
        except (ValueError, KeyError, TypeError, EOFError, OSError, NotImplementedError, zipfile.BadZipFile) as error:
            raise CmmUqError(f"is no file of draws ({error})", where=where, fix=fix) from None
        if array.ndim != 3 or not array.size or len(names) != array.shape[2] or len(units) != len(names):
            raise CmmUqError(f"draws {array.shape} do not fit {len(names)} names", where=where, fix=fix)
        if not np.isfinite(array).all():
            raise CmmUqError("a draw is no finite number", where=where, fix=fix)
        return cls(dict(zip(map(str, names), map(str, units), strict=True)), array, every)

    def flat(self) -> dict[str, Floats]:
        return {name: np.ascontiguousarray(self.array[:, :, i]).ravel() for i, name in enumerate(self.names)}

    def to_arviz(self) -> Any:
        """The draws as ``arviz.InferenceData``, group ``posterior``."""
        try:
            import arviz
        except ImportError as error:
            raise CmmUqError("ArviZ is not installed", fix='Install it: pip install "arviz>=0.20,<1"') from error
        return arviz.from_dict(posterior=dict(self))


def by_chain(values: Floats, steps: int) -> Floats:
    """Draws (N, …), ensembles, steps and walkers in this order, as chains (chain, draw, …), each the path of a walker."""
    walkers, rest = len(values) // (ENSEMBLES * steps), values.shape[1:]
    by_step = values.reshape(ENSEMBLES, steps, walkers, *rest)
    return np.asarray(by_step.swapaxes(1, 2).reshape(ENSEMBLES * walkers, steps, *rest))


def evenly(count: int, most: int) -> Ints:
    """Which of so many draws, ensembles, steps and walkers in this order, are kept where at most so many are wanted."""
    return np.linspace(0, count - 1, min(most, count)).astype(np.int64)


def by_ensemble(values: Floats, steps: int, count: int) -> Floats:
    """Draws (N, …) kept :func:`evenly` of ``count`` as chains (chain, draw, …), each one ensemble.

    Along a chain the walkers' paths follow each other, each in the order of its steps: what two draws of a walker have in
    common stays to be seen, as it would not where walkers take turns.
    """
    walkers = count // (ENSEMBLES * steps)
    kept = evenly(count, len(values))
    order = np.lexsort((kept // walkers, kept % walkers, kept // (walkers * steps)))
    return np.asarray(values[order].reshape(ENSEMBLES, -1, *values.shape[1:]))


def _texts(words: Any) -> Any:
    listed = list(words)
    return np.array(listed, dtype=f"<U{max([1, *map(len, listed)])}")


def uncertainty_of_sum(
    components: Components, sizes: Sizes, weights: Floats, beside: float = 0.0
) -> tuple[float, float]:
    """Standard uncertainty, and half the 95 % interval, of a sum of observations with weights (m,).

    Given the sizes the sum is normal; over their draws it is a mixture of normal distributions about one value. ``beside``:
    standard uncertainty of a normal contribution that is no noise, in the unit of the sum.
    """
    variances, _ = components.variances(sizes)
    squares = components.shares.T @ np.asarray(components.turn @ weights) ** 2
    variance = variances @ squares + components.slow_along(weights, sizes) + beside**2
    u, sd = float(np.sqrt(variance.mean())), np.sqrt(variance)
    if not u:
        return 0.0, 0.0
    sd = np.maximum(sd, 1e-12 * u)
    half = root(
        lambda t: float(scipy.special.ndtr(t * u / sd).mean()) - _COVERAGE, 0.0, float(sd.max() / u) * 2.0, 1e-9
    )
    return u, half * u
