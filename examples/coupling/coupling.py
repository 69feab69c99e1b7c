"""A rod hangs from a host body on springs, which moves in a plane; four ways to couple the two.

The rod is the unit, the body a mass of this script. The heavier the rod against the body, the more the force that the
rod answers an acceleration with decides on the acceleration. The reference solves rod and body as one system, and
shares nothing with the unit.
"""

import contextlib
import io
import sys
from pathlib import Path

import matplotlib
import numpy as np
from fmpy import extract, read_model_description
from fmpy.fmi1 import FMICallException
from fmpy.fmi2 import FMU2Slave
from numpy.polynomial import legendre
from scipy.integrate import solve_ivp

matplotlib.use("Agg")
import matplotlib.pyplot as plt

LENGTH, RADIUS, DENSITY, YOUNG, DAMPING, GRAVITY = 1.0, 0.005, 1100.0, 5e6, 0.01, 9.81  # SI; those the unit starts with
AREA, SECOND_MOMENT = np.pi * RADIUS**2, np.pi * RADIUS**4 / 4
ROD = DENSITY * AREA * LENGTH  # its mass
RATIOS = [10.0, 1.0, 0.1, 0.01]  # mass of the body over that of the rod
END, GRID = 1.5, 0.02  # length of a run; times at which results are compared
STEPS = [GRID / n for n in (1, 2, 4, 8, 16)]
PUSH, DURATION = np.array([6.0, 3.0]), 0.3  # on the body, m/s² times the mass of both; how long


class Body:
    """A mass on two springs, x and z, at rest under the weight of both. Forces on it and their potential."""

    def __init__(self, ratio):
        self.mass = ratio * ROD
        self.both = self.mass + ROD
        self.stiffness = self.both * (2 * np.pi * 1.5) ** 2  # both together as a point: 1.5 Hz

    def push(self, t):
        return PUSH * self.both * np.sin(np.pi * t / DURATION) ** 2 * (0 < t < DURATION)

    def force(self, position):
        """Of the springs and of gravity."""
        return -self.stiffness * position + [0.0, ROD * GRAVITY]

    def energy(self, position, velocity):
        return (0.5 * self.mass * velocity @ velocity + 0.5 * self.stiffness * position @ position
                - ROD * GRAVITY * position[1])

    def moved(self, position, velocity, force, step, added=np.zeros((2, 2))):
        """Its motion under a force that is held, exactly; with a mass added to its own."""
        masses, axes = np.linalg.eigh(self.mass * np.eye(2) + added)
        w = np.sqrt(self.stiffness / masses)
        rest = axes.T @ (force + [0.0, ROD * GRAVITY]) / self.stiffness
        c, s = np.cos(w * step), np.sin(w * step)
        away, velocity = axes.T @ position - rest, axes.T @ velocity
        return axes @ (rest + away * c + velocity / w * s), axes @ (velocity * c - away * w * s)


class Rod:
    """The unit, in the plane x, z; counts its steps."""

    def __init__(self, fmu, description, motion):
        self.number = {v.name: v.valueReference for v in description.modelVariables}
        self.slave = FMU2Slave(guid=description.guid, unzipDirectory=fmu, instanceName="rod",
                               modelIdentifier=description.coSimulation.modelIdentifier)
        self.slave.instantiate()
        self.slave.setReal([self.number["tolerance"]], [1e-4])
        self.slave.setInteger([self.number["base.motion"]], [motion])
        self.slave.setBoolean([self.number[of] for of in ("start_in_equilibrium", "effective_mass")], [True, True])
        self.slave.setupExperiment(startTime=0.0)
        self.slave.enterInitializationMode()
        # it hangs: half a turn about x
        self.slave.setReal([self.number[f"base.orientation[{k}]"] for k in (1, 2)], [0.0, 1.0])
        self.slave.exitInitializationMode()
        self.inputs = [self.number[f"base.{of}[{k}]"] for of in ("position", "velocity") for k in (1, 3)]
        self.vectors = [self.number[f"{of}[{k}]"] for k in (1, 3)
                        for of in ("base.reaction_force", "station[1].position", "tip.position")]
        self.coupling = [self.number[f"coupling.{of}]"] for of in (
            "base_acceleration[1", "base_acceleration[3", *(f"effective_mass[{k}" for k in (1, 3, 7, 9)))]
        self.energies = [self.number[f"energy.{of}"] for of in ("kinetic", "elastic", "gravity", "dissipated")]
        self.steps = 0
        self.read()

    def step(self, t, step, position, velocity):
        self.slave.setReal(self.inputs, [*position, *velocity])
        self.slave.doStep(currentCommunicationPoint=t, communicationStepSize=step)
        self.steps += 1
        self.read()

    def read(self):
        self.force, self.base, self.tip = np.array(self.slave.getReal(self.vectors)).reshape(2, 3).T

    def energy(self):
        return sum(self.slave.getReal(self.energies))

    def inertia(self):
        """The mass that the body feels at once, and the acceleration that its share in the force belongs to."""
        values = np.array(self.slave.getReal(self.coupling))
        return values[2:].reshape(2, 2), values[:2]

    def derivatives(self):
        """Of force and base at the end of the last step, by the velocities sampled at its start."""
        columns = [self.slave.getDirectionalDerivative(self.vectors, [known], [1.0]) for known in self.inputs[2:]]
        self.steps += PASSES * len(columns)
        force, base, _ = np.transpose(np.reshape(columns, (2, 2, 3)), (2, 1, 0))
        return force, base


