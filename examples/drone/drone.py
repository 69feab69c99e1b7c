"""A drone with a load on a tether, in a gust. The drone weighs not three times what hangs from it.

Values passed to and fro would not hold at this ratio. The master takes the tether's effective mass to that of the drone
(`effective_mass`, see examples/coupling), and needs neither to go back nor to iterate.
"""

import sys
from pathlib import Path

import matplotlib
import numpy as np
from fmpy import extract, read_model_description
from fmpy.fmi2 import FMU2Slave

matplotlib.use("Agg")
import matplotlib.pyplot as plt

STEP, END = 0.005, 12.0  # s
DRONE, GRAVITY = 2.0, np.array([0.0, 0.0, -9.81])  # kg, m/s²
TETHER = {"length": 4.0, "radius": 0.004, "density": 1200.0, "youngs_modulus": 5e7, "shear_modulus": 1.7e7,
          "damping.drag": 0.02, "tip.mass": 0.5, "base.orientation[1]": 0.0, "base.orientation[2]": 1.0,
          "base.orientation[3]": 0.0}
HANGS = np.pi * TETHER["radius"] ** 2 * TETHER["density"] * TETHER["length"] + TETHER["tip.mass"]  # kg
STIFFNESS, DAMPING, THRUST = 8.0, 9.0, 40.0  # of the controller, N/m and N.s/m; most thrust, N


def gust(t):
    return np.array([18.0, 8.0, 0.0]) * np.sin(np.pi * (t - 2.0) / 1.5) ** 2 * (2.0 < t < 3.5)


def control(position, velocity):
    """Thrust that holds the drone where it was, and what hangs from it."""
    thrust = -STIFFNESS * position - DAMPING * velocity - (DRONE + HANGS) * GRAVITY
    return thrust * min(1.0, THRUST / np.linalg.norm(thrust))


class Tether:
    def __init__(self, fmu, description):
        self.number = {v.name: v.valueReference for v in description.modelVariables}
        self.slave = FMU2Slave(guid=description.guid, unzipDirectory=fmu, instanceName="tether",
                               modelIdentifier=description.coSimulation.modelIdentifier)
        self.slave.instantiate()
        self.slave.setReal([self.number[name] for name in TETHER], list(TETHER.values()))
        self.slave.setBoolean([self.number[of] for of in ("start_in_equilibrium", "effective_mass")], [True, True])
        self.slave.setupExperiment(startTime=0.0)
        self.slave.enterInitializationMode()
        self.slave.exitInitializationMode()
        self.inputs = self.of("base.position") + self.of("base.velocity")
        self.coupling = (self.of("base.reaction_force") + self.of("coupling.base_acceleration")
                         + self.of("coupling.effective_mass", 9))
        self.line = [reference for i in range(11) for reference in self.of(f"station[{i + 1}].position")]

    def of(self, name, count=3):
        return [self.number[f"{name}[{k + 1}]"] for k in range(count)]

    def step(self, t, position, velocity):
        """Reaction on the drone, and the acceleration and mass that its inertial part belongs to."""
        self.slave.setReal(self.inputs, [*position, *velocity])
        self.slave.doStep(t, STEP)
        values = np.array(self.slave.getReal(self.coupling))
        return values[:3], values[3:6], values[6:].reshape(3, 3)


def fly(unit, adds):
    """Times, positions of the drone, reactions and shapes; until it is lost, if it is."""
    tether, rows = Tether(*unit), []
    position, velocity = np.zeros(3), np.zeros(3)
    for k in range(round(END / STEP)):
        t = k * STEP
        reaction, acceleration, mass = tether.step(t, position, velocity)
        outer = DRONE * GRAVITY + control(position, velocity) + gust(t + STEP / 2)
        added = mass if adds else np.zeros((3, 3))
        rate = np.linalg.solve(DRONE * np.eye(3) + added, outer + reaction + added @ acceleration)
        velocity = velocity + STEP * rate
        position = position + STEP * velocity
        rows.append([t + STEP, *position, *reaction, *tether.slave.getReal(tether.line)])
        if not np.abs(position).max() < 5.0:
            break
    tether.slave.freeInstance()
    rows = np.array(rows)
    return rows[:, 0], rows[:, 1:4], rows[:, 4:7], rows[:, 7:].reshape(-1, 11, 3)


def main():
    fmu, out = (Path(argument).resolve() for argument in sys.argv[1:])
    unit = extract(fmu, unzipdir=out / "unit"), read_model_description(fmu)
    plain = fly(unit, adds=False)
    times, positions, reactions, shapes = fly(unit, adds=True)
    false = np.linalg.norm(plain[2], axis=1)
    away, pull = np.linalg.norm(positions, axis=1), np.linalg.norm(reactions, axis=1)
    print(f"drone {DRONE:.2f} kg, tether and load {HANGS:.2f} kg; the gust drives it {away.max():.2f} m away, the tether pulls "
          f"with up to {pull.max():.1f} N; without the added mass it would with {false.max():.0f} N")
    assert times[-1] > END - STEP and away[-1] < 0.2, "it comes back"
    assert pull.max() < 1.3 * 9.81 * HANGS < 0.1 * false.max(), "what the added mass is for"
    assert abs(reactions[times > 8.0, 2].mean() + 9.81 * HANGS) < 0.02 * 9.81 * HANGS, "it carries the load"

    figure, (left, right) = plt.subplots(1, 2, figsize=(11, 4.6), layout="constrained", width_ratios=(1, 1.4))
    colours = plt.get_cmap("viridis")
    for k in range(round(1.8 / STEP), round(6.0 / STEP), round(0.2 / STEP)):
        colour = colours((times[k] - 1.8) / 4.2)
        left.plot(shapes[k, :, 0], shapes[k, :, 2], color=colour, linewidth=1.5)
        left.plot(*shapes[k, 0, [0, 2]], "s", color=colour)
        left.plot(*shapes[k, -1, [0, 2]], "o", color=colour)
    left.set(xlabel="x, m", ylabel="z, m", title="every 0.2 s, from 1.8 s to 6 s")
    figure.colorbar(plt.cm.ScalarMappable(plt.Normalize(1.8, 6.0), colours), ax=left, label="time, s", shrink=0.8)
    right.axvspan(2.0, 3.5, color="0.9", label="gust")
    right.plot(times, positions[:, 0], color="tab:blue", label="drone, x, m")
    right.plot(times, shapes[:, -1, 0], color="tab:green", linestyle="--", label="load, x, m")
    right.plot(times, pull / 10.0, color="tab:orange", label="pull of the tether, 10 N")
    right.plot(plain[0], np.clip(false / 10.0, 0, 2), color="tab:red", linestyle=":", linewidth=1, zorder=0,
               label="the same without the added mass, up to 20 N")
    right.set(xlabel="time, s", ylim=(-2.6, 2))
    right.legend(fontsize=8, loc="lower left", framealpha=0.9)
    figure.savefig(out / "drone.png", dpi=80)


if __name__ == "__main__":
    main()
