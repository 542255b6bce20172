"""Aligning a laser digitizer on the reference sphere, and where its mount lies (Harris 2004 sections 4.4 and 5.3).

An alignment is the scale reading at which the origin of the scan plane falls on the centre of the sphere. Three of them,
in different attitudes, tell the offset [U1 V1 W1] of the mount and the place of the sphere: nine equations for six
unknowns, solved all at once by least squares.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from cmm_uq.base.errors import CmmUqError
from cmm_uq.base.points import Floats
from cmm_uq.machine.physics.digitizer import euler_313
from cmm_uq.maths.geometry import fit_sphere


@dataclass(frozen=True, eq=False)
class Alignment:
    """One pose of the digitizer, aligned.

    Parameters
    ----------
    alpha, beta, gamma : Euler angles 3-1-3, rad.
    reading : (3,) [D0 E0 F0], the scale reading with the scan plane's origin at the centre of the sphere, mm.
    covariance : (3, 3) of the reading, mm².
    """

    alpha: float
    beta: float
    gamma: float
    reading: Floats
    covariance: Floats

    @property
    def attitude(self) -> Floats:
        """(3, 3) columns u, v, w in machine axes."""
        return euler_313(self.alpha, self.beta, self.gamma)

    def from_sphere(self, scan: Floats, readings: Floats) -> Floats:
        """Coordinates (n, 3) relative to the reference sphere, as the digitizer reports them uncompensated (eq. 9, 14)."""
        return np.asarray(scan @ self.attitude[:, :2].T + readings - self.reading)


def align_on_sphere(
    scan: Floats, readings: Floats, alpha: float, beta: float, gamma: float, *, u_point: float | None = None
) -> Alignment:
    """Alignment from a scan of the reference sphere.

    The covariance is that of the fitted centre, σ²(JᵀJ)⁻¹; systematic lines (the ball's form, the scales) are added to it.

    Parameters
    ----------
    scan : (n, 2) u, v in the scan plane, mm.
    readings : (n, 3) scale readings, mm.
    alpha, beta, gamma : attitude, rad.
    u_point : standard uncertainty of a point, mm; from the residuals when left out.

    Raises
    ------
    CmmUqError : the points do not determine a sphere.
    """
    sphere = fit_sphere(scan @ euler_313(alpha, beta, gamma)[:, :2].T + readings, u_point=u_point)
    return Alignment(alpha, beta, gamma, sphere.centre, sphere.covariance[:3, :3])


@dataclass(frozen=True, eq=False)
class MountOffset:
    """Offset of the mount from the digitizer's origin, and the centre of the reference sphere.

    Parameters
    ----------
    offset : (3,) [U1 V1 W1] in the digitizer's frame, mm.
    sphere : (3,) in the machine's home frame, mm.
    covariance : (6, 6) of offset and sphere, mm².
    residuals : (m, 3) readings less those that offset and sphere give, mm.
    chi_squared : weighted sum of their squares.
    degrees_of_freedom : 3m − 6.
    """

    offset: Floats
    sphere: Floats
    covariance: Floats
    residuals: Floats
    chi_squared: float
    degrees_of_freedom: int

    @property
    def u(self) -> Floats:
        """(3,) standard uncertainties of U1, V1, W1, mm."""
        return np.asarray(np.sqrt(np.diag(self.covariance)[:3]))


def mount_offset(alignments: Sequence[Alignment]) -> MountOffset:
    """Offset [U1 V1 W1] by weighted least squares over all components of all alignments (from eq. 16–18).

    Every alignment says D0 = S + E·[U1 V1 W1], S being the centre of the sphere.

    Parameters
    ----------
    alignments : three or more attitudes; two that turn about one axis only leave the offset along it unknown.

    Raises
    ------
    CmmUqError : the attitudes do not determine the offset.
    """
    rows = np.vstack([np.hstack([a.attitude, np.eye(3)]) for a in alignments]) if alignments else np.zeros((0, 6))
    if len(rows) < 6 or np.linalg.matrix_rank(rows, tol=1e-6) < 6:
        raise CmmUqError(
            f"{len(alignments)} alignments do not determine the offset of the mount",
            fix="Align in three attitudes that differ by turns about two axes, such as γ = 0° and 90°, and α = 90° and 180°",
        )
    whitened, readings = [], []
    for alignment, block in zip(alignments, np.split(rows, len(alignments)), strict=True):
        try:
            root = np.linalg.cholesky(alignment.covariance)
        except np.linalg.LinAlgError:
            raise CmmUqError(
                "the covariance of an alignment is not positive definite", fix="Give every reading an uncertainty"
            ) from None
        whitened.append(np.linalg.solve(root, block))
        readings.append(np.linalg.solve(root, alignment.reading))
    A, y = np.vstack(whitened), np.concatenate(readings)
    Q, R = np.linalg.qr(A)
    found = np.linalg.solve(R, Q.T @ y)
    inverse = np.linalg.inv(R)
    misfit = y - A @ found
    residuals = np.array([a.reading for a in alignments]) - (rows @ found).reshape(-1, 3)
    return MountOffset(found[:3], found[3:], inverse @ inverse.T, residuals, float(misfit @ misfit), len(y) - 6)


def three_alignment_offset(readings: Floats, u: Floats) -> tuple[Floats, Floats]:
    """Offset [U1 V1 W1] and its standard uncertainties by the closed form of Harris 2004 eq. 19–24, mm.

    It uses six of the nine equations with equal weight. The source prints u(U1) = 35.1 µm where (22) gives 15.9 µm.

    Parameters
    ----------
    readings : (3, 3) [D E F] of alignment 1 (α = β = 90°, γ = 0), 2 (the same, γ = 90°), 3 (α = 180°, β = 90°, γ = 0), mm.
    u : (3,) standard uncertainties of D, E, F, mm.
    """
    (D1, E1, F1), (_, E2, F2), (D3, E3, _) = readings
    offset = 0.5 * np.array([E1 - E2 + F2 - F1, E1 - E2 - F2 + F1, D1 - D3 + E3 - E1])
    u_uv, u_w = np.sqrt(0.5 * (u[1] ** 2 + u[2] ** 2)), np.sqrt(0.5 * (u[0] ** 2 + u[1] ** 2))
    return offset, np.array([u_uv, u_uv, u_w])
