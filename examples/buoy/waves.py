"""The unit under a buoy made elsewhere, in the master of cofmupy: with iteration, which goes back by the states of both, and
without.

What hangs from the buoy has half of its mass: too much for values passed to and fro (see examples/coupling). The iteration
of this master is a fixed point without relaxation, up to ten times a step, which such a ratio lets converge.
"""

import contextlib
import io
import re
import sys
import tomllib
from pathlib import Path

import matplotlib
import numpy as np
from cofmupy import Coordinator
from cofmupy.wrappers import Fmu2Handler

matplotlib.use("Agg")
import matplotlib.pyplot as plt

STEP, END, WAVE = 0.02, 10.0, 4.0  # s
AXES = {"x": 1, "z": 3}

# it reads every output in every iteration, and as a Real: those that are used are enough
USED = re.compile(r"(position|velocity|sample)_|base\.reaction_force|tip\.position|station")
Fmu2Handler.get_output_names = lambda self: [
    v.name for v in self.description.modelVariables if v.causality == "output" and USED.match(v.name)]


def wire(source, target):
    (a, x), (b, y) = source, target
    return {"source": {"id": a, "variable": x, "unit": "", "type": "fmu"},
            "target": {"id": b, "variable": y, "unit": "", "type": "fmu"}}


def run(out, weight, iterative, step):
    """The outputs that are used, at the ends of the steps."""
    given = "sample" if iterative else "velocity"
    starts = {"share": 0.5 if iterative else 1.0, "carried": weight, "force_z": -weight, "before_z": -weight}
    config = {
        "fmus": [{"id": "buoy", "path": str(out / "Buoy.fmu"), "name": "buoy", "initialization": starts},
                 # it gives zero to all inputs that it is not told of
                 {"id": "umbilical", "path": str(out / "Umbilical.fmu"), "name": "umbilical",
                  "initialization": {"base.orientation[2]": 1.0}}],
        "connections": [
            *(wire(("buoy", f"{given}_{k}"), ("umbilical", f"base.velocity[{n}]")) for k, n in AXES.items()),
            *(wire(("umbilical", f"base.reaction_force[{n}]"), ("buoy", f"force_{k}")) for k, n in AXES.items())],
        "cosim_method": "gauss_seidel",
        "iterative": iterative,
    }
    coordinator = Coordinator()
    with contextlib.redirect_stdout(io.StringIO()):
        coordinator.start(config)
        for _ in range(round(END / step)):
            coordinator.do_step(step)
    return {name: np.array(values) for name, values in coordinator.get_results().items()}


def main():
    out = Path(sys.argv[1]).resolve()
    rod = tomllib.loads(Path("umbilical.toml").read_text())
    mass = np.pi * rod["radius"] ** 2 * rod["density"] * rod["length"] + rod["tip"]["mass"]
    weight = -rod["gravity"][2] * mass
    good, fine, plain = (run(out, weight, *how) for how in ((True, STEP), (True, STEP / 2), (False, STEP)))
    pull = ("umbilical", "base.reaction_force[3]")
    place = ("buoy", "position_z")

    times = STEP * (1 + np.arange(len(good[pull])))
    apart = max(np.abs(good["buoy", f"position_{k}"] - good["umbilical", f"station[1].position[{n}]"]).max()
                for k, n in AXES.items())
    changes = [np.abs(good[name] - fine[name][1::2]).max() for name in (place, pull)]
    most, false = (np.abs(results[pull]).max() for results in (good, plain))
    print(f"umbilical and probe {mass:.1f} kg, {weight:.1f} N under water; they pull with up to {most:.0f} N, at half the "
          f"step with {changes[1]:.1f} N more or less; both FMUs agree on where they meet within {1e3 * apart:.1f} mm; without "
          f"iteration the pull would be {false:.0f} N")
    assert apart < 0.002 and changes[0] < 0.002 and changes[1] < 0.01 * np.ptp(good[pull]), "it converges"
    assert abs(good[pull][times > END - WAVE].mean() + weight) < 0.02 * weight, "the buoy carries it"
    assert most < 3 * weight < 0.1 * false, "what the iteration is for"

    figure, axes = plt.subplot_mosaic([["shapes", "motion"], ["shapes", "pull"]], figsize=(11, 5), layout="constrained",
                                      width_ratios=(1, 1.6))
    colours = plt.get_cmap("viridis")
    for k in range(round((END - WAVE) / STEP), round(END / STEP), round(0.2 / STEP)):
        colour = colours((times[k] - END) / WAVE + 1)
        shape = [[good["umbilical", f"station[{i + 1}].position[{n}]"][k] for i in range(11)] for n in AXES.values()]
        axes["shapes"].plot(*shape, color=colour, linewidth=1.5)
        axes["shapes"].plot(shape[0][0], shape[1][0], "o", color=colour, markersize=8)
    axes["shapes"].set(xlabel="x, m", ylabel="z, m", title="in one wave, every 0.2 s", xlim=(-1.2, 1.2))
    figure.colorbar(plt.cm.ScalarMappable(plt.Normalize(END - WAVE, END), colours), ax=axes["shapes"], label="time, s",
                    shrink=0.8)
    axes["motion"].plot(times, good[place], color="tab:blue", label="buoy, z, m")
    axes["motion"].plot(times, good["buoy", "position_x"], color="tab:blue", linestyle="--", label="buoy, x, m")
    axes["motion"].plot(times, good["umbilical", "tip.position[1]"], color="tab:green", linestyle="--", label="probe, x, m")
    axes["motion"].sharex(axes["pull"])
    # as far as it is to be seen
    until = np.argmax(np.abs(plain[pull]) > 10 * weight)
    axes["pull"].plot(times[:until], -plain[pull][:until] / weight, color="tab:red", linewidth=1,
                      label="the same without iteration, until it is ten times the weight")
    axes["pull"].plot(times, -good[pull] / weight, color="tab:orange", linewidth=2, label="pull on the buoy over the weight")
    axes["pull"].set(xlabel="time, s", ylim=(-1, 3.5), xlim=(0, END))
    for name in ("motion", "pull"):
        axes[name].legend(fontsize=8, loc="upper right", ncols=3 if name == "motion" else 1)
    axes["motion"].set_ylim(-0.7, 1.0)
    figure.savefig(out / "buoy.png", dpi=80)


if __name__ == "__main__":
    main()
