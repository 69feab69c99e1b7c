"""A container of two rods, driven by fmpy, against the two stepped by hand."""

import json
import sys

from fmpy import simulate_fmu

container, expected = sys.argv[1:]
expected = json.load(open(expected))["chain"]
result = simulate_fmu(container, stop_time=1.0, step_size=0.01, output_interval=0.01, output=list(expected))
away = max(abs(result[name][-1] - value) for name, value in expected.items())
assert away < 1e-9, away
print(f"fmu-manipulation-toolbox: a container of two rods ends as by hand, within {away:.0e}")
