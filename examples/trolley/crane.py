"""The unit and a trolley made elsewhere, connected by a file of the Open Simulation Platform and stepped by libcosim.

The trolley weighs six times as much as what hangs from it: heavy enough for both to step side by side (see
examples/coupling).
"""

import shutil
import sys
from pathlib import Path

import matplotlib
import numpy as np
from libcosimpy.CosimExecution import CosimExecution
from libcosimpy.CosimLogging import CosimLogLevel, log_output_level
from libcosimpy.CosimObserver import CosimObserver

matplotlib.use("Agg")
import matplotlib.pyplot as plt

STEP, END = 0.005, 8.0  # s
ROD = {"length": 3.0, "radius": 0.012, "density": 2200.0, "youngs_modulus": 5e7, "shear_modulus": 1.7e7,
       "damping.drag": 0.1, "tip.mass": 1.0,
       # it hangs: half a turn about x
       "base.orientation[1]": 0.0, "base.orientation[2]": 1.0, "base.orientation[3]": 0.0}
WEIGHT = 9.81 * (np.pi * ROD["radius"] ** 2 * ROD["density"] * ROD["length"] + ROD["tip.mass"])
WIRES = [("trolley", "position", "umbilical", "base.position[1]"), ("trolley", "velocity", "umbilical", "base.velocity[1]"),
         ("umbilical", "base.reaction_force[1]", "trolley", "force")]


def structure():
    """The system, as libcosim reads it."""
    starts = "".join(f'<InitialValue variable="{name}"><Real value="{value}"/></InitialValue>' for name, value in ROD.items())
    starts += '<InitialValue variable="start_in_equilibrium"><Boolean value="true"/></InitialValue>'
    wires = "".join(f'<VariableConnection><Variable simulator="{a}" name="{x}"/><Variable simulator="{b}" name="{y}"/>'
                    "</VariableConnection>" for a, x, b, y in WIRES)
    return ('<?xml version="1.0" encoding="UTF-8"?>'
            '<OspSystemStructure xmlns="http://opensimulationplatform.com/MSMI/OSPSystemStructure" version="0.1">'
            f"<StartTime>0</StartTime><BaseStepSize>{STEP}</BaseStepSize><Algorithm>fixedStep</Algorithm><Simulators>"
            '<Simulator name="trolley" source="Trolley.fmu"/>'
            f'<Simulator name="umbilical" source="Umbilical.fmu"><InitialValues>{starts}</InitialValues></Simulator>'
            f"</Simulators><Connections>{wires}</Connections></OspSystemStructure>")


def main():
    unit, out = (Path(argument).resolve() for argument in sys.argv[1:])
    shutil.copy(unit, out / "Umbilical.fmu")
    (out / "OspSystemStructure.xml").write_text(structure())
    log_output_level(CosimLogLevel.ERROR)
    execution = CosimExecution.from_osp_config_file(str(out))
    observer = CosimObserver.create_last_value()
    assert execution.add_observer(observer)
    index = {name: execution.slave_index_from_instance_name(name) for name in ("trolley", "umbilical")}
    number = {of: {v.name.decode(): v.reference for v in execution.slave_variables(index[of])} for of in index}
    seen = {"trolley": ["position", "velocity", "wanted", "drive"],
            "umbilical": ["tip.position[1]", "base.reaction_force[1]", "base.reaction_force[3]",
                          *(f"station[{i + 1}].position[{k}]" for i in range(11) for k in (1, 3))]}
    rows = []
    for _ in range(round(END / STEP)):
        assert execution.step(1), execution.status()
        rows.append([value for of, names in seen.items()
                     for value in observer.last_real_values(index[of], [number[of][name] for name in names])])
    rows = np.array(rows)
    times = STEP * (1 + np.arange(len(rows)))
    position, velocity, wanted, drive, tip, pull, weight = rows[:, :7].T
    shapes = rows[:, 7:].reshape(-1, 11, 2)

    lag, sway = np.abs(wanted - position).max(), np.abs(tip - position)
    after = sway[times > 4.0].max()
    held = weight[times > END - 4].mean()
    # what the drive and the umbilical did to the trolley is its momentum
    momentum = STEP * np.cumsum(drive + pull)[-1]
    print(f"umbilical {WEIGHT:.1f} N; it pulls sideways with up to {np.abs(pull).max():.1f} N and leaves the trolley up to "
          f"{1e3 * lag:.1f} mm behind; its end sways up to {sway.max():.2f} m, {after:.2f} m after the move")
    assert abs(held + WEIGHT) < 0.02 * WEIGHT, "the trolley carries it"
    assert abs(momentum - 25.0 * velocity[-1]) < 1.0, "momentum"
    assert lag < 0.05 and 0.1 < sway.max() < 2.0

    figure, (left, right) = plt.subplots(1, 2, figsize=(11, 4.4), layout="constrained")
    colours = plt.get_cmap("viridis")
    for k in range(0, round(4.0 / STEP), round(0.2 / STEP)):
        left.plot(*shapes[k].T, color=colours(times[k] / 4.0), linewidth=1.8)
        left.plot(shapes[k, 0, 0], 0, "s", color=colours(times[k] / 4.0), markersize=8)
    left.axhline(0, color="0.6", zorder=0)
    left.set(xlabel="x, m", ylabel="z, m", title="trolley and umbilical, every 0.2 s until 4 s", aspect="equal")
    figure.colorbar(plt.cm.ScalarMappable(plt.Normalize(0, 4), colours), ax=left, label="time, s", shrink=0.8)
    right.plot(times, tip - position, color="tab:blue", label="end against the trolley, m")
    right.plot(times, position / 3.0, color="0.5", linestyle="--", label="trolley, parts of its way")
    right.plot(times, pull / 10.0, color="tab:orange", label="pull on the trolley, 10 N")
    right.set(xlabel="time, s")
    right.legend(loc="upper left", fontsize=8)
    figure.savefig(out / "trolley.png", dpi=80)


if __name__ == "__main__":
    main()
