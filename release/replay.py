"""Replays the run that lies in an FMU with its win64 library, and compares: replay.py FMU TOLERANCE WORK HOST...

HOST is the command that runs replay.c. TOLERANCE is relative to the largest value of a variable, of a vector to that of
all its elements, as one that is zero holds rounding."""

import csv
import io
import subprocess
import sys
import xml.etree.ElementTree as ElementTree
import zipfile

fmu, tolerance, work, *host = sys.argv[1:]
with zipfile.ZipFile(fmu) as archive:
    description = ElementTree.fromstring(archive.read("modelDescription.xml"))
    name = description.find("CoSimulation").get("modelIdentifier")
    library = archive.extract(f"binaries/win64/{name}.dll", work)
    run = f"extra/io.github.cosserat-rod/{name}"
    inputs, expected, options = (archive.read(f"{run}_{end}").decode() for end in ("in.csv", "ref.csv", "ref.opt"))

references = {variable.get("name"): variable.get("valueReference") for variable in description.iter("ScalarVariable")}


def table(text):
    header, *rows = csv.reader(io.StringIO(text))
    return header[1:], [[float(value) for value in row] for row in rows]


def listed(names):
    return ",".join(references[name] for name in names)


driven, _ = table(inputs)
compared, expected = table(expected)
relative = dict(line.split(",") for line in options.split())["RelTol"]
answer = subprocess.run(
    [*host, library, description.get("guid"), relative, listed(driven), listed(compared)],
    input=inputs.split("\n", 1)[1],
    stdout=subprocess.PIPE,
    text=True,
)
if answer.returncode != 0:
    sys.exit(f"{fmu}: the host ended with {answer.returncode}")
got = [[float(value) for value in line.split(",")] for line in answer.stdout.split()]
assert [row[0] for row in got] == [row[0] for row in expected], "not the same times"
sizes = {}
for k, variable in enumerate(compared, start=1):
    vector = variable.split("[")[0]
    sizes[vector] = max(sizes.get(vector, 0.0), *(abs(row[k]) for row in expected))
worst = 0.0
for k, variable in enumerate(compared, start=1):
    size = sizes[variable.split("[")[0]]
    difference = max(abs(a[k] - b[k]) for a, b in zip(got, expected)) / (size or 1.0)
    print(f"{variable}: differs by {difference:.1e} of {size:.3g}")
    worst = max(worst, difference)
if not worst <= float(tolerance):
    sys.exit(f"{fmu}: differs by {worst:.1e}, {tolerance} is allowed")
