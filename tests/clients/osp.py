"""The rod in the fixed-step master of libcosim."""

import json
import sys

from libcosimpy.CosimExecution import CosimExecution
from libcosimpy.CosimLogging import CosimLogLevel, log_output_level
from libcosimpy.CosimObserver import CosimObserver
from libcosimpy.CosimSlave import CosimLocalSlave

unit, expected = sys.argv[1:]
expected = json.load(open(expected))["rod"]

log_output_level(CosimLogLevel.ERROR)
execution = CosimExecution.from_step_size(10_000_000)  # ns
rod = execution.add_local_slave(CosimLocalSlave(unit, "rod"))
number = {v.name.decode(): v.reference for v in execution.slave_variables(rod)}
observer = CosimObserver.create_last_value()
assert execution.add_observer(observer)
hangs = {"base.orientation[1]": 0.0, "base.orientation[2]": 1.0}
for name, value in {"length": 0.8, **hangs, "tip.force[1]": 0.03, "tip.force[2]": 0.02}.items():
    assert execution.real_initial_value(rod, number[name], value), name
assert execution.step(100), execution.status()
values = observer.last_real_values(rod, [number[name] for name in expected])
away = max(abs(value - expected[name]) for name, value in zip(expected, values))
# its times are whole nanoseconds, ours multiples of the step: they differ in the last digits
assert away < 1e-9, away
print(f"libcosimpy: all of {len(values)} outputs as by hand, within {away:.0e}")
