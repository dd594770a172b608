"""Signal blocks: controllers, filters, limits and sums between sensors and actuators.

A block has inputs and outputs, which `Mechanism.connect_signal` connects, and no position in the
mechanism. Most blocks are continuous in time; sampled blocks have events. Signals of blocks have
the unit 1: a block is independent of the unit of its signals.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import casadi
from casadi import SX

from mbs.components import custom
from mbs.components.component import Component
from mbs.components.custom import At, Custom, Event
from mbs.errors import DescriptionError
from mbs.expressions import expression, to_float, to_sx
from mbs.text import quoted


@dataclass(frozen=True, slots=True)
class SignalBlock(Custom):
    """Base of components with signals only."""

    def _require_order(self) -> None:
        """Raise DescriptionError if `low` and `high` are both numbers and low is not below high."""
        below, above = (self._parameter_value(name) for name in ("low", "high"))
        if below is not None and above is not None and below >= above:
            raise DescriptionError(
                f"{self.name}: low is {below:g} and high is {above:g}; give them in order"
            )

    def _parameter_value(self, name: str) -> float | None:
        """Return the numeric value of the parameter `name`; None if it is symbolic or left out."""
        given = getattr(self, name)
        return None if given is None else to_float(given)


def saturate(x: SX, low: SX | None, high: SX | None, width: SX) -> SX:
    """Return a value limited to the range from low to high, with rounded corners.

    Args:
        x: (1, 1) value.
        low: (1, 1) lower limit. None for no limit.
        high: (1, 1) upper limit. None for no limit.
        width: (1, 1) width over which the corners are rounded, zero for sharp corners.
    """
    if width.is_zero():
        x = x if low is None else casadi.fmax(x, low)
        return x if high is None else casadi.fmin(x, high)
    beyond_high = SX(0) if high is None else _ramp(x - high, width)
    return x - beyond_high if low is None else low + _ramp(x - low, width) - beyond_high


def _ramp(x: SX, width: SX) -> SX:
    """Return width log(1 + exp(x / width)) without overflow; fmax(x, 0) if the width is zero."""
    return casadi.fmax(x, 0) + width * casadi.log1p(
        casadi.exp(-casadi.fabs(x) / (width + (width == 0)))
    )


# Blocks without states.


class Constant(SignalBlock):
    """y = value.

    Attributes:
        value: value of the output.
    """

    value = custom.parameter()
    y = custom.output()

    def outputs(self, at: At) -> Mapping[str, SX]:
        """Return {"y": value}.

        Args:
            at: values of the component and motion of its ports, see `custom.At`.
        """
        return {"y": at.value}


class Gain(SignalBlock):
    """y = k u.

    Attributes:
        k: factor.
    """

    k = custom.parameter()
    u = custom.input()
    y = custom.output()

    def outputs(self, at: At) -> Mapping[str, SX]:
        """Return {"y": k u}.

        Args:
            at: values of the component and motion of its ports, see `custom.At`.
        """
        return {"y": at.k * at.u}


@dataclass(frozen=True, slots=True)
class Sum(SignalBlock):
    """y = weights[0] u1 + weights[1] u2 + ..., of up to four inputs.

    Attributes:
        weights: factor of each input, one to four. The default is (1, -1): u1 - u2.
    """

    weights: Any = (1.0, -1.0)

    u1 = custom.input()
    u2 = custom.input()
    u3 = custom.input()
    u4 = custom.input()
    y = custom.output()

    def __post_init__(self) -> None:
        Component.__post_init__(self)
        given = self.weights
        count = len(given) if isinstance(given, (tuple, list)) else 0
        if not 1 <= count <= 4:
            raise DescriptionError(
                f"{self.name}: weights are {quoted(given)}; give one to four numbers, such as"
                " (1, -1)"
            )
        found = tuple(
            expression(value, f"{self.name}, weight {number}")
            for number, value in enumerate(given, start=1)
        )
        object.__setattr__(self, "weights", found)

    @property
    def input_names(self) -> tuple[str, ...]:
        """Names of the used inputs: the first of u1 .. u4, one per weight."""
        return ("u1", "u2", "u3", "u4")[: len(self.weights)]

    def outputs(self, at: At) -> Mapping[str, SX]:
        """Return {"y": sum of weight times input}.

        Args:
            at: values of the component and motion of its ports, see `custom.At`.
        """
        pairs = zip(self.weights, self.input_names, strict=True)
        return {"y": sum((to_sx(w, at.symbols) * getattr(at, u) for w, u in pairs), SX(0))}


class Limiter(SignalBlock):
    """y = u between two limits, and the nearer limit beyond them.

    With a width w the corners are rounded: fmax(x, 0) becomes w log(1 + exp(x / w)). The
    difference is w log 2 at the corner and w exp(-10) at a distance of 10 w. y stays between the
    limits.

    Attributes:
        low, high: limits, one of which may be left out.
        width: width over which corners are rounded.
    """

    low = custom.parameter("1", None)
    high = custom.parameter("1", None)
    width = custom.parameter("1", 0.0, min=0)
    u = custom.input()
    y = custom.output()

    def __post_init__(self) -> None:
        Custom.__post_init__(self)
        if self.low is None and self.high is None:
            raise DescriptionError(
                f"{self.name}: neither low nor high is given; give one limit or both"
            )
        self._require_order()

    def outputs(self, at: At) -> Mapping[str, SX]:
        """Return {"y": u limited to the range from low to high}.

        Args:
            at: values of the component and motion of its ports, see `custom.At`.
        """
        return {"y": saturate(at.u, at.low, at.high, at.width)}


# Blocks with states, without limits.


class _FilterBlock(SignalBlock):
    """Base of blocks with the input u and the output y = x, a state."""

    x = custom.state()
    u = custom.input()
    y = custom.output()

    def outputs(self, at: At) -> Mapping[str, SX]:
        """Return {"y": x}.

        Args:
            at: values of the component and motion of its ports, see `custom.At`.
        """
        return {"y": at.x}


class Integrator(_FilterBlock):
    """y = x, dx/dt = k u.

    Attributes:
        k: factor [1/s].
    """

    k = custom.parameter("1/s", 1.0)

    def rates(self, at: At) -> Mapping[str, SX]:
        """Return {"x": k u}.

        Args:
            at: values of the component and motion of its ports, see `custom.At`.
        """
        return {"x": at.k * at.u}


class FirstOrder(_FilterBlock):
    """A first-order filter: y = x, time dx/dt = k u - x.

    Attributes:
        time: time constant [s].
        k: static gain.
    """

    time = custom.parameter("s", positive=True)
    k = custom.parameter("1", 1.0)

    def rates(self, at: At) -> Mapping[str, SX]:
        """Return {"x": (k u - x) / time}.

        Args:
            at: values of the component and motion of its ports, see `custom.At`.
        """
        return {"x": (at.k * at.u - at.x) / at.time}


class SecondOrder(_FilterBlock):
    """A second-order filter: y = x, x'' + 2 damping w x' + w^2 x = w^2 k u.

    Attributes:
        w: natural angular frequency [rad/s].
        damping: damping ratio.
        k: static gain.
    """

    w = custom.parameter("rad/s", positive=True)
    damping = custom.parameter("1", 1.0, min=0)
    k = custom.parameter("1", 1.0)
    v = custom.state("1/s")

    def rates(self, at: At) -> Mapping[str, SX]:
        """Return {"x": v, "v": w^2 (k u - x) - 2 damping w v}.

        Args:
            at: values of the component and motion of its ports, see `custom.At`.
        """
        pull = at.w**2 * (at.k * at.u - at.x)
        return {"x": at.v, "v": pull - 2 * at.damping * at.w * at.v}


class RateLimiter(_FilterBlock):
    """A signal that follows the input with a limited rate: y = x, dx/dt = (u - x) / time.

    The rate is limited to the range from `-falling` to `rising`. Below the limits y lags by `time`.

    Attributes:
        rising: largest rate [1/s].
        falling: largest downward rate [1/s]. The default is `rising`.
        time: time constant [s].
        width: width over which the corners of the rate are rounded [1/s], see `Limiter`.
    """

    rising = custom.parameter("1/s", positive=True)
    time = custom.parameter("s", positive=True)
    falling = custom.parameter("1/s", None, positive=True)
    width = custom.parameter("1/s", 0.0, min=0)

    def rates(self, at: At) -> Mapping[str, SX]:
        """Return {"x": (u - x) / time limited to the range from -falling to rising}.

        Args:
            at: values of the component and motion of its ports, see `custom.At`.
        """
        down = at.rising if at.falling is None else at.falling
        return {"x": saturate((at.u - at.x) / at.time, -down, at.rising, at.width)}


# Controllers.


class ErrorController(SignalBlock):
    """Base of controllers: error e = target - measured, its integral, and limits of the output.

    The integral part is the state x, dx/dt = ki e + (u - u0) / tracking, with the output u0 before
    the limits. At a limit the integral part tracks the output instead of winding up
    (back-calculation).

    Source: Astrom & Hagglund 2006 for the form with tracking.
    """

    target = custom.input()
    measured = custom.input()
    u = custom.output()

    def __post_init__(self) -> None:
        Custom.__post_init__(self)
        self._require_order()
        low, high, tracking = (getattr(self, name) for name in ("low", "high", "tracking"))
        if low is None and high is None:
            if tracking is not None:
                raise DescriptionError(
                    f"{self.name}: tracking is {tracking}, but there are no limits; give low or"
                    " high, or leave tracking out"
                )
        elif tracking is None:
            self._require_ratio()

    def _require_ratio(self) -> None:
        """Raise DescriptionError if the default of `tracking`, kp / ki, is not a positive time."""
        found = {name: self._parameter_value(name) for name in ("kp", "ki")}
        known = {name: gain for name, gain in found.items() if gain is not None}
        if 0 in known.values() or (len(known) == 2 and known["kp"] * known["ki"] < 0):
            gains = " and ".join(f"{name} is {gain:g}" for name, gain in known.items())
            raise DescriptionError(
                f"{self.name}: {gains}, so that kp / ki is no time constant of the integral part at"
                " the limits; give tracking"
            )

    def rates(self, at: At) -> Mapping[str, SX]:
        """Return {"x": ki e, plus (u - u0) / tracking if the output has limits}.

        u is the limited output and u0 the output before the limits.

        Args:
            at: values of the component and motion of its ports, see `custom.At`.
        """
        rate = at.ki * (at.target - at.measured)
        if at.low is not None or at.high is not None:
            tracking = at.kp / at.ki if at.tracking is None else at.tracking
            rate += (self._saturate(at) - self._command(at)) / tracking
        return {"x": rate}

    def outputs(self, at: At) -> Mapping[str, SX]:
        """Return {"u": output, limited to the range from low to high}.

        Args:
            at: values of the component and motion of its ports, see `custom.At`.
        """
        return {"u": self._saturate(at)}

    def _saturate(self, at: At) -> SX:
        """Return the output: the result of `_command`, limited to the range from low to high."""
        return saturate(self._command(at), at.low, at.high, SX(0))

    def _command(self, at: At) -> SX:
        """Return the output before the limits; a subclass defines it."""
        raise NotImplementedError


class PI(ErrorController):
    """A PI controller: u = kp e + x, dx/dt = ki e, e = target - measured.

    Attributes:
        kp: gain.
        ki: gain of the integral part [1/s].
        low, high: limits of the output. The default is no limit.
        tracking: time constant of the integral part at a limit [s]. The default is kp / ki.
    """

    kp = custom.parameter()
    ki = custom.parameter("1/s")
    low = custom.parameter("1", None)
    high = custom.parameter("1", None)
    tracking = custom.parameter("s", None, positive=True)
    x = custom.state()

    def _command(self, at: At) -> SX:
        """Return kp e + x, the output before the limits, with e = target - measured."""
        return SX(at.kp * (at.target - at.measured) + at.x)


class PID(ErrorController):
    """A PID controller: u = kp e + x + kd (e - f) / filter, dx/dt = ki e, filter df/dt = e - f.

    f is the filtered error e = target - measured, so that (e - f) / filter is its filtered rate.

    Attributes:
        kp: gain.
        ki: gain of the integral part [1/s].
        kd: gain of the rate [s].
        filter: time constant of the rate's filter [s].
        low, high: limits of the output. The default is no limit.
        tracking: time constant of the integral part at a limit [s]. The default is kp / ki.
    """

    kp = custom.parameter()
    ki = custom.parameter("1/s")
    kd = custom.parameter("s")
    filter = custom.parameter("s", positive=True)
    low = custom.parameter("1", None)
    high = custom.parameter("1", None)
    tracking = custom.parameter("s", None, positive=True)
    x = custom.state()
    f = custom.state()

    def rates(self, at: At) -> Mapping[str, SX]:
        """Return the rates of the integral part "x" and of the filtered error "f".

        Args:
            at: values of the component and motion of its ports, see `custom.At`.
        """
        error = at.target - at.measured
        return {**ErrorController.rates(self, at), "f": (error - at.f) / at.filter}

    def _command(self, at: At) -> SX:
        """Return kp e + x + kd (e - f) / filter, the output before the limits.

        e is target - measured.
        """
        error = at.target - at.measured
        return SX(at.kp * error + at.x + at.kd * (error - at.f) / at.filter)


# Sampled blocks: their outputs are constant between sampling instants.


class SampledBlock(SignalBlock):
    """Base of sampled blocks: the state `left` is the time to the next sample [s]."""

    left = custom.state("s")

    def rates(self, at: At) -> Mapping[str, SX]:
        """Return {"left": -1}: the time to the next sample decreases by one second per second.

        Args:
            at: values of the component and motion of its ports, see `custom.At`.
        """
        return {"left": SX(-1)}

    def events(self, at: At) -> Mapping[str, Event]:
        """Return the event "samples" at left = 0, which resets `left` and sets sampled modes.

        Args:
            at: values of the component and motion of its ports, see `custom.At`.
        """
        return {"samples": Event(at.left, {"left": at.period, **self._sample(at)})}

    def _sample(self, at: At) -> Mapping[str, SX]:
        """Return the new values of modes at a sampling instant, by name.

        A subclass defines them.
        """
        raise NotImplementedError


class SampleHold(SampledBlock):
    """Sample and hold: y is the value of u at the last multiple of the period.

    Attributes:
        period: sampling period [s].
    """

    period = custom.parameter("s", positive=True)
    u = custom.input()
    y = custom.output()
    sample = custom.mode()

    def _sample(self, at: At) -> Mapping[str, SX]:
        """Return {"sample": u}: the mode gets the present input."""
        return {"sample": at.u}

    def outputs(self, at: At) -> Mapping[str, SX]:
        """Return {"y": u at the last sampling instant}.

        Args:
            at: values of the component and motion of its ports, see `custom.At`.
        """
        return {"y": at.sample}


class SampledPID(SampledBlock):
    """A sampled PID controller: u = kp e + x + kd (e - e0) / T, x += ki e T, e = target - measured.

    T is the period, e0 the error one period before, zero at the start. At a limit of the output
    the integral part x changes only away from the limit.

    Source: Astrom & Hagglund 2006 for the sampled form and conditional integration.

    Attributes:
        period: sampling period [s].
        kp: gain.
        ki: gain of the integral part [1/s].
        kd: gain of the rate [s].
        low, high: limits of the output. The default is no limit.
    """

    period = custom.parameter("s", positive=True)
    kp = custom.parameter()
    ki = custom.parameter("1/s", 0.0)
    kd = custom.parameter("s", 0.0)
    low = custom.parameter("1", None)
    high = custom.parameter("1", None)
    target = custom.input()
    measured = custom.input()
    u = custom.output()
    sample = custom.mode()
    x = custom.mode()
    error = custom.mode()

    def __post_init__(self) -> None:
        Custom.__post_init__(self)
        self._require_order()

    def _sample(self, at: At) -> Mapping[str, SX]:
        """Return the output "sample", integral part "x" and error "error" at a sampling instant."""
        error = at.target - at.measured
        more = at.x + at.ki * error * at.period
        given = at.kp * error + at.kd * (error - at.error) / at.period
        whole = given + more
        inside = saturate(whole, at.low, at.high, SX(0))
        # the integral part grows only if the output is not at a limit
        outwards = (whole - inside) * (more - at.x) > 0
        x = casadi.if_else(outwards, at.x, more)
        return {"sample": saturate(given + x, at.low, at.high, SX(0)), "x": x, "error": error}

    def outputs(self, at: At) -> Mapping[str, SX]:
        """Return {"u": output computed at the last sampling instant, within the limits}.

        Args:
            at: values of the component and motion of its ports, see `custom.At`.
        """
        return {"u": at.sample}
