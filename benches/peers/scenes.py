"""The seven scenes of the work-precision chart, for the other codes.

SI units, the world's z up, gravity (0, 0, -9.81) but for the spring; the base is clamped or led, nothing is
damped, and 101 equal times from 0 to T are sampled. A frame R = [d1 d2 d3] turns body into world vectors,
d3 is the tangent.
"""

from dataclasses import dataclass
from math import cos, pi, sin, sqrt
from typing import Callable

import numpy as np

SAMPLES = 101
SHEAR = 27 / 28  # the shear correction of the extensible model


@dataclass(frozen=True)
class Motion:
    """One coordinate with its first and second derivative."""

    value: float = 0.0
    rate: float = 0.0
    acceleration: float = 0.0


@dataclass(frozen=True)
class Rod:
    """Length, stiffnesses and masses; EA and GA are those of the extensible codes, GA with its correction."""

    length: float
    radius: float
    young: float
    shear: float
    density: float
    EI: float
    GJ: float
    EA: float
    GA: float
    rhoA: float
    rhoI: float


@dataclass(frozen=True)
class Scene:
    name: str
    rod: Rod
    T: float
    frame: np.ndarray  # of the base at t = 0
    planar: bool = False
    gravity: float = 9.81
    impulsive: bool = False  # no reaction is scored
    rest_curvature: tuple[float, float, float] = (0.0, 0.0, 0.0)
    shake: tuple[Callable | None, Callable | None] = (None, None)  # motion of the base along x and z
    crank: float = 0.0  # radius of the crank
    turn: Callable | None = None  # its angle about the world's z axis
    load: Callable | None = None  # time -> force and moment on the tip, in the world's frame

    @property
    def times(self) -> np.ndarray:
        return np.linspace(0.0, self.T, SAMPLES)

    @property
    def hangs(self) -> bool:
        """Whether the rod hangs in equilibrium at t = 0; an extensible code starts from its own."""
        return self.gravity > 0 and not self.impulsive

    def base(self, t: float) -> np.ndarray:
        """Position of the base."""
        if self.turn is not None:
            psi = self.turn(t).value
            return np.array([self.crank * cos(psi), self.crank * sin(psi), 0.0])
        x, z = (0.0 if m is None else m(t).value for m in self.shake)
        return np.array([x, 0.0, z])

    def base_frame(self, t: float) -> np.ndarray:
        """Rotation of the base."""
        psi = 0.0 if self.turn is None else self.turn(t).value
        return np.array([[cos(psi), -sin(psi), 0], [sin(psi), cos(psi), 0], [0, 0, 1]]) @ self.frame


def round_rod(length: float, radius: float, young: float, shear: float, density: float) -> Rod:
    """A rod of circular section."""
    A, I = pi * radius**2, pi * radius**4 / 4
    return Rod(
        length,
        radius,
        young,
        shear,
        density,
        EI=young * I,
        GJ=2 * shear * I,
        EA=young * A,
        GA=SHEAR * shear * A,
        rhoA=density * A,
        rhoI=density * I,
    )


def swing(amplitude: float, omega: float, ramp: float) -> Callable[[float], Motion]:
    """amplitude * r(t) * sin(omega t), where r rises from 0 to 1 as a half cosine over the time `ramp`."""

    def motion(t: float) -> Motion:
        s, c, k = sin(omega * t), cos(omega * t), pi / ramp
        r, r1, r2 = 1.0, 0.0, 0.0
        if t < ramp:
            r, r1, r2 = (1 - cos(k * t)) / 2, k * sin(k * t) / 2, k * k * cos(k * t) / 2
        return Motion(
            amplitude * r * s,
            amplitude * (r1 * s + r * omega * c),
            amplitude * (r2 * s + 2 * r1 * omega * c - r * omega**2 * s),
        )

    return motion


def spin_up(t: float) -> Motion:
    """Angle of the crank: its rate rises to 2 pi as a half cosine over 0.5 s."""
    if t >= 0.5:
        return Motion(2 * pi * (t - 0.25), 2 * pi, 0.0)
    k = 2 * pi
    return Motion(pi * (t - sin(k * t) / k), pi * (1 - cos(k * t)), pi * k * sin(k * t))


def bump(t: float, start: float, width: float) -> float:
    """sin^2 pulse on [start, start + width]."""
    x = (t - start) / width
    return sin(pi * x) ** 2 if 0 < x < 1 else 0.0


def pulse_load(t: float) -> tuple[list[float], list[float]]:
    return [0.5 * bump(t, 0, 0.2), 0.3 * bump(t, 0.1, 0.2), 0.0], [0.0, 0.0, 2e-3 * bump(t, 0, 0.2)]


