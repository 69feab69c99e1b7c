"""Runs driven through fmpy against reference solutions.

Each is as good as the scheme's own error at the same cells and steps, which `tests/references.rs` measures with the
library; twice that error is allowed for what the host's samples of the base motion lose.
"""

import json
import math
from pathlib import Path

import numpy as np
import pytest
from fmpy import extract, read_model_description, simulate_fmu
from fmpy.fmi2 import FMU2Slave
from fmpy.util import read_csv

ROOT = Path(__file__).parents[2]
REFERENCE = ROOT / "tests" / "reference"
FMU = ROOT / "target" / "CosseratRod.fmu"

HANGING = {"base.orientation[1]": 0.0, "base.orientation[2]": 1.0, "base.orientation[3]": 0.0}
UNDAMPED = {"damping.bending": 0.0, "damping.twist": 0.0, "spectral_radius": 0.5}
STEEL_WIRE = {"radius": 1e-3, "youngs_modulus": 2e11, "shear_modulus": 2e11 / 2.6, "density": 7850.0}


def pulse(t, start, width):
    x = (t - start) / width
    return math.sin(math.pi * x) ** 2 if 0.0 < x < 1.0 else 0.0


def shaken(t, _step):
    """The base along x at 2 Hz, faded in over half a second."""
    amplitude, w, fade = 0.02, 4 * math.pi, 0.5
    s, c = math.sin(w * t), math.cos(w * t)
    r, v = 1.0, 0.0
    if t < fade:
        k = math.pi / fade
        r, v = 0.5 * (1 - math.cos(k * t)), 0.5 * k * math.sin(k * t)
    return {"base.position[1]": amplitude * r * s, "base.velocity[1]": amplitude * (v * s + r * w * c)}


def pulsed(t, step):
    """A load is held over a step: the host knows it in advance and gives the one at the step's end."""
    t += step
    return {
        "tip.force[1]": 0.5 * pulse(t, 0.0, 0.2),
        "tip.force[2]": 0.3 * pulse(t, 0.1, 0.2),
        "tip.moment[3]": 2e-3 * pulse(t, 0.0, 0.2),
    }


SCENES = {
    "S1": ({}, {}, lambda t, step: {}),
    "S2": (STEEL_WIRE, HANGING, shaken),
    "S3": ({}, HANGING, pulsed),
}


@pytest.mark.parametrize("scene", SCENES)
def test_reference(scene, tmp_path):
    setting = json.loads((REFERENCE / "scenes.json").read_text())[scene]
    reference = json.loads((REFERENCE / f"{scene}.json").read_text())
    parameters, start, inputs = SCENES[scene]
    description = read_model_description(FMU)
    number = {variable.name: variable.valueReference for variable in description.modelVariables}
    slave = FMU2Slave(
        guid=description.guid,
        unzipDirectory=extract(FMU, unzipdir=tmp_path),
        modelIdentifier=description.coSimulation.modelIdentifier,
        instanceName=scene,
    )

    def give(values):
        slave.setReal([number[name] for name in values], list(values.values()))

    def read(name):
        return np.array(slave.getReal([number[f"{name}[{k}]"] for k in (1, 2, 3)]))

    step = setting["step"]
    slave.instantiate()
    give({**UNDAMPED, **parameters, "step": step})
    slave.setInteger([number["cells"], number["stages"]], [setting["cells"], setting["stages"]])
    slave.setupExperiment(startTime=0.0)
    slave.enterInitializationMode()
    give({**start, **inputs(0.0, 0.0)} or {"base.position[1]": 0.0})
    slave.exitInitializationMode()
    tips, forces, done = [], [], 0
    for t in reference["t"][1:]:
        steps = round(t / step)
        for i in range(done, steps):
            values = inputs(i * step, step)
            if values:
                give(values)
            slave.doStep(i * step, step)
        done = steps
        tips.append(read("tip.position") - reference["tip"][len(tips) + 1])
        if "base_force" in reference:
            forces.append(read("base.reaction_force") - reference["base_force"][len(forces) + 1])
    assert slave.getInteger([number["solver.steps"]]) == [done]
    slave.terminate()
    slave.freeInstance()

    def rms(errors):
        return math.sqrt(np.mean(np.sum(np.square(errors), axis=1)))

    assert rms(tips) < 2 * setting["tip"]
    if forces:
        assert rms(forces) < 2 * setting["force"]


def test_reference_results_of_the_archive(tmp_path):
    """The files in extra/ are of the cross-check's form, and this unit meets them within their tolerance."""
    folder = Path(extract(FMU, unzipdir=tmp_path)) / "extra" / "io.github.cosserat-rod"
    lines = (folder / "CosseratRod_ref.opt").read_text().splitlines()
    options = {name: float(value) for name, value in (line.split(",") for line in lines)}
    assert set(options) == {"StartTime", "StopTime", "StepSize", "RelTol"}
    expected = read_csv(folder / "CosseratRod_ref.csv")
    names = expected.dtype.names[1:]
    assert 1 <= len(names) <= 10
    result = simulate_fmu(
        FMU,
        start_time=options["StartTime"],
        stop_time=options["StopTime"],
        output_interval=options["StepSize"],
        relative_tolerance=options["RelTol"],
        input=read_csv(folder / "CosseratRod_in.csv"),
        output=list(names),
    )
    assert np.allclose(result["time"], expected["time"], rtol=0, atol=1e-9)
    for name in names:
        peak = np.abs(expected[name]).max()
        # what does not move is zero but for round-off
        assert np.abs(result[name] - expected[name]).max() <= options["RelTol"] * peak + 1e-9, name
    for name in ("tip.position[2]", "base.reaction_force[3]", "energy.elastic"):
        assert np.ptp(expected[name]) > 1e-3, name
