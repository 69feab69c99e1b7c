"""PyElastica: Cosserat rod, explicit position Verlet, no damping.

As its authors recommend: the step below the time a wave takes through an element, dt < dl sqrt(rho/E), and
for shear and twist below that through a radius; a clamp that holds the first node and the first element's
frame. With "clamp at centre" the rod starts half an element before its base, so that the held element is
centred on it: the error of a rigid first element, of first order, goes, and the force in that element is
the reaction. Where the stable step is too small for a whole run, it is sought by bisection over some
thousand steps, and the table tells what the scene would take.
"""

import time

import elastica as ea
import numpy as np

from scenes import Rod, Scene, chords
from score import Result, main, measure, row


class Simulator(ea.BaseSystemCollection, ea.Constraints, ea.Forcing):
    pass


class Base(ea.ConstraintBase):
    """Holds the first node and the first frame, and leads them as the scene says."""

    def __init__(self, *rest, scene: Scene, held: tuple[np.ndarray, np.ndarray], **more):
        super().__init__(*rest, **more)
        self.scene, self.held = scene, held  # first node and frame, seen from the base
        self.moves = scene.turn is not None or any(m is not None for m in scene.shake)
        self.pose(0.0)

    def pose(self, t: float) -> None:
        frame = self.scene.base_frame(t)
        self.position, self.directors = self.scene.base(t) + frame @ self.held[0], self.held[1] @ frame.T
        self.velocity, self.omega = np.zeros(3), np.zeros(3)
        if self.scene.turn is not None:
            rate = self.scene.turn(t).rate
            self.velocity = rate * np.array([-self.position[1], self.position[0], 0.0])
            self.omega = self.directors @ np.array([0.0, 0.0, rate])
        else:
            self.velocity[[0, 2]] = [0.0 if m is None else m(t).rate for m in self.scene.shake]

    def constrain_values(self, system, time):
        if self.moves:
            self.pose(float(time))
        system.position_collection[:, 0] = self.position
        system.director_collection[:, :, 0] = self.directors

    def constrain_rates(self, system, time):
        system.velocity_collection[:, 0] = self.velocity
        system.omega_collection[:, 0] = self.omega


class TipLoad(ea.NoForces):
    def __init__(self, scene: Scene):
        super().__init__()
        self.load = scene.load

    def apply_forces(self, system, time=0.0):
        system.external_forces[:, -1] += self.load(float(time))[0]

    def apply_torques(self, system, time=0.0):
        system.external_torques[:, -1] += system.director_collection[:, :, -1] @ np.array(
            self.load(float(time))[1]
        )


def stable_step(rod: Rod, n: int) -> float:
    """Estimate: sound through an element, shear and twist through a radius."""
    stretch = rod.length / n * np.sqrt(rod.rhoA / rod.EA)
    return float(min(stretch, np.sqrt(rod.rhoI / rod.GA)))


def build(scene: Scene, n: int, centred: bool):
    """The rod at its own equilibrium, and the simulator."""
    rod, h = scene.rod, scene.rod.length / (n - 0.5 if centred else n)
    back = h / 2 if centred else 0.0
    nodes = np.arange(n + 1) * h - back
    points, frames = chords(scene, nodes)
    places = (points + scene.base(0.0)).T
    body = ea.CosseratRod.straight_rod(
        n,
        places[:, 0],
        scene.frame[:, 2],
        scene.frame[:, 0],
        n * h,
        rod.radius,
        rod.density,
        youngs_modulus=rod.young,
        shear_modulus=rod.shear,
        position=places,
        directors=np.stack([f.T for f in frames], axis=2),
    )
    if scene.name == "umbilical":  # its section is not that of a solid rod
        body.shear_matrix[:] = np.diag([rod.GA, rod.GA, rod.EA])[:, :, None]
    if any(scene.rest_curvature):  # unstressed as it is
        body.compute_internal_forces_and_torques(0.0)
        body.rest_kappa[:], body.rest_sigma[:] = body.kappa, body.sigma
    if scene.hangs:
        weight = rod.rhoA * scene.gravity
        sag = weight * (rod.length * nodes - np.maximum(nodes, 0) ** 2 / 2) / rod.EA
        body.position_collection[:] += scene.frame[:, 2][:, None] * sag
    body.compute_internal_forces_and_torques(0.0)
    held = (
        scene.frame.T @ (body.position_collection[:, 0] - scene.base(0.0)),
        body.director_collection[:, :, 0] @ scene.frame,
    )
    simulator = Simulator()
    simulator.append(body)
    simulator.constrain(body).using(
        Base, scene=scene, held=held, constrained_position_idx=(0,), constrained_director_idx=(0,)
    )
    if scene.gravity:
        simulator.add_forcing_to(body).using(ea.GravityForces, acc_gravity=np.array([0, 0, -scene.gravity]))
    if scene.load is not None:
        simulator.add_forcing_to(body).using(TipLoad, scene=scene)
    simulator.finalize()
    return body, simulator