def spring_load(t: float) -> tuple[list[float], list[float]]:
    return [0.0, 0.0, -bump(t, 0, 0.05)], [0.0, 0.0, 0.0]


def helix(radius: float, pitch: float, turns: float) -> tuple[float, np.ndarray, tuple[float, float, float]]:
    """Length, base frame and rest curvature of a coil along -z that starts at (radius, 0, 0)."""
    b = pitch / (2 * pi)
    c = sqrt(radius**2 + b**2)
    d3, d1 = np.array([0, radius, -b]) / c, np.array([-1.0, 0, 0])
    return turns * 2 * pi * c, np.stack([d1, np.cross(d3, d1), d3], axis=1), (0.0, radius / c**2, -b / c**2)


def scenes() -> dict[str, Scene]:
    along_x = np.array([[0, 0, 1], [0, 1, 0], [-1, 0, 0]], float)
    down = np.array([[-1, 0, 0], [0, 1, 0], [0, 0, -1]], float)
    rubber = round_rod(1.0, 5e-3, 5e6, 5e6 / 3, 1100.0)
    keratin = round_rod(0.25, sqrt(1.5e-9 / pi), 3.89e9, 0.89e9, 1320.0)
    coil, base, curvature = helix(0.02, 0.01, 4)
    # the umbilical's section is given by its stiffnesses; the radius is that of its rotary inertia, and the
    # moduli are such that a code that takes a radius and moduli gets bending and torsion right
    a = 0.015
    line = Rod(
        50.0,
        a,
        100 / (pi * a**4 / 4),
        77 / (pi * a**4 / 2),
        1.2 / (pi * a**2),
        EI=100.0,
        GJ=77.0,
        EA=5e8,
        GA=2e8,
        rhoA=1.2,
        rhoI=1.2 * a**2 / 4,
    )
    return {
        s.name: s
        for s in (
            Scene("rope", rubber, 1.0, along_x, planar=True, impulsive=True),
            Scene(
                "wire",
                round_rod(1.0, 1e-3, 2e11, 2e11 / 2.6, 7850.0),
                2.0,
                down,
                planar=True,
                shake=(swing(0.02, 4 * pi, 0.5), None),
            ),
            Scene("pulse", rubber, 1.0, down, load=pulse_load),
            Scene(
                "spring",
                round_rod(coil, 1e-3, 2e11, 2e11 / 2.6, 7850.0),
                0.2,
                base,
                gravity=0.0,
                rest_curvature=curvature,
                load=spring_load,
            ),
            Scene("hair", keratin, 0.65, along_x, planar=True, impulsive=True),
            Scene("spin", rubber, 1.5, down, crank=0.1, turn=spin_up),
            Scene(
                "umbilical",
                line,
                24.0,
                down,
                planar=True,
                shake=(swing(1.0, pi / 4, 8.0), swing(0.5, pi / 3, 8.0)),
            ),
        )
    }


def coil_pose(scene: Scene, s: float) -> tuple[np.ndarray, np.ndarray]:
    """Position and frame of the unstressed rod at arc length s, relative to the base at rest."""
    k = np.array(scene.rest_curvature)
    e3 = np.array([0.0, 0.0, 1.0])
    size = np.linalg.norm(k)
    if size == 0:
        return s * scene.frame[:, 2], scene.frame
    K = np.array([[0, -k[2], k[1]], [k[2], 0, -k[0]], [-k[1], k[0], 0]]) / size
    angle = size * s
    turn = np.eye(3) + sin(angle) * K + (1 - cos(angle)) * K @ K
    shift = s * e3 + (1 - cos(angle)) / size * (K @ e3) + (s - sin(angle) / size) * (K @ K @ e3)
    return scene.frame @ shift, scene.frame @ turn


def chords(scene: Scene, stations: np.ndarray) -> tuple[np.ndarray, list[np.ndarray]]:
    """Points of the unstressed rod, and the frames of the straight pieces between them, d3 along each."""
    points = np.array([coil_pose(scene, s)[0] for s in stations])
    frames = []
    for i in range(len(stations) - 1):
        d3, near = points[i + 1] - points[i], coil_pose(scene, (stations[i] + stations[i + 1]) / 2)[1][:, 0]
        d3 /= np.linalg.norm(d3)
        d1 = near - (near @ d3) * d3
        d1 /= np.linalg.norm(d1)
        frames.append(np.stack([d1, np.cross(d3, d1), d3], axis=1))
    return points, frames
