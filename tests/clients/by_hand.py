"""Writes what other masters are held against: final values of runs stepped by hand through fmpy.

`rod` hangs from a clamp and is pushed at its tip; `chain` is two of them, the base of the lower one led by the tip of
the upper one, both stepped at once.
"""

import json
import sys
from pathlib import Path

from fmpy import extract, read_model_description
from fmpy.fmi2 import FMU2Slave

STEP, STEPS = 0.01, 100
HANGS = {"base.orientation[1]": 0.0, "base.orientation[2]": 1.0}
PUSH = {**HANGS, "tip.force[1]": 0.03, "tip.force[2]": 0.02}
PORTS = [f"{quantity}[{k + 1}]"
         for quantity, count in [("position", 3), ("orientation", 4), ("velocity", 3), ("angular_velocity", 3)]
         for k in range(count)]

fmu, written = sys.argv[1:]
description = read_model_description(fmu)
number = {variable.name: variable.valueReference for variable in description.modelVariables}
outputs = [v.name for v in description.modelVariables if v.causality == "output" and v.type == "Real"]
unpacked = extract(fmu, unzipdir=Path(written).with_suffix(""))


def started(values):
    rod = FMU2Slave(guid=description.guid, unzipDirectory=unpacked, instanceName="rod",
                    modelIdentifier=description.coSimulation.modelIdentifier)
    rod.instantiate()
    rod.setReal([number[name] for name in values], list(values.values()))
    rod.setupExperiment(startTime=0.0)
    rod.enterInitializationMode()
    rod.exitInitializationMode()
    return rod


def read(rod, names):
    return rod.getReal([number[name] for name in names])


def step(rod, k):
    rod.doStep(currentCommunicationPoint=k * STEP, communicationStepSize=STEP)


rod = started({"length": 0.8, **PUSH})
for k in range(STEPS):
    step(rod, k)

upper = started({"length": 0.5, **PUSH})
lower = started({"length": 0.5, "base.position[3]": -0.5, **HANGS})
for k in range(STEPS):
    lower.setReal([number[f"base.{port}"] for port in PORTS], read(upper, [f"tip.{port}" for port in PORTS]))
    step(upper, k)
    step(lower, k)

tip = [f"tip.{port}" for port in PORTS]
with open(written, "w") as file:
    json.dump({"rod": dict(zip(outputs, read(rod, outputs))), "chain": dict(zip(tip, read(lower, tip)))}, file)
