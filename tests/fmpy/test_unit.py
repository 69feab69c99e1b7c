"""The packaged unit as users of fmpy meet it.

Needs what `tests/run` leaves in `target`: `CosseratRod.fmu`, `CoilHose.fmu`, the inputs `drive.csv`, and
`trajectory.csv`, which `cosserat simulate` makes of them.
"""

import csv
import math
import multiprocessing
import re
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from fmpy import extract, read_model_description, simulate_fmu
from fmpy.fmi2 import FMU2Slave
from fmpy.fmi1 import FMICallException
from fmpy.validation import validate_fmu

TARGET = Path(__file__).parents[2] / "target"
FMU = TARGET / "CosseratRod.fmu"
BAKED = TARGET / "CoilHose.fmu"
STEP = 0.01
STEPS = 200


@pytest.fixture(scope="session")
def description():
    return read_model_description(FMU)


@pytest.fixture(scope="session")
def reference(description):
    return {variable.name: variable.valueReference for variable in description.modelVariables}


@pytest.fixture(scope="session")
def unpacked(tmp_path_factory):
    return extract(FMU, unzipdir=tmp_path_factory.mktemp("fmu"))


def instantiated(description, unpacked):
    slave = FMU2Slave(
        guid=description.guid,
        unzipDirectory=unpacked,
        modelIdentifier=description.coSimulation.modelIdentifier,
        instanceName="rod",
    )
    slave.instantiate()
    return slave


@pytest.fixture
def instance(description, unpacked):
    slave = instantiated(description, unpacked)
    yield slave
    slave.freeInstance()


def array(reference, name, count=3):
    return [reference[f"{name}[{k + 1}]"] for k in range(count)]


def initialize(instance):
    instance.setupExperiment(startTime=0.0, stopTime=STEP * STEPS)
    instance.enterInitializationMode()
    instance.exitInitializationMode()


def fmpy(*arguments, cwd):
    command = [sys.executable, "-m", "fmpy", *arguments]
    return subprocess.run(command, cwd=cwd, capture_output=True, text=True)


def test_validate_reports_nothing(tmp_path):
    assert validate_fmu(FMU) == []
    result = fmpy("validate", FMU, cwd=tmp_path)
    assert result.returncode == 0, result.stdout


def test_a_rod_from_a_file_is_valid_and_runs_as_it_is_baked(tmp_path):
    assert validate_fmu(BAKED) == []
    result = fmpy("validate", BAKED, cwd=tmp_path)
    assert result.returncode == 0, result.stdout
    result = simulate_fmu(BAKED, output=["tip.position[3]", "base.reaction_force[3]"])
    # it hangs in equilibrium from a base at z = 2, with 0.05 kg at its end
    assert len(result) == 201 and abs(result["tip.position[3]"][-1] - result["tip.position[3]"][0]) < 1e-3
    assert result["tip.position[3]"][0] < 1.9 and result["base.reaction_force[3]"][-1] < -0.05 * 9.81


def test_simulate_without_options_runs_the_default_experiment(tmp_path):
    result = fmpy("simulate", FMU, "--output-file", "out.csv", cwd=tmp_path)
    assert result.returncode == 0, result.stdout + result.stderr
    with open(tmp_path / "out.csv") as file:
        rows = list(csv.DictReader(file))
    assert np.allclose([float(row["time"]) for row in rows], STEP * np.arange(STEPS + 1), rtol=0, atol=1e-9)
    # fmpy writes Booleans in words
    numbers = [value for row in rows for value in row.values() if value not in ("False", "True")]
    assert all(math.isfinite(float(value)) for value in numbers)


def table(path):
    with open(path) as file:
        rows = list(csv.reader(file))
    return rows[0], np.array([[float(text) for text in row] for row in rows[1:]])


def test_the_numbers_are_those_of_the_library_bit_for_bit(description):
    names, expected = table(TARGET / "trajectory.csv")
    inputs, drive = table(TARGET / "drive.csv")
    outputs = [variable.name for variable in description.modelVariables if variable.causality == "output"]
    assert sorted(names) == sorted(["time", *outputs]) and len(expected) == STEPS + 1
    signals = np.rec.fromarrays(drive.T, names=inputs)
    result = simulate_fmu(FMU, input=signals, output=outputs)
    for column, name in enumerate(names):
        assert result[name].astype(float).tobytes() == expected[:, column].tobytes(), name


