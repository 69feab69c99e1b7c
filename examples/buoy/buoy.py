"""A buoy in waves, made into an FMU by PythonFMU: takes the force of what hangs from it, gives its motion.

To a master that iterates, the force is that at the end of the step; `share`, one half then, weighs it against the one
before. `sample` is the velocity to give to the unit, which goes on with the change of its samples, for that of the buoy at
the end.
"""

from math import cos, pi, sin

from pythonfmu import Fmi2Causality, Fmi2Slave, Fmi2Variability, Real


class Buoy(Fmi2Slave):
    mass, stiffness, mooring = 40.0, 2500.0, 40.0  # kg, with the water it moves; N/m, of its waterline and of its mooring
    heave_damping, surge_damping = 300.0, 120.0  # N.s/m, against the water
    height, frequency, ramp = 0.5, 2 * pi / 4.0, 4.0  # of the waves, m, 1/s; how long they take to grow, s

    def __init__(self, **kwargs):
        super().__init__(**kwargs)
        self.share, self.carried = 1.0, 0.0
        fixed = dict(causality=Fmi2Causality.parameter, variability=Fmi2Variability.fixed)
        self.register_variable(Real("share", **fixed))
        self.register_variable(Real("carried", **fixed))
        for k in "xz":
            for name in ("position", "velocity", "sample", "force", "before"):
                setattr(self, f"{name}_{k}", 0.0)
            self.register_variable(Real(f"force_{k}", causality=Fmi2Causality.input))
            for name in ("position", "velocity", "sample"):
                self.register_variable(Real(f"{name}_{k}", causality=Fmi2Causality.output))
            # a state consists of variables
            self.register_variable(Real(f"before_{k}", causality=Fmi2Causality.local))

    def wave(self, time):
        """Elevation, its rate, and the velocity of the water along x."""
        grown = self.height * min(time / self.ramp, 1.0)
        angle = self.frequency * time
        return grown * sin(angle), grown * self.frequency * cos(angle), grown * self.frequency * sin(angle)

    def do_step(self, current_time, step_size):
        steps = 10
        dt = step_size / steps
        held_x = self.share * self.force_x + (1 - self.share) * self.before_x
        held_z = self.share * self.force_z + (1 - self.share) * self.before_z + self.carried
        for k in range(steps):
            level, rate, flow = self.wave(current_time + (k + 0.5) * dt)
            self.velocity_x += dt / self.mass * (
                held_x - self.mooring * self.position_x + self.surge_damping * (flow - self.velocity_x))
            self.velocity_z += dt / self.mass * (
                held_z + self.stiffness * (level - self.position_z) + self.heave_damping * (rate - self.velocity_z))
            self.position_x += dt * self.velocity_x
            self.position_z += dt * self.velocity_z
        self.sample_x = (self.velocity_x + self.sample_x) / 2
        self.sample_z = (self.velocity_z + self.sample_z) / 2
        self.before_x, self.before_z = self.force_x, self.force_z
        return True
