"""A parameter study: a hose on a clamp that is shaken, over its length and the frequency, a thousand runs on Dask.

The workers get the FMU as bytes, once, and unpack it: they may be on other machines (`--scheduler ADDRESS`).
"""

import argparse
import logging
import sys
import tempfile
import time
from pathlib import Path

import matplotlib
import numpy as np
from dask.distributed import Client, LocalCluster, as_completed, get_worker

matplotlib.use("Agg")
import matplotlib.pyplot as plt

AMPLITUDE, END, STEP = 0.01, 4.0, 0.02  # m; s


def unpacked(archive):
    """The unit of an archive, unpacked once by a worker, which keeps it."""
    from fmpy import extract, read_model_description

    units = get_worker().__dict__.setdefault("units", {})
    if archive not in units:
        folder = tempfile.TemporaryDirectory(prefix="rod")
        path = Path(folder.name) / "rod.fmu"
        path.write_bytes(archive)
        # the folder stays as long as the worker; of two threads the first one's counts
        units.setdefault(archive, (extract(path, unzipdir=f"{folder.name}/unit"), read_model_description(path), folder))
    return units[archive]


def run(archive, length, frequency):
    """Largest way of the tip sideways, m, and largest force on the clamp, N, in the second half of a run."""
    from fmpy.fmi2 import FMU2Slave

    folder, description, _ = unpacked(archive)
    number = {v.name: v.valueReference for v in description.modelVariables}
    slave = FMU2Slave(guid=description.guid, unzipDirectory=folder, instanceName="hose",
                      modelIdentifier=description.coSimulation.modelIdentifier)
    slave.instantiate()
    try:
        slave.setReal([number["length"], number["damping.drag"]], [length, 0.05])
        slave.setBoolean([number["start_in_equilibrium"]], [True])
        slave.setupExperiment(startTime=0.0)
        slave.enterInitializationMode()
        # it hangs: half a turn about x
        slave.setReal([number[f"base.orientation[{k}]"] for k in (1, 2, 3)], [0.0, 1.0, 0.0])
        slave.exitInitializationMode()
        base = [number["base.position[1]"], number["base.velocity[1]"]]
        seen = [number["tip.position[1]"], *(number[f"base.reaction_force[{k}]"] for k in (1, 2, 3))]
        omega, results = 2 * np.pi * frequency, []
        for k in range(round(END / STEP)):
            t = k * STEP
            fade = min(t / 0.5, 1.0)
            slave.setReal(base, [fade * AMPLITUDE * np.sin(omega * t), fade * AMPLITUDE * omega * np.cos(omega * t)])
            slave.doStep(t, STEP)
            results.append(slave.getReal(seen))
    finally:
        slave.freeInstance()
    late = np.array(results)[len(results) // 2:]
    return np.abs(late[:, 0]).max(), np.linalg.norm(late[:, 1:], axis=1).max()


def main():
    parser = argparse.ArgumentParser()
    parser.add_argument("fmu", type=Path)
    parser.add_argument("out", type=Path)
    parser.add_argument("--scheduler", help="address of a Dask scheduler; without it, the processors of this machine")
    parser.add_argument("--runs", type=int, default=1000)
    arguments = parser.parse_args()
    side = max(round(arguments.runs**0.5 * 0.8), 1)
    lengths, frequencies = np.linspace(0.3, 1.2, side), np.linspace(0.3, 4.0, -(-arguments.runs // side))
    jobs = [(i, j) for i in range(len(lengths)) for j in range(len(frequencies))]

    cluster = arguments.scheduler or LocalCluster(threads_per_worker=1, dashboard_address=None, silence_logs=logging.CRITICAL)
    with Client(cluster) as client:
        begin = time.perf_counter()
        archive = client.scatter(arguments.fmu.read_bytes(), broadcast=True)
        futures = {client.submit(run, archive, lengths[i], frequencies[j], pure=False): (i, j) for i, j in jobs}
        way, force = (np.full((len(lengths), len(frequencies)), np.nan) for _ in range(2))
        failed = []
        for count, future in enumerate(as_completed(futures), 1):
            i, j = futures[future]
            if future.status == "finished":
                way[i, j], force[i, j] = future.result()
            else:
                failed.append(f"length {lengths[i]:.3f} m at {frequencies[j]:.3f} Hz: {future.exception()}")
            if count % 100 == 0 or count == len(jobs):
                print(f"{count} of {len(jobs)} runs, {len(failed)} failed", file=sys.stderr)
        took = time.perf_counter() - begin
    if not arguments.scheduler:
        cluster.close()
    print(f"{len(jobs)} runs of {END:g} s in {took:.1f} s: {len(jobs) / took:.0f} a second, {len(failed)} failed")
    for line in failed:
        print(line)
    figure, panels = plt.subplots(1, 2, figsize=(11, 4.2), layout="constrained")
    labels = "way of the tip over that of the clamp", "force on the clamp, N"
    for axes, values, label in zip(panels, (way / AMPLITUDE, force), labels):
        image = axes.pcolormesh(frequencies, lengths, values, cmap="viridis", shading="nearest")
        figure.colorbar(image, ax=axes, label=label)
        axes.set(xlabel="frequency, Hz", ylabel="length, m")
        # a chain that hangs swings at j/(4 pi) sqrt(g/L), j the zeros of the Bessel function J0
        for zero, name in zip((2.405, 5.520, 8.654), ("1st", "2nd", "3rd")):
            swings = zero / (4 * np.pi) * np.sqrt(9.81 / lengths)
            axes.plot(swings, lengths, color="white", linestyle=":")
            axes.text(swings[-1], lengths[-1], name, color="white", va="top", fontsize=8)
        axes.set_xlim(frequencies[0], frequencies[-1])
    figure.suptitle(f"{len(jobs)} hoses on a clamp shaken by {1e3 * AMPLITUDE:g} mm; dotted: how a chain of that length swings")
    figure.savefig(arguments.out / "study.png", dpi=80)
    assert not failed, "every run ends"


if __name__ == "__main__":
    main()
