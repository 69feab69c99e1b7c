"""A hose hangs from the tool of a robot's wrist, whose poses stand in a file: what force and moment has the wrist to hold?

The unit takes the poses alone (base.motion = 1) and derives their velocities. The hose ends in a coupling of 150 g.
"""

import csv
import sys
from pathlib import Path

import matplotlib
import numpy as np
from fmpy import extract, read_model_description
from fmpy.fmi2 import FMU2Slave

matplotlib.use("Agg")
import matplotlib.pyplot as plt

HOSE = {"length": 0.7, "radius": 0.008, "density": 1150.0, "youngs_modulus": 2e7, "shear_modulus": 7e6, "tip.mass": 0.15,
        "damping.bending": 0.02, "damping.twist": 0.02, "damping.drag": 0.2, "tolerance": 1e-3}
WEIGHT = 9.81 * (np.pi * HOSE["radius"] ** 2 * HOSE["density"] * HOSE["length"] + HOSE["tip.mass"])
STATIONS, SHOWN = 11, 26  # of the unit; shapes in the picture


def trajectory(path):
    """Times, positions and quaternions."""
    with open(path, newline="") as file:
        rows = np.array([[float(value) for value in row] for row in list(csv.reader(file))[1:]])
    return rows[:, 0], rows[:, 1:4], rows[:, 4:8]


def run(fmu, description, times, positions, quaternions):
    number = {v.name: v.valueReference for v in description.modelVariables}
    array = lambda name, count=3: [number[f"{name}[{k + 1}]"] for k in range(count)]
    slave = FMU2Slave(guid=description.guid, unzipDirectory=fmu, instanceName="hose",
                      modelIdentifier=description.coSimulation.modelIdentifier)
    slave.instantiate()
    slave.setReal([number[name] for name in HOSE], list(HOSE.values()))
    slave.setInteger([number["base.motion"]], [1])
    slave.setBoolean([number["start_in_equilibrium"]], [True])
    slave.setupExperiment(startTime=times[0])
    slave.enterInitializationMode()
    pose = array("base.position") + array("base.orientation", 4)
    slave.setReal(pose, [*positions[0], *quaternions[0]])
    slave.exitInitializationMode()
    loads = array("base.reaction_force") + array("base.reaction_moment")
    energies = [number[f"energy.{of}"] for of in ("kinetic", "elastic", "gravity", "dissipated", "work_base")]
    line = [reference for i in range(STATIONS) for reference in array(f"station[{i + 1}].position")]
    results = []
    for k, time in enumerate(times):
        if k:
            # an input acts in the step that follows it
            slave.setReal(pose, [*positions[k - 1], *quaternions[k - 1]])
            slave.doStep(times[k - 1], time - times[k - 1])
        results.append(slave.getReal(loads + energies + line))
    slave.freeInstance()
    results = np.array(results)
    return results[:, :6], results[:, 6:11], results[:, 11:].reshape(-1, STATIONS, 3)


def main():
    fmu, path, out = (Path(argument).resolve() for argument in sys.argv[1:])
    times, positions, quaternions = trajectory(path)
    unit = extract(fmu, unzipdir=out / "unit"), read_model_description(fmu)
    loads, energies, shapes = run(*unit, times, positions, quaternions)
    force, moment = np.linalg.norm(loads[:, :3], axis=1), np.linalg.norm(loads[:, 3:], axis=1)
    stored = energies[:, :4].sum(axis=1) - energies[:, 4]
    missed = np.abs(stored - stored[0]).max() / np.abs(energies[:, 4]).max()
    swinging = loads[times > times[-1] - 2.0, 2].mean()
    print(f"weight {WEIGHT:.2f} N; force up to {force.max():.2f} N, moment up to {moment.max():.2f} N.m; it swings about "
          f"{-swinging:.2f} N in the end; energy missed {100 * missed:.2f} % of the work")
    assert abs(force[0] - WEIGHT) < 1e-3 * WEIGHT and abs(swinging + WEIGHT) < 0.03 * WEIGHT, "the wrist holds the hose"
    assert missed < 0.02, "energy is conserved"

    figure = plt.figure(figsize=(12, 5.2), layout="constrained")
    left, middle = figure.subfigures(1, 2, width_ratios=(1.2, 1))
    space = left.add_subplot(projection="3d")
    colours = plt.get_cmap("viridis")
    until = np.searchsorted(times, 5.0)
    for k in np.linspace(0, until, SHOWN).astype(int):
        space.plot(*shapes[k].T, color=colours(times[k] / times[until]), linewidth=1.5)
    space.plot(*positions.T, color="0.5", linewidth=1, linestyle="--")
    space.scatter(*shapes[:until:50, -1].T, color="black", s=8)
    space.locator_params(nbins=5)
    space.set(xlabel="x, m", ylabel="y, m", zlabel="z, m", box_aspect=(1, 1, 0.9), title="the hose, every 0.2 s until 5 s")
    space.view_init(elev=22, azim=-60)
    bar = left.colorbar(plt.cm.ScalarMappable(plt.Normalize(0, times[until]), colours), ax=space, shrink=0.6, pad=0.12)
    bar.set_label("time, s")
    right = middle.subplots(2, 1, sharex=True)
    panels = (loads[:, :3], force, "force", "N"), (loads[:, 3:], moment, "moment", "N.m")
    for axes, (values, total, label, unit) in zip(right, panels):
        for component, name, colour in zip(values.T, "xyz", ("tab:blue", "tab:orange", "tab:green")):
            axes.plot(times, component, color=colour, label=name)
        axes.plot(times, total, color="black", linewidth=1, label="size")
        axes.set_ylabel(f"{label} on the wrist, {unit}")
    right[0].axhline(-WEIGHT, color="0.7", linestyle=":", label="− weight")
    right[0].legend(loc="lower center", bbox_to_anchor=(0.5, 1.0), ncols=5, fontsize=8)
    right[1].set_xlabel("time, s")
    figure.savefig(out / "wrist.png", dpi=80)


if __name__ == "__main__":
    main()