PASSES = 5  # through a step, that a derivative costs
CLOSE, MOST = 1e-6, 15  # m/s by which the velocity still changes; iterations in a step
NOISE = 0.01 * ROD * GRAVITY  # force that may be missing where the answer of the unit jumps


class Lost(Exception):
    """No solution in a step."""


class Interface:
    """What iterated schemes solve in each step: Newton's law of the body at the step's end, for the velocity w there.

    A step of the unit ends with the base at 2 s − s₋, s the velocity sampled at its start and s₋ the one before; so the
    master gives s = (w + s₋)/2, and knows the acceleration of the path at the end as the unit does.
    """

    def __init__(self, body, rod, step):
        self.body, self.rod, self.step = body, rod, step
        self.before = self.velocity = self.sample = self.rate = np.zeros(2)
        self.count = 0

    def begin(self):
        self.t = self.count * self.step
        self.state = self.rod.slave.getFMUState()
        # how the acceleration at the end follows the velocity there
        self.gain = (1.25 if self.count > 1 else 1.0) / self.step

    def residual(self, velocity):
        """Force that is missing; the rod goes back to the start of the step first, and is at its end then."""
        self.rod.slave.setFMUState(self.state)
        self.next_sample = velocity if self.count == 0 else 0.5 * (velocity + self.sample)
        self.rod.step(self.t, self.step, (0.0, 0.0), self.next_sample)
        self.next_rate = (self.next_sample - self.sample) / self.step if self.count else np.zeros(2)
        self.acceleration = (velocity - self.velocity) / self.step
        if self.count > 1:
            self.acceleration = self.acceleration + 0.5 * (self.next_rate - self.rate)
        return (self.body.mass * self.acceleration - self.rod.force - self.body.force(self.rod.base)
                - self.body.push(self.t + self.step))

    def advance(self):
        self.begin()
        velocity, best, least = 2 * self.velocity - self.before, None, NOISE
        for _ in range(MOST):
            residual = self.residual(velocity)
            if np.abs(residual).max() < least:
                best, least = velocity, np.abs(residual).max()
            change = self.change(velocity, residual)
            if np.abs(change).max() < CLOSE:
                break
            velocity = velocity + change
        else:
            # the unit decides upon its cells and internal steps, and no solution may be where its answer jumps
            if best is None:
                raise Lost
            velocity, self.jacobian = best, None
            self.residual(velocity)
        self.last = None
        self.rod.slave.freeFMUState(self.state)
        self.before = self.velocity
        self.velocity, self.sample, self.rate = velocity, self.next_sample, self.next_rate
        self.count += 1


class FixedPoint(Interface):
    """The body answers the last force, by Aitken's factor."""

    relaxation, last = 0.5, None

    def change(self, velocity, residual):
        change = -residual / (self.body.mass * self.gain)
        if self.last is not None:
            turn = change - self.last
            self.relaxation *= -(self.last @ turn) / max(turn @ turn, 1e-30)
        self.last = change
        return self.relaxation * change


