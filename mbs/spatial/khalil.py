"""Modified Denavit-Hartenberg placement of a frame, with two additional parameters for branches.

T_ij = Rz(gamma) Tz(b) Rx(alpha) Tx(d) Rz(theta) Tz(r)

`frames_to` converts a pose to one placement or a product of several placements. The common
perpendicular of two nearly parallel axes is far away, and a symbolic angle between two axes may be
zero or negative. In these cases a fixed frame is inserted between the two axes.

Source: Khalil & Kleinfinger 1986.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import casadi
from casadi import DM, SX, Function

from mbs.spatial.pose import Pose, ScrewDisplacement
from mbs.spatial.rotation import axis_rotation
from mbs.spatial.vectors import exact_sum, vector

_QUARTER = math.pi / 2

_FARTHEST = 3.0
"""Largest distance of a frame along its axis to the common perpendicular, relative to the size of
the mechanism: lengths in the tables keep the order of the links, and positions keep all digits."""

_LEAST_SINE = 0.5
"""Least sine of the angle between axes with symbolic offsets: at 30 degrees or more the common
perpendicular is within twice the offset for all values of the symbols."""

_NOISE = 1e-14
"""Length relative to the size of the mechanism below which it counts as rounding error."""

_TIE = 1e-9
"""Tolerance on gamma at a quarter turn for the choice of its sign [rad]: rounding errors must not
decide it."""


@dataclass(frozen=True, slots=True)
class Khalil:
    """Placement of frame j relative to its antecedent i.

    Attributes:
        gamma: angle from x_i to the common perpendicular, about z_i [rad].
        b: distance from x_i to the common perpendicular, along z_i [m].
        alpha: angle from z_i to z_j, about the common perpendicular [rad].
        d: distance from z_i to z_j, along the common perpendicular [m].
        theta: angle from the common perpendicular to x_j, about z_j [rad].
        r: distance from the common perpendicular to x_j, along z_j [m].
    """

    gamma: SX
    b: SX
    alpha: SX
    d: SX
    theta: SX
    r: SX

    @staticmethod
    def identity() -> Khalil:
        """Return the placement of a frame j that coincides with frame i: six zeros."""
        return Khalil(*(SX(0) for _ in range(6)))

    @property
    def parameters(self) -> tuple[SX, SX, SX, SX, SX, SX]:
        """The six parameters gamma, b, alpha, d, theta, r."""
        return self.gamma, self.b, self.alpha, self.d, self.theta, self.r

    def pose(self) -> Pose:
        """Return the pose of frame j relative to frame i."""
        R = Pose.about("z", self.gamma) @ Pose.about("x", self.alpha) @ Pose.about("z", self.theta)
        if not R.chain:
            return Pose(R.R, self.position())
        first = Pose.about("z", self.gamma) @ Pose.translation(vector([self.d, 0, self.b]))
        last = Pose.about("z", self.theta) @ Pose.translation(vector([0, 0, self.r]))
        return Pose(R.R, self.position(), (first @ Pose.about("x", self.alpha) @ last).chain)

    @property
    def seat(self) -> tuple[ScrewDisplacement, ...]:
        """Two displacements from frame i to the axis of joint j.

        The first is a screw of gamma and b about z, the second a screw of alpha and d about x.
        """
        return ScrewDisplacement.about("z", self.gamma, self.b), ScrewDisplacement.about(
            "x", self.alpha, self.d
        )

    @property
    def fixed(self) -> tuple[ScrewDisplacement, ...]:
        """Three displacements from frame i to frame j, if no joint moves frame j.

        They are `seat`, then a screw of theta and r about z.

        A placement with theta = -90 degrees and alpha = 0 is written with gamma - 90 degrees and a
        translation by d along y.
        """
        if not self._shifts_across:
            return *self.seat, ScrewDisplacement.about("z", self.theta, self.r)
        turn = ScrewDisplacement.about("z", exact_sum(self.gamma, SX(-_QUARTER)), self.b)
        return (
            turn,
            ScrewDisplacement.about("y", SX(0), self.d),
            ScrewDisplacement.about("z", SX(0), self.r),
        )

    def split(self) -> tuple[Khalil, Khalil]:
        """Split off gamma and b, which commute with motions about and along z_i.

        Returns:
            placement with gamma and b only, and placement with the remaining parameters.
        """
        zero, gamma = SX(0), self.gamma
        left = zero
        if self._shifts_across:
            gamma, left = exact_sum(gamma, SX(-_QUARTER)), SX(_QUARTER)
        return Khalil(gamma, self.b, zero, zero, zero, zero), replace(self, gamma=left, b=zero)

    @property
    def _shifts_across(self) -> bool:
        """Whether the placement has theta = -90 degrees and alpha = 0: a shift along the y axis."""
        ahead = self.theta.is_constant() and float(self.theta) == -_QUARTER
        return bool(self.alpha.is_zero() and ahead)

    def position(self) -> SX:
        """(3, 1) origin of frame j in frame i [m]; it does not depend on theta."""
        gamma, alpha = axis_rotation("z", self.gamma), axis_rotation("x", self.alpha)
        return gamma.apply(vector([self.d, -self.r * alpha.s, self.b + self.r * alpha.c]))

    def rotate(self, angle: SX) -> Khalil:
        """Return the placement of frame j rotated about its own z axis.

        Args:
            angle: angle [rad], which is added to theta.
        """
        return replace(self, theta=self.theta + angle)

    def shift(self, distance: SX) -> Khalil:
        """Return the placement of frame j shifted along its own z axis.

        Args:
            distance: displacement [m], which is added to r.
        """
        return replace(self, r=self.r + distance)


def frames_to(pose: Pose, size: float) -> tuple[Khalil, ...]:
    """Convert a pose to one or more successive Khalil placements, whose product is the pose.

    One placement suffices if the common perpendicular of the two axes is near. Otherwise fixed
    frames precede it: one for a shift normal to both axes, and one for each further rotation by a
    symbol. No assumption is made on the sign of a symbol, or that its sine is nonzero.

    Parallel axes leave one distance free: then b is zero, and r contains the offset.

    Args:
        pose: numeric pose, or product of rotations by symbols about coordinate axes and numeric
            poses, with its `chain`.
        size: size of the mechanism, such as the length of its largest link [m].

    Returns:
        at least one placement. The frame of each placement is the antecedent of the next placement.

    Raises:
        ValueError: the orientation depends on symbols, and the pose has no chain.
    """
    if not pose.chain and not pose.R.is_constant():
        raise ValueError("a pose that symbols rotate has no chain of rotations")
    segments, theta, r = _segments(pose, size)
    frames: list[Khalil] = []
    slide = SX(0)  # remaining translation of the previous segment, along z
    for number, segment in enumerate(segments):
        last = number == len(segments) - 1
        segment.z = exact_sum(segment.z, slide)
        turn, height = (theta, r) if last else (SX(0), SX(0))
        found, slide = _frames(segment, turn, size)
        if last:
            found[-1] = found[-1].shift(exact_sum(height, slide))
        frames += found
    return tuple(frames)


@dataclass(slots=True)
class _Segment:
    """Displacement Rz(gamma) T(x, y, z) Rx(alpha), angles in rad and lengths in m.

    The translation is in the axes that gamma has rotated. Methods change the object in place.
    """

    gamma: SX
    x: SX
    y: SX
    z: SX
    alpha: SX

    def shift(self, x: SX, y: SX, z: SX) -> None:
        """Add (x, y, z) [m] to the translation, in the axes before the rotation alpha."""
        self.x, self.y, self.z = exact_sum(self.x, x), exact_sum(self.y, y), exact_sum(self.z, z)

    def shift_behind(self, x: SX, y: SX, z: SX) -> None:
        """Add (x, y, z) [m] to the translation, in the axes after the rotation alpha."""
        self.shift(*_rotate("x", self.alpha, x, y, z))


def _segments(pose: Pose, size: float) -> tuple[list[_Segment], SX, SX]:
    """Factor a pose into displacements Rz T Rx, followed by Rz(theta) Tz(r) of the last frame.

    Return the displacements, theta [rad] and r [m]. `size` [m] is the size of the mechanism:
    lengths below 1e-14 of it become zero.
    """
    segments: list[_Segment] = []
    # displacement after the last rotation about x: rotation about z, then shift in rotated axes
    theta, x, y, z = SX(0), SX(0), SX(0), SX(0)
    for axis, angle, p in _elementary(pose):
        if axis == "z":
            x, y, _ = _rotate("z", -angle, x, y, SX(0))
            theta = exact_sum(theta, angle)
        elif axis == "x" and theta.is_zero() and segments:
            before = segments[-1]
            before.shift_behind(x, y, z)
            before.alpha = exact_sum(before.alpha, angle)
            x, y, z = SX(0), SX(0), SX(0)
            if before.alpha.is_zero():
                segments.pop()
                theta, x, y, z = before.gamma, before.x, before.y, before.z
        elif axis == "x":
            segments.append(_Segment(theta, x, y, z, angle))
            theta, x, y, z = SX(0), SX(0), SX(0), SX(0)
        elif theta.is_zero() and segments:
            segments[-1].shift_behind(p[0], p[1], SX(0))
            z = exact_sum(z, p[2])
        else:
            x, y, z = exact_sum(x, p[0]), exact_sum(y, p[1]), exact_sum(z, p[2])
    if segments:
        segments[-1].shift_behind(*_rotate("z", theta, x, y, SX(0)))
        r = z
    elif theta.is_constant() or _direction(pose.p[0], pose.p[1]) is not None:
        # parallel axes: express the shift in the axes before the rotation
        segments, r = [_Segment(SX(0), pose.p[0], pose.p[1], pose.p[2], SX(0))], SX(0)
    else:
        segments, theta, r = [_Segment(theta, x, y, z, SX(0))], SX(0), SX(0)
    for segment in segments:
        _clean(segment, size)
    return segments, theta, SX(0) if _is_noise(r, size) else r


def _elementary(pose: Pose) -> Iterator[tuple[str, SX, Sequence[SX]]]:
    """Yield the factors of a pose as (axis, angle [rad], translation [m]).

    A rotation has the axis "z" or "x" and zero translation. A translation has the axis "" and angle
    zero. Rotations about y and numeric orientations are factored into rotations about z and x.
    """
    nothing = (SX(0), SX(0), SX(0))
    for step in pose.steps:
        if isinstance(step, Pose):
            yield "", SX(0), (step.p[0], step.p[1], step.p[2])
            gamma, alpha, theta = _euler_angles(DM(step.R).full().tolist())
            turns = [("z", gamma), ("x", alpha), ("z", theta)]
            yield from ((axis, SX(angle), nothing) for axis, angle in turns if angle)
        elif step.axis == "y":
            yield "z", SX(_QUARTER), nothing
            yield "x", step.angle, nothing
            yield "z", SX(-_QUARTER), nothing
        else:
            yield step.axis, step.angle, nothing


def _euler_angles(R: Sequence[Sequence[float]]) -> tuple[float, float, float]:
    """Return (gamma, alpha, theta) [rad] of R = Rz(gamma) Rx(alpha) Rz(theta).

    Gamma is between -90 and 90 degrees.

    If z of R is along z, gamma is zero. R has three numeric rows.
    """
    if R[0][2] == 0 and R[1][2] == 0:
        if R[2][2] > 0:
            return 0.0, 0.0, _atan2(R[1][0], R[0][0])
        return 0.0, math.pi, _atan2(-R[1][0], R[0][0])
    gamma = math.atan2(R[0][2], -R[1][2])
    sign = -1.0 if abs(gamma) > _QUARTER + _TIE else 1.0
    gamma = math.atan2(sign * R[0][2], -sign * R[1][2])
    sine = sign * math.hypot(R[0][2], R[1][2])
    alpha = math.atan2(sine, R[2][2])
    if abs(sine) > _LEAST_SINE:
        return gamma, alpha, _atan2(sign * R[2][0], sign * R[2][1])
    # gamma of nearly parallel axes is ill-conditioned: compute theta from R and this gamma
    s, c = math.sin(gamma), math.cos(gamma)
    along, across = c * R[0][0] + s * R[1][0], c * R[1][0] - s * R[0][0]
    up = math.cos(alpha) * across + math.sin(alpha) * R[2][0]
    if abs(up) < _NOISE:
        return gamma, alpha, 0.0 if along > 0 else math.pi
    if abs(along) < _NOISE:
        return gamma, alpha, math.copysign(_QUARTER, up)
    return gamma, alpha, _atan2(up, along)


def _atan2(y: float, x: float) -> float:
    """Return atan2(y, x), with +pi instead of -pi for y = -0.0."""
    return math.atan2(y + 0.0, x)


def _frames(segment: _Segment, theta: SX, size: float) -> tuple[list[Khalil], SX]:
    """Return the placements whose product is a segment times Rz(theta), and a length.

    The last placement must still be shifted along its z axis by the remaining length [m]. `size` is
    the size of the mechanism [m].
    """
    gamma, alpha, x, y, z = segment.gamma, segment.alpha, segment.x, segment.y, segment.z
    sine, cosine = axis_rotation("x", alpha).s, axis_rotation("x", alpha).c
    if sine.is_zero():
        alpha = SX(0.0 if float(cosine) > 0 else math.pi)
        towards = 0.0 if y.is_zero() else _direction(x, y)
        if towards is not None:
            # parallel axes: rotate x into the direction of the shift between them
            length = x if y.is_zero() else _rotate("z", SX(-towards), x, y, SX(0))[0]
            gamma = exact_sum(gamma, SX(towards))
            theta = exact_sum(theta, -cosine * towards)
            return [Khalil(gamma, SX(0), alpha, length, theta, SX(0))], cosine * z
    elif y.is_zero():
        return [Khalil(gamma, z, alpha, x, theta, SX(0))], SX(0)
    elif sine.is_constant():
        r = -y / sine
        b = exact_sum(z, -r * cosine)
        if _is_near(b, r, abs(float(sine)), size):
            return [Khalil(gamma, b, alpha, x, theta, SX(0))], r
    ahead = exact_sum(gamma, SX(_QUARTER))
    across = Khalil(ahead, z, SX(0), y, SX(-_QUARTER), SX(0))
    return [across, Khalil(SX(0), SX(0), alpha, x, theta, SX(0))], SX(0)


def _is_near(b: SX, r: SX, sine: float, size: float) -> bool:
    """Return whether the common perpendicular of two axes is near both frames.

    `b` and `r` are the distances of the frames along their axes [m], `sine` is the sine of the
    angle between the axes, and `size` the size of the mechanism [m]. For symbolic b or r, `sine`
    decides.
    """
    if b.is_constant() and r.is_constant():
        return max(abs(float(b)), abs(float(r))) <= _FARTHEST * size
    return sine >= _LEAST_SINE


def _rotate(axis: str, angle: SX, x: SX, y: SX, z: SX) -> tuple[SX, SX, SX]:
    """Rotate the vector (x, y, z) by `angle` [rad] about the axis "x" or "z".

    Exact zeros stay zero.
    """
    turn = axis_rotation(axis, angle)
    if axis == "x":
        y, z = exact_sum(turn.c * y, -turn.s * z), exact_sum(turn.s * y, turn.c * z)
    elif not (x.is_zero() and y.is_zero()):
        x, y = exact_sum(turn.c * x, -turn.s * y), exact_sum(turn.s * x, turn.c * y)
    return x, y, z


def _clean(segment: _Segment, size: float) -> None:
    """Set x, y, z of a segment to zero, in place, if they are rounding errors.

    They are compared with `size`, the size of the mechanism [m].

    A symbolic length becomes zero if it vanishes at all test values of its symbols.
    """
    lengths = (segment.x, segment.y, segment.z)
    x, y, z = (SX(0) if _is_noise(length, size) else length for length in lengths)
    if not all(length.is_constant() for length in (x, y, z)):
        samples = _samples(x, y, z)
        largest = [max(map(abs, sample)) for sample in samples]
        x, y, z = (
            SX(0)
            if samples
            and all(abs(s[k]) <= _NOISE * m for s, m in zip(samples, largest, strict=True))
            else length
            for k, length in enumerate((x, y, z))
        )
    segment.x, segment.y, segment.z = x, y, z


def _is_noise(length: SX, size: float) -> bool:
    """Return whether a length is a number of at most 1e-14 times `size` [m]."""
    return bool(length.is_constant() and abs(float(length)) <= _NOISE * size)


def _direction(x: SX, y: SX) -> float | None:
    """Return the angle of the vector (x, y) [rad], up to a half turn.

    None if it depends on symbols.
    """
    if x.is_constant() and y.is_constant():
        return math.atan2(float(y), float(x))
    if y.is_zero():
        return 0.0
    if x.is_zero():
        return _QUARTER
    samples = [sample for sample in _samples(x, y) if math.hypot(*sample) > 0]
    if not samples:
        return None
    first = max(samples, key=lambda sample: math.hypot(*sample))
    towards = math.atan2(first[1], first[0])
    s, c = math.sin(towards), math.cos(towards)
    same = all(abs(c * y - s * x) <= _NOISE * math.hypot(x, y) for x, y in samples)
    return towards if same else None


def _samples(*lengths: SX) -> list[tuple[float, ...]]:
    """Return the values of the lengths at six sets of values of their symbols.

    A set at which a length is not finite is omitted.
    """
    symbols = casadi.symvar(casadi.vertcat(*lengths))
    at = Function("lengths", [casadi.vertcat(*symbols)], [casadi.densify(casadi.vertcat(*lengths))])
    rows = [
        [
            # irregular values from 0.3 to 1.7 by the golden ratio, with varying signs
            (-1) ** (k * (m + 1) // 2) * (0.3 + 1.4 * ((0.618034 * (5 * k + m + 1)) % 1))
            for m in range(len(symbols))
        ]
        for k in range(6)
    ]
    values = (tuple(DM(at(row)).full().ravel().tolist()) for row in rows)
    return [value for value in values if all(map(math.isfinite, value))]
