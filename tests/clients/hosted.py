"""A rod on a trolley of another maker, in the master of cofmupy: both its schemes, each with and without iteration."""

import contextlib
import io
import sys

import numpy as np
from cofmupy import Coordinator

rod, host = sys.argv[1:]
STEP, END = 0.002, 1.0


def connection(source, target):
    (a, x), (b, y) = source, target
    return {"source": {"id": a, "variable": x, "unit": "", "type": "fmu"},
            "target": {"id": b, "variable": y, "unit": "", "type": "fmu"}}


def run(method, iterative):
    coordinator = Coordinator()
    config = {
        "fmus": [
            # the rod hangs; the trolley starts away from rest, and so does the base
            {"id": "host", "path": host, "name": "host", "initialization": {}},
            {"id": "rod", "path": rod, "name": "rod",
             "initialization": {"base.orientation[2]": 1.0, "base.position[1]": 0.05}},
        ],
        "connections": [connection(("host", "position"), ("rod", "base.position[1]")),
                        connection(("host", "velocity"), ("rod", "base.velocity[1]")),
                        connection(("rod", "base.reaction_force[1]"), ("host", "force"))],
        "cosim_method": method,
        "iterative": iterative,
    }
    with contextlib.redirect_stdout(io.StringIO()):
        coordinator.start(config)
        for _ in range(round(END / STEP)):
            coordinator.do_step(STEP)
    result = coordinator.get_results()
    return [np.array(result[of]) for of in (("host", "position"), ("rod", "tip.position[1]"))]


runs = {(method, iterative): run(method, iterative)
        for method in ("jacobi", "gauss_seidel") for iterative in (False, True)}
reference = runs["gauss_seidel", True]
for (method, iterative), motions in runs.items():
    # the schemes differ by what they are late, of first order in the step
    away = max(np.abs(motion - best).max() / np.ptp(best) for motion, best in zip(motions, reference))
    assert away < 0.02, (method, iterative, away)
    print(f"cofmupy: {method}{', iterated' if iterative else ''}: within {away:.1e} of the swing of the last one")