def test_the_snippet_of_the_readme_runs(tmp_path, monkeypatch, capsys):
    """As it stands there, from the root of the repository."""
    text = (TARGET.parent / "README.md").read_text()
    [snippet] = re.findall(r"```python\n(.*?)```", text, re.DOTALL)
    assert len(snippet.splitlines()) <= 10
    monkeypatch.chdir(TARGET.parent)
    exec(compile(snippet, "README.md", "exec"), {})
    assert len(capsys.readouterr().out.splitlines()) >= 1


@pytest.mark.parametrize("motion", [0, 1, 2])
def test_the_base_follows_the_inputs_its_motion_names(instance, reference, motion):
    """A base that moves along y at constant speed; what the motion does not name stays as it was."""
    speed = 0.2
    instance.setInteger([reference["base.motion"]], [motion])
    if motion != 1:
        instance.setReal(array(reference, "base.velocity"), [0.0, speed, 0.0])
    initialize(instance)
    for k in range(50):
        if motion != 2:
            # The pose at the start of the step, as the twist is.
            instance.setReal(array(reference, "base.position"), [0.0, speed * STEP * k, 0.0])
        instance.doStep(currentCommunicationPoint=STEP * k, communicationStepSize=STEP)
    base = instance.getReal(array(reference, "station[1].position"))
    # Where only poses are given, the unit cannot know better than the last one it has seen: one step late at most.
    late = speed * STEP if motion == 1 else 0.0
    assert abs(base[1] - speed * STEP * 50) <= late + 1e-9
    assert (base[0], base[2]) == (0.0, 0.0)


def test_start_values_reach_the_unit(description, reference, instance):
    instance.setReal([reference["length"], reference["base.position[2]"]], [0.5, 0.25])
    instance.setBoolean([reference["extensible"]], [True])
    initialize(instance)
    assert instance.getReal([reference["length"], reference["base.position[2]"]]) == [0.5, 0.25]
    assert instance.getBoolean([reference["extensible"]]) == [True]


@pytest.mark.parametrize(
    "start",
    [{"length": -1.0}, {"density": 0.0}, {"radius": float("nan")}, {"cells": -1}, {"base.motion": 3}],
    ids=lambda start: next(iter(start)),
)
def test_bad_start_values_stop_the_simulation_with_a_reason(start, capsys):
    # No logger of our own: fmpy keeps the last one that was given anywhere in the process, and calls it when it is gone.
    with pytest.raises(FMICallException):
        simulate_fmu(FMU, start_values=start)
    lines = capsys.readouterr().out.splitlines()
    assert len(lines) == 1
    assert next(iter(start)) in lines[0] and "is not allowed" in lines[0]


def test_a_refused_step_can_be_repeated(instance, reference):
    initialize(instance)
    force = array(reference, "tip.force")
    with pytest.raises(FMICallException):
        instance.setReal(force, [0.0, float("inf"), 0.0])
    assert instance.getReal(force) == [0.0, 0.0, 0.0]
    for time, step in [(0.0, 0.0), (0.0, -STEP), (STEP, STEP), (0.0, 3.0)]:
        with pytest.raises(FMICallException):
            instance.doStep(currentCommunicationPoint=time, communicationStepSize=step)
    instance.doStep(currentCommunicationPoint=0.0, communicationStepSize=STEP)
    instance.terminate()


def go_on(instance, description, first):
    """All Real outputs over 60 steps, in which the tip is pushed out of the plane."""
    real = [v for v in description.modelVariables if v.causality == "output" and v.type == "Real"]
    push = next(v.valueReference for v in description.modelVariables if v.name == "tip.force[2]")
    outputs = []
    for k in range(first, first + 60):
        instance.setReal([push], [0.02 if k % 40 > 30 else 0.0])
        instance.doStep(currentCommunicationPoint=STEP * k, communicationStepSize=STEP)
        outputs.append(instance.getReal([v.valueReference for v in real]))
    return np.array(outputs).tobytes()


def go_on_from(serialized, unpacked, first):
    description = read_model_description(FMU)
    instance = instantiated(description, unpacked)
    instance.setFMUState(instance.deserializeFMUState(serialized))
    outputs = go_on(instance, description, first)
    instance.freeInstance()
    return outputs


