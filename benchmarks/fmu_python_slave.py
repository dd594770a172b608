"""The PUMA 560 as an FMU in Python, as PythonFMU packs it: one Runge-Kutta step a call."""

import numpy as np
from pythonfmu import Fmi2Causality, Fmi2Slave, Real


class PumaSlave(Fmi2Slave):
    """Positions as outputs; the equations are called through CasADi from Python."""

    def __init__(self, **options):
        super().__init__(**options)
        import mbs

        self.direct = mbs.models.direct_dynamics(mbs.load("puma560").assemble())
        self.x = np.zeros(12)
        for k in range(6):
            name = f"q{k + 1}"
            setattr(self, name, 0.0)
            self.register_variable(Real(name, causality=Fmi2Causality.output))

    def slope(self, x):
        """The rate of the state."""
        a = np.array(self.direct(x[:6], x[6:], np.zeros(6))).ravel()
        return np.concatenate([x[6:], a])

    def do_step(self, current_time, step_size):
        """One classical Runge-Kutta step."""
        x, h = self.x, step_size
        k1 = self.slope(x)
        k2 = self.slope(x + h / 2 * k1)
        k3 = self.slope(x + h / 2 * k2)
        k4 = self.slope(x + h * k3)
        self.x = x + h / 6 * (k1 + 2 * k2 + 2 * k3 + k4)
        for k in range(6):
            setattr(self, f"q{k + 1}", float(self.x[k]))
        return True
