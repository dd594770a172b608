"""Andrews' squeezing mechanism, problem A03 of the multibody benchmark library."""

from __future__ import annotations

from mbs.components import Body, Revolute, Spring
from mbs.mechanism import Mechanism

_SOURCE = (
    "Schiehlen 1990, Multibody Systems Handbook; Hairer & Wanner 1996, section VII.7; Mazzia &"
    " Magherini 2008, Test Set for IVP Solvers, Andrews' squeezing mechanism, whose initial"
    " configuration"
    " this is"
)
_GUESS = {
    "beta": -0.0617138900142764496358948458001,
    "theta": 0.0,
    "gamma": 0.455279819163070380255912382449,
    "phi": 0.222668390165885884674473185609,
    "delta": 0.487364979543842550225598953530,
    "omega": -0.222668390165885884674473185609,
    "epsilon": 1.23054744454982119249735015568,
}
_A, _B, _C = (-0.06934, -0.00227), (-0.03635, 0.03273), (0.014, 0.072)
_OF, _FE, _BE, _EG, _AG, _AH, _HE = 0.007, 0.028, 0.035, 0.020, 0.040, 0.040, 0.020


def andrews_squeezer() -> Mechanism:
    """Andrews' squeezing mechanism: seven bodies, three loops that share the point E.

    The crank OF is driven, and a spring connects the points D and C. The angles beta, theta, gamma,
    phi, delta, omega and epsilon are q1 .. q7 of the sources. Gravity does not act. The benchmark
    starts at rest with the drive `tau={"beta": 0.033}` [N m]. The mechanism is planar, so that only
    the published moments of inertia about z have an effect.

    Source: Hairer & Wanner 1996, section VII.7; Mazzia & Magherini 2008.
    """
    m = Mechanism("andrews_squeezer", gravity=(0, 0, 0), source=_SOURCE, guess=_GUESS)
    crank = m.add(_lamina("K1", 0.04325, (0.00092, 0), 2.194e-6))
    rod = m.add(_lamina("K2", 0.00365, (-0.0115, 0), 4.410e-7))
    triangle = m.add(_lamina("K3", 0.02373, (0.01043, -0.01874), 5.255e-6))
    eg = m.add(_lamina("K4", 0.00706, (0, 0.01421 - _EG), 5.667e-7))
    ag = m.add(_lamina("K5", 0.07050, (0.02308, 0.00916), 1.169e-5))
    he = m.add(_lamina("K6", 0.00706, (_HE - 0.01421, 0), 5.667e-7))
    ah = m.add(_lamina("K7", 0.05498, (-0.00449, -0.01228), 1.912e-5))

    m.connect(m.world, Revolute("beta", actuated=True), crank)
    m.connect(crank.at(_OF), Revolute("theta"), rod)
    m.connect(m.world.at(*_B), Revolute("gamma"), triangle)
    m.connect(m.world.at(*_A), Revolute("delta"), ag)
    m.connect(ag.at(_AG), Revolute("phi"), eg)
    m.connect(m.world.at(*_A), Revolute("epsilon"), ah)
    m.connect(ah.at(0, -_AH), Revolute("omega"), he)
    ends = {"E3": triangle.at(0, -_BE), "E4": eg.at(0, -_EG), "E6": he.at(_HE)}
    for name, end in ends.items():
        closing = Revolute(name)
        m.connect(rod.at(-_FE), closing, end)
        m.cut(closing)
    D = triangle.at(0.02, -0.018)
    m.add(Spring("spring", D, m.world.at(*_C), stiffness=4530, length=0.07785))
    return m


def _lamina(name: str, mass: float, com: tuple[float, float], about_com: float) -> Body:
    """Return a plane body.

    `mass` in [kg], centre of mass `com` (x, y) in [m], moment of inertia `about_com` about the z
    axis through it in [kg m^2].
    """
    half = about_com / 2
    return Body(name, mass=mass, com=(*com, 0), inertia=(half, half, about_com))