def reaction(scene: Scene, body, t: float, centred: bool) -> np.ndarray:
    """Force on the base: that in the first element, and what weight and inertia of the first node add."""
    force = body.director_collection[:, :, 0].T @ body.internal_stress[:, 0] / body.dilatation[0]
    if centred:
        return force
    if scene.turn is not None:
        turn = scene.turn(t)
        x, y, _ = scene.base(t)
        acceleration = turn.acceleration * np.array([-y, x, 0]) - turn.rate**2 * np.array([x, y, 0])
    else:
        acceleration = np.array(
            [0.0 if m is None else m(t).acceleration for m in (scene.shake[0], None, scene.shake[1])]
        )
    return force - body.mass[0] * (acceleration + np.array([0, 0, scene.gravity]))


def solve(scene: Scene, n: int, dt: float, centred: bool, span: float | None = None) -> Result:
    """Runs to T, or for the time `span` alone."""
    body, simulator = build(scene, n, centred)
    stepper, t = ea.PositionVerlet(), np.float64(0.0)
    stepper.step(simulator, t, np.float64(1e-14))  # compiles
    end = span or scene.T
    intervals = len(scene.times) - 1
    sub = max(1, int(np.ceil(end / intervals / dt - 1e-9)))
    h = np.float64(end / intervals / sub)
    tips, forces = [body.position_collection[:, -1].copy()], [reaction(scene, body, 0.0, centred)]
    start = time.process_time()
    for k in range(intervals):
        for _ in range(sub):
            t = stepper.step(simulator, t, h)
        tip = body.position_collection[:, -1].copy()
        if not np.isfinite(tip).all() or np.abs(tip - scene.base(t)).max() > 2 * scene.rod.length:
            return Result(np.array(tips), None, time.process_time() - start, float(t), False)
        body.compute_internal_forces_and_torques(t)
        tips.append(tip)
        forces.append(reaction(scene, body, t, centred))
    return Result(np.array(tips), np.array(forces), time.process_time() - start, float(t), True)


# Elements and the share of the estimated stable step, by whether the clamp is at the first element's centre.
SETTINGS = {
    "rope": {
        False: [(10, 1.5), (20, 1.5), (40, 1.1), (80, 1.1), (160, 0.8)],
        True: [(10, 1.5), (20, 1.5), (40, 1.1), (80, 1.1), (160, 0.8), (320, 0.5)],
    },
    "pulse": {
        False: [(10, 1.5), (20, 1.5), (40, 1.1), (80, 1.1), (160, 0.8)],
        True: [(10, 1.5), (20, 1.5), (40, 1.1), (80, 1.1), (160, 0.8), (320, 0.5)],
    },
    "spin": {
        False: [(10, 1.5), (20, 1.5), (40, 1.1), (80, 1.1), (160, 0.8)],
        True: [(10, 1.5), (20, 1.5), (40, 1.1), (80, 1.1), (160, 0.8), (320, 0.5)],
    },
    "spring": {True: [(20, 1.0), (40, 1.5)]},
}
# Elements of what is too slow to run.
ESTIMATES = {"wire": (10, 20, 40), "hair": (20, 40), "umbilical": (10, 20, 40)}
TRIAL = 20_000  # steps


def estimate(scene: Scene, n: int) -> None:
    """Seeks the largest stable step, and tells what the scene would take with it."""
    low, high = 0.25 * stable_step(scene.rod, n), 8 * stable_step(scene.rod, n)
    cost = 0.0
    while high / low > 1.1:
        dt = float(np.sqrt(low * high))
        result = solve(scene, n, dt, True, span=TRIAL * dt)
        if result.ok:
            low, cost = dt, result.cpu / TRIAL
        else:
            high = dt
    whole = f"{scene.T / low * cost:.0f} s of CPU (not run)"
    setting = f"n={n} clamp at centre; largest step {low:.2g} s over {TRIAL} steps: {whole}"
    row(scene.name, "pyelastica", "spatial", setting, None, None, None)


def table(scene: Scene, quick: bool) -> None:
    for n in ESTIMATES.get(scene.name, ())[: 1 if quick else None]:
        estimate(scene, n)
    for centred, sizes in SETTINGS.get(scene.name, {}).items():
        for n, share in sizes[:2] if quick else sizes:
            dt = share * stable_step(scene.rod, n)
            measure(
                scene,
                "pyelastica",
                "spatial",
                f"n={n} dt={dt:.2g}" + centred * " clamp at centre",
                True,
                lambda: solve(scene, n, dt, centred),
            )


if __name__ == "__main__":
    main(dict.fromkeys([*SETTINGS, *ESTIMATES], table))