class Newton(Interface):
    """Newton's method: the Jacobian from the unit at first, then by Broyden's updates, from step to step."""

    jacobian, last = None, None

    def change(self, velocity, residual):
        if self.jacobian is None:
            force, base = self.rod.derivatives()
            sampled = 0.5 if self.count else 1.0
            self.jacobian = self.body.mass * self.gain * np.eye(2) - sampled * (force - self.body.stiffness * base)
        elif self.last is not None:
            self.jacobian = self.jacobian + np.outer(residual, self.last) / (self.last @ self.last)
        self.last = -np.linalg.solve(self.jacobian, residual)
        return self.last


def run(unit, body, scheme, step):
    """Tips on the grid, largest error of the energy over the work done, steps of the rod in a step.

    A run is lost, its error infinite, where the unit or the iteration gives up, or an energy comes from nowhere.
    """
    iterated = scheme in (FixedPoint, Newton)
    rod = Rod(*unit, motion=2 if iterated else 0)
    interface = scheme(body, rod, step) if iterated else None
    position, velocity = np.zeros(2), np.zeros(2)
    start = body.energy(position, velocity) + rod.energy()
    tips, work, most, error = [rod.tip], 0.0, 0.0, 0.0
    every, count = round(GRID / step), round(END / step)
    try:
        for k in range(count):
            before, t = position, k * step
            if iterated:
                interface.advance()
                position, velocity = rod.base, interface.velocity
            else:
                # the rod first; parallel: what it gave at the start is what the body gets
                force = rod.force
                rod.step(t, step, position, velocity)
                added = np.zeros((2, 2))
                if scheme != "parallel":
                    force = rod.force
                if scheme == "added mass":
                    added, acceleration = rod.inertia()
                    force = force + added @ acceleration
                position, velocity = body.moved(position, velocity, force + body.push(t + step / 2), step, added)
            if not np.abs(velocity).max() < 5.0:
                raise Lost
            work += body.push(t + step / 2) @ (position - before)
            most = max(most, work)
            error = max(error, abs(body.energy(position, velocity) + rod.energy() - start - work))
            if (k + 1) % every == 0:
                tips.append(rod.tip)
    except (FMICallException, Lost):
        error = np.inf
    finally:
        rod.slave.freeInstance()
    return np.array(tips), error / most if error < most else np.inf, rod.steps / count


def reference(body, terms=16):
    """Rod and body as one: the angle of the rod from the vertical is a polynomial along it, times its distance from the
    clamp; Lagrange's equations, to a part in 1e5."""
    points, weights = legendre.leggauss(40)
    s = 0.5 * LENGTH * (points + 1)
    weights = 0.5 * LENGTH * weights
    basis = np.array([s * legendre.legval(points, unit) for unit in np.eye(terms)]).T
    slope = np.array([legendre.legval(points, unit) + s * legendre.legval(points, legendre.legder(unit)) * 2 / LENGTH
                      for unit in np.eye(terms)]).T
    # integrals from the clamp to the points, and to the tip
    expand = np.linalg.inv(legendre.legvander(points, 39))
    integral = np.array([0.5 * LENGTH * legendre.legval(points, legendre.legint(column, lbnd=-1))
                         for column in np.eye(40)]).T @ expand
    line, bending = DENSITY * AREA, YOUNG * SECOND_MOMENT * slope.T @ (weights[:, None] * slope)
    turning = DENSITY * SECOND_MOMENT * basis.T @ (weights[:, None] * basis)
    ones, zeros = np.ones_like(s), np.zeros_like(s)

    def rate(t, state):
        q, v = np.split(state, 2)
        angle, turn = basis @ q[2:], basis @ v[2:]
        sine, cosine = np.sin(angle), np.cos(angle)
        jacobians = [np.column_stack([ones, zeros, integral @ (cosine[:, None] * basis)]),
                     np.column_stack([zeros, ones, integral @ (sine[:, None] * basis)])]
        bends = [integral @ (-sine * turn**2), integral @ (cosine * turn**2)]
        mass, force = np.zeros((2 + terms, 2 + terms)), np.zeros(2 + terms)
        for jacobian, bend, pull in zip(jacobians, bends, [0.0, -GRAVITY]):
            mass += line * jacobian.T @ (weights[:, None] * jacobian)
            force += line * jacobian.T @ (weights * (pull - bend))
        mass[2:, 2:] += turning
        mass[[0, 1], [0, 1]] += body.mass
        force[2:] -= bending @ (q[2:] + DAMPING * v[2:])
        force[:2] += body.force(q[:2]) + body.push(t)
        return np.concatenate([v, np.linalg.solve(mass, force)])

    grid = GRID * np.arange(round(END / GRID) + 1)
    q = solve_ivp(rate, (0.0, END), np.zeros(2 * (2 + terms)), method="LSODA", t_eval=grid, rtol=1e-6, atol=1e-8).y
    angle = basis @ q[2:2 + terms]
    return np.array([q[0] + weights @ np.sin(angle), q[1] - weights @ np.cos(angle)]).T


