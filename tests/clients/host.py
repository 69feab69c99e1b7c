"""A trolley on a spring, made into an FMU by PythonFMU: takes the reaction of a rod and gives the motion of its base."""

from math import cos, sin, sqrt

from pythonfmu import Fmi2Causality, Fmi2Slave, Fmi2Variability, Real


class Host(Fmi2Slave):
    def __init__(self, **kwargs):
        super().__init__(**kwargs)
        self.mass, self.stiffness = 1.0, 40.0
        self.force, self.position, self.velocity = 0.0, 0.05, 0.0
        fixed = dict(causality=Fmi2Causality.parameter, variability=Fmi2Variability.fixed)
        self.register_variable(Real("mass", **fixed))
        self.register_variable(Real("stiffness", **fixed))
        self.register_variable(Real("force", causality=Fmi2Causality.input))
        self.register_variable(Real("position", causality=Fmi2Causality.output))
        self.register_variable(Real("velocity", causality=Fmi2Causality.output))

    def do_step(self, current_time, step_size):
        """Exact for a force that is held."""
        w = sqrt(self.stiffness / self.mass)
        rest, c, s = self.force / self.stiffness, cos(w * step_size), sin(w * step_size)
        away = self.position - rest
        self.position, self.velocity = (rest + away * c + self.velocity / w * s,
                                        self.velocity * c - away * w * s)
        return True