def test_a_state_goes_on_bit_for_bit_here_and_in_another_process(description, reference, instance, unpacked):
    assert description.coSimulation.canGetAndSetFMUstate and description.coSimulation.canSerializeFMUstate
    instance.setReal([reference["length"]], [0.8])
    initialize(instance)
    for k in range(20):
        instance.doStep(currentCommunicationPoint=STEP * k, communicationStepSize=STEP)
    state = instance.getFMUState()
    serialized = instance.serializeFMUState(state)
    once = go_on(instance, description, 20)
    for _ in range(2):
        instance.setFMUState(state)
        assert go_on(instance, description, 20) == once
    instance.freeFMUState(state)
    with pytest.raises(FMICallException):
        instance.setFMUState(state)
    with multiprocessing.get_context("spawn").Pool(1) as pool:
        assert pool.apply(go_on_from, (serialized, unpacked, 20)) == once


def test_a_broken_state_is_refused_and_changes_nothing(description, instance):
    initialize(instance)
    state = instance.getFMUState()
    serialized = instance.serializeFMUState(state)
    changed = bytes([serialized[-1] ^ 1])
    for broken in (serialized[:-1], serialized[:-1] + changed, b"", description.guid.encode()):
        with pytest.raises(FMICallException):
            instance.deserializeFMUState(broken)
    assert instance.serializeFMUState(instance.getFMUState()) == serialized
    instance.doStep(currentCommunicationPoint=0.0, communicationStepSize=STEP)


def test_directional_derivatives_are_those_of_steps_that_are_taken_back(description, reference, instance):
    assert description.coSimulation.providesDirectionalDerivative
    instance.setReal([reference["step"]], [0.002])
    initialize(instance)
    for k in range(20):
        instance.doStep(currentCommunicationPoint=STEP * k, communicationStepSize=STEP)
    state = instance.getFMUState()
    unknown = array(reference, "tip.position") + array(reference, "base.reaction_force")
    known = array(reference, "base.velocity")
    direction = [0.6, -0.2, 0.3]

    def outputs(size):
        instance.setFMUState(state)
        instance.setReal(known, [size * part for part in direction])
        instance.doStep(currentCommunicationPoint=STEP * 20, communicationStepSize=STEP)
        return np.array(instance.getReal(unknown))

    difference = (outputs(1e-4) - outputs(-1e-4)) / 2e-4
    outputs(0.0)
    derivative = np.array(instance.getDirectionalDerivative(unknown, known, direction))
    for rows in (slice(0, 3), slice(3, 6)):
        assert np.linalg.norm(derivative[rows] - difference[rows]) < 1e-5 * np.linalg.norm(difference[rows])
    instance.freeFMUState(state)


def test_a_foreign_guid_gives_no_instance(unpacked, description):
    slave = FMU2Slave(
        guid="{00000000-0000-0000-0000-000000000000}",
        unzipDirectory=unpacked,
        modelIdentifier=description.coSimulation.modelIdentifier,
        instanceName="rod",
    )
    with pytest.raises(Exception, match="instantiate"):
        slave.instantiate()


def test_a_tip_is_driven_caught_and_let_go(instance, reference):
    tip, position = array(reference, "tip.reaction_force"), array(reference, "tip.position")
    instance.setInteger([reference["tip.mode"]], [1])
    initialize(instance)
    weight = 1100 * math.pi * 0.005**2 * 9.81
    # between two ends at one height each carries half
    assert instance.getReal(tip)[2] == pytest.approx(-0.5 * weight, rel=1e-6)
    assert instance.getReal(position) == pytest.approx([0.5, 0, 0], abs=1e-9)
    driven = array(reference, "tip.driven_position") + array(reference, "tip.driven_velocity")
    for k in range(60):
        time = k * STEP
        mode = 0 if 20 <= k < 40 else 1
        instance.setInteger([reference["tip.mode"]], [mode])
        if k == 40:
            instance.setReal(driven, instance.getReal(position) + [0.0, 0.0, 0.0])
        before = instance.getReal(position)
        instance.doStep(currentCommunicationPoint=time, communicationStepSize=STEP)
        assert math.dist(instance.getReal(position), before) < 0.1
        assert any(instance.getReal(tip)) == (mode == 1)
    with pytest.raises(FMICallException):
        instance.setInteger([reference["tip.mode"]], [2])
    instance.terminate()
