"""MuJoCo's cable plugin: an inextensible chain of rigid capsules with ball joints.

As its authors recommend: the implicitfast integrator, contacts off, the step below what the stiffness of
the joints allows (the plugin's moments are explicit in every integrator); and RK4, which carries further
where nothing is damped. A base that is shaken is an accelerated frame, one that turns is a hinge so heavy
that the rod does not slow it down. The segments have the inertia of a piece of the rod. With "clamp at
centre" the chain starts half a segment before its base, so that the welded first segment is centred on it:
the error of a rigid first segment, of first order, goes.
"""

import time

import mujoco
import numpy as np

from scenes import Scene, coil_pose
from score import Result, main, measure

FLYWHEEL = 1e9  # armature of the crank, kg m^2
BAD = (mujoco.mjtWarning.mjWARN_BADQACC, mujoco.mjtWarning.mjWARN_BADQVEL, mujoco.mjtWarning.mjWARN_BADQPOS)


def describe(
    scene: Scene, n: int, h: float, back: float, dt: float, integrator: str, unit: tuple[float, float]
) -> str:
    """The model; the units of length and mass are 1 / unit[0] m and 1 / unit[1] kg."""
    rod, (length, mass) = scene.rod, unit
    vertices = np.array([coil_pose(scene, i * h - back)[0] for i in range(n + 1)]) * length
    if not any(scene.rest_curvature):
        vertices[2] += (
            1e-7 * h * length * np.array([0, 1.0, 0])
        )  # the plugin wants a bend to find a first frame
    points = " ".join(f"{x:.17g}" for x in vertices.ravel())
    cable = f"""<composite type="cable" prefix="r" initial="none" vertex="{points}">
      <plugin plugin="mujoco.elasticity.cable"><config key="twist" value="{rod.shear * mass / length!r}"/>
      <config key="bend" value="{rod.young * mass / length!r}"/>
      <config key="flat" value="{"false" if any(scene.rest_curvature) else "true"}"/></plugin>
      <joint kind="main" damping="0"/>
      <geom type="capsule" size="{rod.radius * length!r}" mass="{rod.rhoA * h * mass!r}"/></composite>"""
    if scene.turn is not None:
        cable = f"""<body><joint name="crank" type="hinge" axis="0 0 1" armature="{FLYWHEEL!r}"/>
      <geom type="sphere" size="1e-3" mass="1e-3"/><body pos="{scene.crank!r} 0 0">{cable}</body></body>"""
    return f"""<mujoco><compiler autolimits="true"/>
    <extension><plugin plugin="mujoco.elasticity.cable"/></extension>
    <option timestep="{dt!r}" gravity="0 0 {-scene.gravity * length!r}" integrator="{integrator}">
      <flag contact="disable"/></option><worldbody>{cable}</worldbody></mujoco>"""


def weigh(model, scene: Scene, h: float, back: float, unit: tuple[float, float]) -> list[int]:
    """Gives the segments the inertia of a piece of the rod; of the first only what lies beyond the base."""
    rod, (length, mass) = scene.rod, unit
    segments = [b for b in range(model.nbody) if model.body(b).name.startswith("rB")]
    across = rod.rhoI / rod.rhoA
    for b in segments:
        m = rod.rhoA * h * mass
        main_inertia = m * np.array([h**2 / 12 + across, h**2 / 12 + across, 2 * across]) * length**2
        model.body_inertia[b] = sorted(main_inertia, reverse=True)
    if back > 0:
        first = segments[0]
        model.body_mass[first] /= 2
        model.body_inertia[first] /= 2
        model.body_ipos[first] *= 1.5
    return segments


