"""The trolley of a crane with its drive, made into an FMU by PythonFMU: takes a force, gives the motion of the trolley."""

from math import cos, pi, sin

from pythonfmu import Fmi2Causality, Fmi2Slave, Real


class Trolley(Fmi2Slave):
    mass, way, duration = 25.0, 3.0, 3.5  # kg; the move, m and s
    stiffness, damping = 4000.0, 600.0  # of the drive's controller, N/m and N.s/m

    def __init__(self, **kwargs):
        super().__init__(**kwargs)
        self.force = self.position = self.velocity = self.wanted = self.drive = 0.0
        self.register_variable(Real("force", causality=Fmi2Causality.input))
        for name in ("position", "velocity", "wanted", "drive"):
            self.register_variable(Real(name, causality=Fmi2Causality.output))

    def move(self, time):
        """Position and velocity wanted: a smooth move that begins after half a second."""
        part = min(max((time - 0.5) / self.duration, 0.0), 1.0)
        return (self.way * (part - sin(2 * pi * part) / (2 * pi)),
                self.way / self.duration * (1 - cos(2 * pi * part)))

    def do_step(self, current_time, step_size):
        steps = 10
        dt = step_size / steps
        for k in range(steps):
            self.wanted, velocity = self.move(current_time + (k + 1) * dt)
            self.drive = self.stiffness * (self.wanted - self.position) + self.damping * (velocity - self.velocity)
            self.velocity += dt * (self.drive + self.force) / self.mass
            self.position += dt * self.velocity
        return True
