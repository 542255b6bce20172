"""Twist of a bridge's beam: an effect for cmm_uq from a package of its own."""

from collections.abc import Sequence

from cmm_uq.effect import ARCSECOND, Effect, Floats, Parameter, Points, say, turned, unit


class BeamTwist(Effect):
    """The beam, held at both ends, twists under the ram in front of it, most in the middle of its travel T from y0."""

    name = "beam_twist"
    title = say("Twist of the beam")
    formula = "e = ε × what carriage y carries, ε_y = twist·(1 − (2(y − y0)/T − 1)²)"
    mechanism = "guideway"
    points_to = say(
        "the beam twists under the weight of the ram: check the ram's counterbalance and how the beam is held"
    )
    coefficients = (Parameter("twist_arcsec", unit("″"), 10.0),)

    def basis(self, points: Points, shape: Sequence[float] = ()) -> Floats:
        low, high = points.machine.travel("y")
        place = 2 * (points.readings["y"] - low) / (high - low) - 1
        return turned(points, "y", "y", ARCSECOND * (1 - place**2))
