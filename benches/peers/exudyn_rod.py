"""exudyn: geometrically exact beams in the plane (linear and quadratic) and in space, and ANCF cables.

As its authors recommend for beams: implicit generalised alpha with index-3 constraints, modified Newton
(the full one where it fails), the sparse direct solver, Lie-group nodes with rotation vectors in space,
adaptive steps where Newton does not converge. Where index 3 is unstable (the coil, and the umbilical in
space), the trapezoidal rule with index-2 constraints, which exudyn offers too. The beam in space takes no
rest curvature, so the coil is a polygon of straight beams, two nodes at a corner, held together by generic
joints with the rotation from one to the next.
"""

import io
import time
from contextlib import redirect_stdout

import exudyn as exu
import numpy as np
from exudyn.itemInterface import (
    CoordinateConstraint,
    GenericJoint,
    LoadForceVector,
    LoadMassProportional,
    LoadTorqueVector,
    MarkerBodyMass,
    MarkerBodyRigid,
    MarkerNodeCoordinate,
    MarkerNodeRigid,
    NodePoint2DSlope1,
    NodePointGround,
    NodePointSlope1,
    NodeRigidBody2D,
    NodeRigidBodyRotVecLG,
    ObjectANCFCable,
    ObjectANCFCable2D,
    ObjectBeamGeometricallyExact,
    ObjectBeamGeometricallyExact2D,
    ObjectRigidBody2D,
    SensorNode,
    SensorObject,
)
from exudyn.rigidBodyUtilities import RotationMatrix2RotationVector
from scipy.interpolate import CubicSpline

from scenes import Scene, chords
from score import Result, main, measure

PLANAR = ("ge2d1", "ge2d2", "ancf2d")
BODY = np.array(
    [[0, 1, 0], [0, 0, 1], [1, 0, 0]], float
)  # exudyn's beam axes (tangent first) in those of the scene


