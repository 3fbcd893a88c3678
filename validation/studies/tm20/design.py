"""The experiments of TM20, and the results in its Tables 2 to 5."""

from __future__ import annotations

from dataclasses import dataclass

STROKE = 0.1  # m
RATIO = 0.4
"""b, share of a cycle in which the container moves."""
FILL_HEIGHT = 0.067  # m
DEPTH = 0.04  # m; the paper does not tell how deep its containers are across the motion
SPEEDS = tuple(range(12, 61, 3))  # 1/min
TOLERANCE = 0.5e-3
"""ε̄ up to which the surface counts as a straight line [m]."""
FRAMES = 250
"""Images of a cycle, whatever its length: the camera's rate follows the speed."""
PLACES = 81
"""Points of a profile, from wall to wall."""


@dataclass(frozen=True, slots=True)
class Published:
    """TM20's published results for one container.

    Attributes:
        damping_ratio, natural_frequency: MOSM, M1 (Table 4) [1, rad/s].
        fastest: n_max [1/min].
        identified: max SEOE of SOSM M1, SOSM M2, MOSM M1, MOSM M2 (Table 3) [deg].
        validated: max SEOE of the quintic, MOSM M1 (Table 4) [deg].
        effective: max η_eff, Δη_appr, Δη_simul (Table 5) [mm].
    """

    damping_ratio: float
    natural_frequency: float
    fastest: int
    identified: tuple[float, float, float, float]
    validated: float
    effective: tuple[float, float, float]


@dataclass(frozen=True, slots=True)
class Geometry:
    """A rectangular container of the study, with TM20's results.

    Attributes:
        number: of the paper.
        width: along the motion [m].
        published: what the paper says of it.
    """

    number: int
    width: float
    published: Published


GEOMETRIES = tuple(
    Geometry(number, width, Published(*published))
    for number, (width, published) in enumerate(
        (
            (0.060, (0.042, 22.498, 48, (0.785, 0.748, 0.823, 0.811), 1.037, (1.49, 0.06, 0.16))),
            (0.040, (0.050, 27.347, 57, (1.118, 0.991, 1.265, 1.240), 1.956, (1.36, 0.07, 0.13))),
            (0.070, (0.036, 21.001, 45, (0.570, 0.524, 0.602, 0.589), 0.874, (1.61, 0.07, 0.16))),
            (0.047, (0.042, 25.351, 54, (0.910, 0.868, 0.965, 0.940), 1.718, (1.46, 0.07, 0.16))),
            (0.079, (0.029, 19.622, 42, (0.444, 0.409, 0.471, 0.459), 0.620, (1.64, 0.06, 0.15))),
            (0.054, (0.039, 23.729, 51, (0.821, 0.822, 0.852, 0.827), 1.461, (1.56, 0.08, 0.20))),
        ),
        start=1,
    )
)


@dataclass(frozen=True, slots=True)
class Series:
    """A motion law, and how often each experiment with it is repeated."""

    law: str
    repetitions: int


IDENTIFICATION = Series("harmonic", 10)
"""In place of the paper's acceleration pulse, which it shows in a figure alone; see docs."""
VALIDATION = Series("quintic", 5)