SCHEMES = {"parallel": "parallel", "sequential": "sequential", "added mass": "added mass", "fixed point": FixedPoint, "Newton": Newton}
COLOURS = "tab:red", "tab:purple", "tab:green", "tab:orange", "tab:blue"
LINES = [{"linestyle": style, "marker": mark, "markersize": size, "markerfacecolor": "none"}
         for style, mark, size in (("-", "s", 5), ("--", "D", 5), ("-", "^", 6), ("-", "o", 9), (":", ".", 6))]
SHOWN = 0.005  # the step of the table and of the curves over time


def main():
    fmu, out = (Path(argument).resolve() for argument in sys.argv[1:])
    unit = extract(fmu, unzipdir=out / "unit"), read_model_description(fmu)
    figure, rows = plt.subplots(2, len(RATIOS), figsize=(14, 7), sharex="row", sharey="row", layout="constrained")
    grid = GRID * np.arange(round(END / GRID) + 1)
    print("| body / rod | scheme | largest step | tip | energy | steps of the rod |\n|---|---|---|---|---|---|")
    for ratio, errors, curves in zip(RATIOS, *rows):
        body = Body(ratio)
        exact = reference(body)
        size = np.abs(exact - exact[0]).max()
        curves.plot(grid, exact[:, 0], color="0.8", linewidth=5, label="one system")
        for (name, scheme), colour, line, cross in zip(SCHEMES.items(), COLOURS, LINES, (1.2, 0.9, 0.65, 0.5, 0.35)):
            # what the unit has to say about runs that are lost
            with contextlib.redirect_stdout(io.StringIO()):
                results = {step: run(unit, body, scheme, step) for step in STEPS}
            good = {step: np.abs(tips - exact).max() / size
                    for step, (tips, energy, _) in results.items() if np.isfinite(energy)}
            assert scheme is not Newton or len(good) == len(STEPS), "the recommended scheme is lost"
            largest = max((step for step in good if all(s in good for s in STEPS if s <= step)), default=None)
            errors.loglog([1e3 * step for step in good], list(good.values()), color=colour, label=name, **line)
            lost = [1e3 * step for step in STEPS if step not in good]
            errors.plot(lost, [cross] * len(lost), "x", color=colour)
            tips, energy, steps = results[SHOWN]
            curves.plot(grid[:len(tips)], tips[:, 0], color=colour, linestyle=line["linestyle"])
            numbers = "lost | |"
            if SHOWN in good:
                numbers = f"{100 * good[SHOWN]:.2f} % | {100 * energy:.2f} % | {steps:.1f}"
            print(f"| {ratio:g} | {name} | {f'{1e3 * largest:g} ms' if largest else 'none'} | {numbers} |")
        errors.set(title=f"body / rod = {ratio:g}", xlabel="step, ms", ylim=(1e-4, 2))
        errors.set_xticks([1e3 * step for step in STEPS], [f"{1e3 * step:g}" for step in STEPS], minor=False)
        errors.minorticks_off()
        curves.set(xlabel="time, s", ylim=(-0.32, 0.25))
    rows[0, 0].set_ylabel("error of the tip over its motion (× lost)")
    rows[0, 2].legend(loc="lower right")
    rows[1, 0].set_ylabel(f"tip sideways, m, at {1e3 * SHOWN:g} ms")
    rows[1, 0].legend(loc="lower left")
    figure.savefig(out / "coupling.png", dpi=80)


if __name__ == "__main__":
    main()