class Model:
    """A rod of n elements in an exudyn system, ready to solve."""

    def __init__(self, scene: Scene, form: str, n: int):
        self.scene, self.form, self.n = scene, form, n
        self.container = exu.SystemContainer()
        self.mbs = self.container.AddSystem()
        ground = self.mbs.AddNode(NodePointGround(referenceCoordinates=[0, 0, 0]))
        self.origin = self.mbs.AddMarker(MarkerNodeCoordinate(nodeNumber=ground, coordinate=0))
        self.reactions: list[int] = []
        if form in PLANAR:
            self.first, self.last, elements = self.planar()
            self.clamp(
                self.first, (0, 1, 2 if form != "ancf2d" or abs(scene.frame[0, 2]) < 0.5 else 3), (0, None, 1)
            )
        elif form == "ancf3d":
            self.first, self.last, elements = self.cable()
            across = (4, 5) if abs(scene.frame[0, 2]) > 0.5 else (3, 4)
            self.clamp(self.first, (0, 1, 2, *across), (0, 1, 2))
        elif any(scene.rest_curvature):
            self.first, self.last, elements = self.polygon()
            self.clamp(self.first, range(6), (0, 1, 2))
        else:
            self.first, self.last, elements = self.spatial()
            if scene.turn is None:
                self.clamp(self.first, range(6), (0, 1, 2))
            else:
                self.crank()
        self.weigh(elements)
        if scene.load is not None:
            self.load()
        self.tip = self.sensor(
            SensorNode, nodeNumber=self.last, outputVariableType=exu.OutputVariableType.Position
        )
        force = exu.OutputVariableType.Force if scene.turn is None else exu.OutputVariableType.ForceLocal
        self.forces = [
            self.sensor(SensorObject, objectNumber=c, outputVariableType=force) for c in self.reactions
        ]
        self.mbs.Assemble()

    def sensor(self, kind, **what) -> int:
        return self.mbs.AddSensor(kind(storeInternal=True, writeToFile=False, **what))

    def point(self, s: float) -> list[float]:
        return list(s * self.scene.frame[:, 2])

    def planar(self) -> tuple[int, int, list[int]]:
        """exudyn's x, y are the scene's x, z."""
        rod, n, d = self.scene.rod, self.n, self.scene.frame[:, 2]
        per = 2 if self.form == "ge2d2" else 1
        points = [s * d for s in np.linspace(0, rod.length, per * n + 1)]
        common = dict(
            length=rod.length / n,
            massPerLength=rod.rhoA,
            bendingStiffness=rod.EI,
            axialStiffness=rod.EA,
        )
        if self.form == "ancf2d":
            nodes = [
                self.mbs.AddNode(NodePoint2DSlope1(referenceCoordinates=[p[0], p[2], d[0], d[2]]))
                for p in points
            ]
        else:
            angle = float(np.arctan2(d[2], d[0]))
            nodes = [
                self.mbs.AddNode(NodeRigidBody2D(referenceCoordinates=[p[0], p[2], angle])) for p in points
            ]
        elements = []
        for i in range(n):
            numbers = nodes[per * i : per * (i + 1) + 1]
            elements.append(
                self.mbs.AddObject(
                    ObjectANCFCable2D(nodeNumbers=numbers, **common)
                    if self.form == "ancf2d"
                    else ObjectBeamGeometricallyExact2D(
                        nodeNumbers=numbers,
                        crossSectionInertia=rod.rhoI,
                        shearStiffness=rod.GA,
                        **common,
                    )
                )
            )
        return nodes[0], nodes[-1], elements

    def cable(self) -> tuple[int, int, list[int]]:
        """ANCF in space: no twist."""
        rod, n, d = self.scene.rod, self.n, list(self.scene.frame[:, 2])
        nodes = [
            self.mbs.AddNode(NodePointSlope1(referenceCoordinates=self.point(s) + d))
            for s in np.linspace(0, rod.length, n + 1)
        ]
        return (
            nodes[0],
            nodes[-1],
            [
                self.mbs.AddObject(
                    ObjectANCFCable(
                        nodeNumbers=nodes[i : i + 2],
                        length=rod.length / n,
                        massPerLength=rod.rhoA,
                        bendingStiffness=rod.EI,
                        axialStiffness=rod.EA,
                    )
                )
                for i in range(n)
            ],
        )

    def section(self, arc: float, chord: float) -> exu.BeamSection:
        """Stiffnesses and masses of a beam as long as the chord that stands for an arc."""
        rod, section = self.scene.rod, exu.BeamSection()
        section.stiffnessMatrix = np.diag([rod.EA, rod.GA, rod.GA, rod.GJ, rod.EI, rod.EI]) * chord / arc
        section.inertia = np.diag([2 * rod.rhoI, rod.rhoI, rod.rhoI]) * arc / chord
        section.massPerLength = rod.rhoA * arc / chord
        return section

    def node(self, position: np.ndarray, frame: np.ndarray) -> int:
        """A node whose frame has the tangent first."""
        turn = np.asarray(RotationMatrix2RotationVector(frame)).ravel()
        return self.mbs.AddNode(NodeRigidBodyRotVecLG(referenceCoordinates=[*position, *turn]))

    def spatial(self) -> tuple[int, int, list[int]]:
        h = self.scene.rod.length / self.n
        start, section = self.scene.base(0.0), self.section(h, h)
        nodes = [
            self.node(start + np.array(self.point(i * h)), self.scene.frame @ BODY) for i in range(self.n + 1)
        ]
        return (
            nodes[0],
            nodes[-1],
            [
                self.mbs.AddObject(
                    ObjectBeamGeometricallyExact(nodeNumbers=nodes[i : i + 2], length=h, sectionData=section)
                )
                for i in range(self.n)
            ],
        )

    def polygon(self) -> tuple[int, int, list[int]]:
        """Straight beams between points of the coil; the frame of each has its tangent along the chord."""
        h = self.scene.rod.length / self.n
        points, frames = chords(self.scene, np.arange(self.n + 1) * h)
        elements, ends = [], []
        for i, frame in enumerate(frames):
            chord = float(np.linalg.norm(points[i + 1] - points[i]))
            ends.append([self.node(p, frame @ BODY) for p in points[i : i + 2]])
            elements.append(
                self.mbs.AddObject(
                    ObjectBeamGeometricallyExact(
                        nodeNumbers=ends[-1], length=chord, sectionData=self.section(h, chord)
                    )
                )
            )
        for i in range(self.n - 1):
            markers = [
                self.mbs.AddMarker(MarkerNodeRigid(nodeNumber=k)) for k in (ends[i][1], ends[i + 1][0])
            ]
            self.mbs.AddObject(
                GenericJoint(
                    markerNumbers=markers, rotationMarker0=BODY.T @ frames[i].T @ frames[i + 1] @ BODY
                )
            )
        return ends[0][0], ends[-1][1], elements

    def clamp(self, node: int, coordinates, axes: tuple) -> None:
        """Holds coordinates of a node; `axes` are the coordinates along x, y and z."""
        shaken = {axes[0]: self.scene.shake[0], axes[2]: self.scene.shake[1]}
        for c in coordinates:
            motion, follow = shaken.get(c), {}
            if motion is not None:
                follow = dict(
                    offsetUserFunction=lambda mbs, t, item, offset, m=motion: m(t).value,
                    offsetUserFunction_t=lambda mbs, t, item, offset, m=motion: m(t).rate,
                )
            held = self.mbs.AddMarker(MarkerNodeCoordinate(nodeNumber=node, coordinate=c))
            constraint = self.mbs.AddObject(CoordinateConstraint(markerNumbers=[self.origin, held], **follow))
            if c in axes:
                self.reactions.append(constraint)

    def crank(self) -> None:
        """A body in the plane of the crank, its angle led by a constraint; the rod is welded to its end."""
        scene, mbs = self.scene, self.mbs
        pivot = mbs.AddNode(NodeRigidBody2D(referenceCoordinates=[0, 0, 0]))
        body = mbs.AddObject(ObjectRigidBody2D(nodeNumber=pivot, physicsMass=1.0, physicsInertia=1.0))
        for c in range(3):
            follow = (
                {}
                if c < 2
                else dict(
                    offsetUserFunction=lambda mbs, t, item, offset: scene.turn(t).value,
                    offsetUserFunction_t=lambda mbs, t, item, offset: scene.turn(t).rate,
                )
            )
            held = mbs.AddMarker(MarkerNodeCoordinate(nodeNumber=pivot, coordinate=c))
            mbs.AddObject(CoordinateConstraint(markerNumbers=[self.origin, held], **follow))
        end = mbs.AddMarker(MarkerBodyRigid(bodyNumber=body, localPosition=[scene.crank, 0, 0]))
        rod = mbs.AddMarker(MarkerNodeRigid(nodeNumber=self.first))
        self.reactions = [
            mbs.AddObject(GenericJoint(markerNumbers=[end, rod], rotationMarker0=scene.frame @ BODY))
        ]

    def weigh(self, elements: list[int]) -> None:
        g = self.scene.gravity
        if g == 0:
            return
        for element in elements:
            marker = self.mbs.AddMarker(MarkerBodyMass(bodyNumber=element))
            self.mbs.AddLoad(
                LoadMassProportional(
                    markerNumber=marker, loadVector=[0, -g, 0] if self.form in PLANAR else [0, 0, -g]
                )
            )

    def load(self) -> None:
        marker, load = self.mbs.AddMarker(MarkerNodeRigid(nodeNumber=self.last)), self.scene.load
        self.mbs.AddLoad(
            LoadForceVector(
                markerNumber=marker, loadVector=[1, 0, 0], loadVectorUserFunction=lambda mbs, t, v: load(t)[0]
            )
        )
        if any(load(0.1)[1]):
            self.mbs.AddLoad(
                LoadTorqueVector(
                    markerNumber=marker,
                    loadVector=[0, 0, 1],
                    loadVectorUserFunction=lambda mbs, t, v: load(t)[1],
                )
            )

    def stored(self, sensor: int) -> np.ndarray:
        return self.mbs.GetSensorStoredData(sensor)

    def history(self) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Times, tip and reaction in the scene's axes."""
        data = self.stored(self.tip)
        t, tip = data[:, 0], data[:, 1:4]
        force = np.hstack([self.stored(s)[:, 1:] for s in self.forces])
        if self.form in PLANAR:
            still = np.zeros(len(t))
            tip = np.stack([tip[:, 0], still, tip[:, 1]], axis=1)
            force = np.stack([force[:, 0], still, force[:, 1]], axis=1)
        if self.scene.turn is not None:  # a joint knows its force in the frame of the crank
            force = np.stack([self.scene.base_frame(x) @ BODY @ f for x, f in zip(t, force)])
        return t, tip, force


