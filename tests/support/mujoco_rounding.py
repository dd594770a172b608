"""How exact MuJoCo is."""


def as_exact_as(mujoco, tolerance):
    """The tolerance, or what MuJoCo reaches: before 4.0 it finds principal axes to 7e-8 only."""
    return tolerance if int(mujoco.__version__.split(".")[0]) >= 4 else max(tolerance, 1e-6)