def solve(
    scene: Scene,
    n: int,
    dt: float,
    centred: bool,
    integrator: str = "implicitfast",
    unit: tuple[float, float] = (1.0, 1.0),
) -> Result:
    h = scene.rod.length / (n - 0.5 if centred else n)
    back = h / 2 if centred else 0.0
    intervals = len(scene.times) - 1
    sub = max(1, int(np.ceil(scene.T / intervals / dt - 1e-9)))
    model = mujoco.MjModel.from_xml_string(
        describe(scene, n, h, back, scene.T / intervals / sub, integrator, unit)
    )
    segments = weigh(model, scene, h, back, unit)
    mujoco.mj_setConst(model, mujoco.MjData(model))
    data = mujoco.MjData(model)
    end, last = model.site("rS_last").id, segments[-1]
    crank = model.jnt_dofadr[model.joint("crank").id] if scene.turn is not None else None
    slides = [(axis, m) for axis, m in zip((0, 2), scene.shake) if m is not None]
    rests = np.array([0.0, 0.0, -scene.gravity]) * unit[0]

    def drive(t: float) -> None:
        """What acts at time t, formed from the kinematics of this step."""
        for axis, motion in slides:
            model.opt.gravity[axis] = rests[axis] - motion(t).acceleration * unit[0]
        if crank is not None:
            data.qfrc_applied[crank] = FLYWHEEL * scene.turn(t).acceleration
        if scene.load is not None:
            force, moment = scene.load(t)
            data.qfrc_applied[:] = 0
            mujoco.mj_applyFT(
                model, data, np.array(force), np.array(moment), data.site_xpos[end], last, data.qfrc_applied
            )

    def sample(t: float) -> tuple[np.ndarray, np.ndarray]:
        """Tip and force on the base."""
        mujoco.mj_step1(model, data)
        drive(t)
        mujoco.mj_forward(model, data)
        mujoco.mj_rnePostConstraint(model, data)
        load = np.array(scene.load(t)[0]) if scene.load is not None else 0.0
        still = scene.base(t) if crank is None else np.zeros(3)
        force = load - data.cfrc_int[segments[0]][3:] / (unit[0] * unit[1])
        return data.site_xpos[end] / unit[0] + still, force

    driven = slides or crank is not None or scene.load is not None
    history = [sample(0.0)]
    start = time.process_time()
    for k in range(1, intervals + 1):
        if not driven:
            mujoco.mj_step(model, data, sub)
        for i in range(sub if driven else 0):
            t = data.time
            if crank is not None and i == 0:
                turn = scene.turn(t)
                data.qpos[model.jnt_qposadr[0]], data.qvel[crank] = turn.value, turn.rate
            if integrator == "RK4":
                drive(t)
                mujoco.mj_step(model, data)
            else:
                mujoco.mj_step1(model, data)
                drive(t)
                mujoco.mj_step2(model, data)
        history.append(sample(scene.T * k / intervals))
        if any(data.warning[w].number for w in BAD) or not np.isfinite(history[-1][0]).all():
            return Result(np.zeros(0), None, time.process_time() - start, scene.T * k / intervals, False)
    tips, forces = (np.array(x) for x in zip(*history))
    return Result(tips, forces, time.process_time() - start, scene.T, True)


# Segments, step and integrator; the first three of each are the quick ones.
EULER, RK4 = "implicitfast", "RK4"
SETTINGS = {
    "rope": [
        (10, 3e-3, EULER),
        (20, 1.25e-3, EULER),
        (10, 3e-3, RK4),
        (20, 1.8e-3, RK4),
        (40, 3e-4, EULER),
        (40, 5e-4, RK4),
        (80, 1e-4, RK4),
    ],
    "wire": [(5, 5.8e-5, EULER), (10, 2.9e-5, EULER), (5, 5.8e-5, RK4), (20, 1.4e-5, EULER)],
    "pulse": [
        (10, 1e-3, EULER),
        (20, 6e-4, EULER),
        (10, 2e-3, RK4),
        (20, 5e-4, RK4),
        (40, 3e-4, EULER),
        (40, 1e-4, EULER),
        (40, 1.2e-4, RK4),
        (80, 6e-5, EULER),
    ],
    "spring": [(20, 2e-6, EULER), (40, 2e-6, EULER), (20, 2e-6, RK4), (40, 5e-7, EULER)],
    "hair": [(10, 2e-5, EULER), (20, 1e-5, EULER), (10, 2e-5, RK4), (40, 4e-6, EULER)],
    "spin": [
        (10, 1e-3, EULER),
        (20, 6e-4, EULER),
        (10, 2e-3, RK4),
        (20, 5e-4, RK4),
        (40, 3e-4, EULER),
        (80, 6e-5, EULER),
    ],
    "umbilical": [(10, 4e-3, EULER), (20, 2e-3, EULER), (10, 4e-3, RK4), (20, 2e-3, RK4), (40, 5e-4, EULER)],
}
PLAIN = 2  # settings that are run with the clamp at the first segment's end, too
MILLIMETRE_MILLIGRAM = (1e3, 1e6)  # for the hair: inertias below 1e-15 are refused


def table(scene: Scene, quick: bool) -> None:
    unit = MILLIMETRE_MILLIGRAM if scene.name == "hair" else (1.0, 1.0)
    settings = SETTINGS[scene.name]
    for centred in (False, True):
        for n, dt, integrator in settings[: PLAIN if not centred else 3 if quick else None]:
            how = f"n={n} dt={dt:.2g} {integrator}" + centred * " clamp at centre"
            measure(
                scene, "mujoco", "spatial", how, False, lambda: solve(scene, n, dt, centred, integrator, unit)
            )


if __name__ == "__main__":
    main(dict.fromkeys(SETTINGS, table))