def solve(
    scene: Scene,
    form: str,
    n: int,
    steps: int,
    rho: float = 0.9,
    newton: str = "modified",
    adaptive: bool = False,
    index2: bool = False,
    relative: float = 1e-8,
    absolute: float = 1e-10,
) -> Result:
    """`steps` over the whole scene, `rho` the spectral radius at infinity."""
    model = Model(scene, form, n)
    settings = exu.SimulationSettings()
    settings.solutionSettings.writeSolutionToFile = False
    settings.solutionSettings.sensorsWritePeriod = 1e-9 * scene.T
    settings.timeIntegration.numberOfSteps = steps
    settings.timeIntegration.endTime = scene.T
    settings.timeIntegration.adaptiveStep = adaptive
    settings.timeIntegration.minimumStepSize = scene.T / steps / 64
    settings.timeIntegration.generalizedAlpha.spectralRadius = rho
    settings.timeIntegration.generalizedAlpha.useIndex2Constraints = index2
    settings.timeIntegration.generalizedAlpha.useNewmark = index2
    settings.timeIntegration.newton.useModifiedNewton = newton == "modified"
    for part in (settings.timeIntegration, settings.staticSolver):
        part.verboseMode = 0
        part.newton.relativeTolerance = relative
        part.newton.absoluteTolerance = absolute
    settings.staticSolver.loadStepDuration = 1e-6  # the motions of the base are functions of time here too
    settings.linearSolver.solverType = exu.LinearSolverType.EigenSparse
    settings.parallel.numberOfThreads = 1
    done = True
    start = time.process_time()
    try:
        with redirect_stdout(io.StringIO()):
            if scene.hangs:
                model.mbs.SolveStatic(settings, updateInitialValues=True)
            start = time.process_time()
            model.mbs.SolveDynamic(settings)
    except (Exception, SystemExit):
        done = False
    cpu = time.process_time() - start
    if not done and not len(model.stored(model.tip)):
        return Result(np.zeros(0), None, cpu, 0.0, False)
    t, tip, force = model.history()
    if not done or t[-1] < scene.T * (1 - 1e-9) or not np.isfinite(tip).all():
        return Result(tip, force, cpu, float(t[-1]), False)
    fresh = np.concatenate([[True], np.diff(t) > 0])
    sample = [CubicSpline(t[fresh], x[fresh])(scene.times) for x in (tip, force)]
    return Result(sample[0], sample[1], cpu, scene.T, True)


