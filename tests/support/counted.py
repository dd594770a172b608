"""Functions that record the points at which they are evaluated."""

import casadi


class _Counted(casadi.Callback):
    def __init__(self, function, points):
        casadi.Callback.__init__(self)
        self.function, self.points = function, points
        self.construct(f"counted_{function.name()}", {})

    def get_n_in(self):
        return self.function.n_in()

    def get_n_out(self):
        return self.function.n_out()

    def get_sparsity_in(self, number):
        return self.function.sparsity_in(number)

    def get_sparsity_out(self, number):
        return self.function.sparsity_out(number)

    def has_jacobian(self):
        return True

    def get_jacobian(self, name, inames, onames, options):
        return self.function.jacobian()

    def eval(self, arguments):
        self.points.append([float(a) if a.numel() == 1 else a.full().ravel() for a in arguments])
        return self.function.call(arguments)


def counted(function):
    """The list of points, and a Function with the same values that adds a point at each call."""
    points = []
    return points, _Counted(function, points)
