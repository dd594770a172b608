"""Unit quaternions w, x, y, z for joints that turn freely."""

import casadi
from casadi import SX

from mbs.spatial.vectors import skew


def quaternion_rotation(quaternion: SX) -> SX:
    """(3, 3) orientation of the turned frame, of a unit quaternion (w, x, y, z).

    The diagonal is w2 + x2 - y2 - z2 and so on, which keeps R' R = |quaternion|^4 I when the norm
    is not one.

    Source: Khalil & Dombre 2002, section 3.6.
    """
    w, x, y, z = (quaternion[k] for k in range(4))
    ww, xx, yy, zz = w * w, x * x, y * y, z * z
    return casadi.vertcat(
        casadi.horzcat(ww + xx - yy - zz, 2 * (x * y - w * z), 2 * (x * z + w * y)),
        casadi.horzcat(2 * (x * y + w * z), ww - xx + yy - zz, 2 * (y * z - w * x)),
        casadi.horzcat(2 * (x * z - w * y), 2 * (y * z + w * x), ww - xx - yy + zz),
    )


def quaternion_rate(quaternion: SX, angular_velocity: SX) -> SX:
    """(4, 1) time derivative of the quaternion of a frame that turns with the velocity [rad/s].

    Args:
        quaternion: (4, 1) w, x, y, z.
        angular_velocity: (3, 1) in the turned frame.
    """
    w, e = quaternion[0], quaternion[1:4]
    return 0.5 * casadi.vertcat(
        -casadi.dot(e, angular_velocity),
        w * angular_velocity + casadi.mtimes(skew(e), angular_velocity),
    )