# What Newton takes to converge, scene by scene: its residual is one of forces, from 1e-8 N to 1e9 N.
CONVERGENCE = {
    "rope": {},
    "wire": dict(newton="full", relative=1e-5),
    "pulse": dict(rho=0.5, relative=1e-4, absolute=1e-6),
    "spring": dict(index2=True, relative=1e-6, absolute=1e-7),
    "hair": dict(rho=0.5, newton="full", adaptive=True),
    "spin": {},
    "umbilical": dict(rho=0.6, newton="full", relative=1e-6, absolute=1e-3),
}

# Elements and steps over the scene, coarse to fine; the first two of each are the quick ones.
SETTINGS = {
    "rope": {
        "ge2d2": [(6, 200), (16, 100), (16, 200), (32, 200), (32, 500), (64, 1000), (64, 2000)],
        "ge2d1": [(10, 200), (20, 200), (40, 200), (80, 200), (160, 500), (320, 1000)],
        "ancf2d": [(12, 200), (16, 500), (32, 1000), (64, 2000)],
        "ge3d": [(10, 200), (20, 200), (40, 200), (40, 500), (80, 500), (160, 1000)],
    },
    "wire": {
        "ge2d2": [(4, 200), (4, 400), (8, 400), (8, 1000), (8, 2000), (16, 4000)],
        "ge2d1": [(10, 200), (20, 200), (20, 400), (40, 1000), (80, 2000)],
        "ancf2d": [(4, 200), (8, 400), (12, 1000), (24, 2000), (24, 4000)],
        "ancf3d": [(4, 200), (8, 400), (12, 1000), (24, 2000), (24, 4000)],
        "ge3d": [(10, 200), (20, 200), (20, 400), (40, 1000), (80, 2000)],
    },
    "pulse": {"ge3d": [(10, 250), (20, 250), (40, 250), (80, 250), (80, 500), (160, 500), (160, 1000)]},
    "spring": {"ge3d": [(12, 100), (20, 200), (40, 200), (40, 400), (80, 400), (80, 1000), (160, 1000)]},
    "hair": {
        "ge2d2": [(12, 130), (16, 130), (16, 325), (32, 650), (32, 1300), (64, 2600)],
        "ge2d1": [(20, 130), (40, 325), (40, 650), (80, 1300), (160, 2600)],
        "ancf2d": [(16, 650), (32, 1300), (64, 2600)],
        "ge3d": [(10, 325), (20, 650), (40, 1300), (80, 2600)],
    },
    "spin": {"ge3d": [(10, 150), (20, 300), (40, 300), (40, 600), (80, 1500), (160, 3000)]},
    "umbilical": {
        "ge2d2": [(8, 240), (8, 480), (16, 600), (16, 1200), (32, 2400)],
        "ge2d1": [(16, 480), (32, 600), (64, 1200), (128, 2400)],
        "ancf2d": [(16, 600), (16, 2400), (32, 2400), (64, 4800)],
        "ancf3d": [(16, 2400), (32, 2400), (64, 4800)],
        "ge3d": [(16, 400), (40, 400), (40, 1200), (80, 1200), (80, 2400)],
    },
}


def words(scene: Scene, n: int, steps: int, how: dict) -> str:
    """A setting for the table."""
    said = [
        f"n={n}",
        f"dt={scene.T / steps:.3g}",
        "trapezoidal" if how.get("index2") else f"rho={how.get('rho', 0.9)}",
    ]
    said.append(f"{how.get('newton', 'modified')} Newton")
    if how.get("adaptive"):
        said.append("adaptive")
    if "relative" in how:
        said.append(f"tol={how['relative']:.0e}")
    return " ".join(said)


def table(scene: Scene, quick: bool) -> None:
    for form, sizes in SETTINGS[scene.name].items():
        how = dict(CONVERGENCE[scene.name])
        if (
            form == "ge3d" and scene.name == "umbilical"
        ):  # with index 3 the step must be small or the mesh fine
            how.update(index2=True)
        for n, steps in sizes[:2] if quick else sizes:
            measure(
                scene,
                f"exudyn-{form}",
                "planar" if form in PLANAR else "spatial",
                words(scene, n, steps, how),
                True,
                lambda: solve(scene, form, n, steps, **how),
            )


if __name__ == "__main__":
    main(dict.fromkeys(SETTINGS, table))
