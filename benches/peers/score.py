"""Errors of a run against the reference of its own model, and the rows of the table.

tip error: RMS over the 101 times of |tip - reference| / L; reaction error: RMS of |n0 - reference| / max
|reference|, where n0 is the force that the rod exerts on its base. A code whose rod stretches and shears is
held against extensible/<scene>.json, if there is one; else stretch and shear are far below what is at
stake, and the reference of the inextensible rod, reference/<scene>.json, serves both. PEERS_REFERENCE names
another folder for the latter.
"""

import json
import os
import sys
import time
from dataclasses import dataclass
from pathlib import Path
from typing import Callable

import numpy as np

from scenes import Scene, scenes

HERE = Path(__file__).parent
INEXTENSIBLE = Path(os.environ.get("PEERS_REFERENCE", HERE / "reference"))
REPEAT_BELOW = 1.0  # seconds: a run this short is repeated
REPEATS = 3


@dataclass
class Result:
    """Samples at the scene's times; `reached` is the time at which a failed run stopped."""

    tip: np.ndarray
    force: np.ndarray | None
    cpu: float
    reached: float
    ok: bool


def reference(scene: Scene, extensible: bool) -> dict | None:
    paths = [INEXTENSIBLE / f"{scene.name}.json"]
    if extensible:
        paths.insert(0, HERE / "extensible" / f"{scene.name}.json")
    for path in paths:
        if path.exists():
            return json.loads(path.read_text())
    return None


def rms(difference: np.ndarray) -> float:
    return float(np.sqrt((difference**2).sum(axis=1).mean()))


def errors(scene: Scene, result: Result, extensible: bool) -> tuple[float | None, float | None]:
    """Tip and reaction error; None where there is none."""
    truth = reference(scene, extensible)
    if truth is None or not result.ok:
        return None, None
    tip = rms(result.tip - np.array(truth["tip"])) / scene.rod.length
    if scene.impulsive or result.force is None:
        return tip, None
    force = np.array(truth["base_force"])
    return tip, rms(result.force - force) / float(np.linalg.norm(force, axis=1).max())


def row(
    scene: str, code: str, kind: str, setting: str, cpu: float | None, tip: float | None, force: float | None
) -> None:
    numbers = ",".join("" if x is None else f"{x:.3g}" for x in (cpu, tip, force))
    print(f"{scene},{code},{kind},{setting},{numbers}", flush=True)


def measure(
    scene: Scene, code: str, kind: str, setting: str, extensible: bool, solve: Callable[[], Result]
) -> None:
    """Runs, repeats if short, scores, and prints a row."""
    start = time.process_time()
    result = solve()
    cpu = result.cpu
    if result.ok and cpu < REPEAT_BELOW:
        cpu = min([cpu] + [solve().cpu for _ in range(REPEATS - 1)])
    if not result.ok:
        setting += f" (failed at t={result.reached:.3g})"
    elif reference(scene, extensible) is None:
        setting += " (no reference)"
    row(scene.name, code, kind, setting, cpu, *errors(scene, result, extensible))
    spent = time.process_time() - start
    print(
        f"{scene.name} {code} {setting}: {spent:.1f} s with set-up and repeats", file=sys.stderr, flush=True
    )


def main(table: dict[str, Callable[[Scene, bool], None]]) -> None:
    """The command of a runner: [--quick] [scene ...]."""
    names = [a for a in sys.argv[1:] if not a.startswith("-")]
    quick = "--quick" in sys.argv
    for name, scene in scenes().items():
        if name in table and (not names or name in names):
            table[name](scene, quick)
