"""The assembled mechanism: frozen, with its tables; every model is built from it."""

from __future__ import annotations

import pickle
import threading
from collections.abc import Callable, Collection, Container, Iterable, Mapping, Sequence
from dataclasses import dataclass, field, fields
from typing import Any

import casadi
from casadi import SX, Function

from mbs.assembly import named_values
from mbs.assembly.diagram import Diagram, drawn
from mbs.assembly.pickling import Packed, content_of, packed, unpacked
from mbs.assembly.report import report
from mbs.assembly.system_data import SystemData
from mbs.assembly.tree import position_rate
from mbs.deprecation import RenamedAttribute
from mbs.errors import ModelError
from mbs.files import PathLike
from mbs.spatial import Pose

_BUILDING = threading.RLock()
"""Lock of all caches: two threads that request the same model get the same Function."""


@dataclass(frozen=True, slots=True, eq=False)
class System(SystemData):
    """An assembled mechanism, from which models are built.

    The attributes of `SystemData` contain its tables and symbols. Models are built once and cached.
    """

    _cache: dict[Any, Any] = field(default_factory=dict, repr=False)

    active = RenamedAttribute("independent")
    free = RenamedAttribute("chosen_coordinates")
    speeds = RenamedAttribute("velocity_coordinates")
    described = RenamedAttribute("parameterised_components")
    content = RenamedAttribute("fingerprint")
    recent = RenamedAttribute("memoised")
    z = RenamedAttribute("component_states")
    z_start = RenamedAttribute("component_start")

    def __reduce__(self) -> tuple[Any, ...]:
        """Return the pickle. It contains everything except the models, which are built again.

        Raises:
            ModelError: another process cannot import the class of a component.
        """
        try:
            return _unpickle, packed(self._data())
        except (AttributeError, pickle.PicklingError) as error:
            raise ModelError(
                f"{self.name}: the system cannot be pickled, since another process cannot import"
                f" the class of a component ({error}); define the class by a class statement at"
                " the top of a module"
            ) from error

    def _data(self) -> dict[str, Any]:
        """Return the attributes without the cache, by name."""
        return {f.name: getattr(self, f.name) for f in fields(SystemData)}

    def __repr__(self) -> str:
        kind = "closed" if self.is_closed else "open"
        size = f"{len(self.tree.links)} links, nq={self.nq}, nv={self.nv}"
        return f"<System {self.name}: {kind}, {size}>"

    def report(self) -> str:
        """Return a text on the tree, the loops, the mobility, parameters, forces and sensors."""
        return report(self)

    def draw(self, path: PathLike | None = None) -> Diagram:
        """Draw the connection graph: bodies, joints of the tree and cut joints.

        Args:
            path: .svg file to write in addition.

        Raises:
            ExportError: the file cannot be written.
        """
        return drawn(self, path)

    def qdot(self, q: Any, v: Any) -> Any:
        """Return the time derivative of q (nq, 1). It differs from v for quaternion joints only.

        Args:
            q: (nq, 1) positions, as SX, MX, DM or numpy array.
            v: (nv, 1) velocities.
        """
        rate: Function = self.cached("qdot", self._rate_function)
        return rate(q, v)

    def _rate_function(self) -> Function:
        """Return the Function ``qdot(q, v)`` of the time derivative of the positions."""
        q, v = SX.sym("q", self.nq), SX.sym("v", self.nv)
        rate = casadi.densify(position_rate(self.tree, q, v))
        return Function("qdot", [q, v], [rate], ["q", "v"], ["qdot"])

    def cached(self, key: Any, build: Callable[[], Any]) -> Any:
        """Return the cached value of a key. The first call computes it.

        Args:
            key: hashable key.
            build: callable that computes the value.
        """
        with _BUILDING:
            if key not in self._cache:
                self._cache[key] = build()
            return self._cache[key]

    def fingerprint(self) -> Packed | None:
        """Return a pickle that identifies the content of the system in all processes, cached.

        Returns:
            the pickle; None if the system contains code of a user, or cannot be pickled.
        """

        def build() -> Packed | None:
            found = content_of(self._data())
            # Equal texts may be one object or two, which changes a pickle. Unpacking decides it.
            return found and packed(unpacked(*found))

        content: Packed | None = self.cached("content", build)
        return content

    def memoised(self, kind: str, key: Any, build: Callable[[], Any], most: int) -> Any:
        """Return the value of a key from a cache that contains the last few values of a kind.

        Args:
            kind: name of the cache.
            key: key of the value.
            build: function that computes the value if the cache does not contain it.
            most: maximum number of values in the cache.
        """
        with _BUILDING:
            kept: dict[Any, Any] = self._cache.setdefault(("recent", kind), {})
            value = kept.pop(key) if key in kept else build()
            kept[key] = value  # the last one now
            while len(kept) > most:
                del kept[next(iter(kept))]
            return value

    def frame(self, name: str | int) -> tuple[int, Pose]:
        """Return the link and the pose of a frame.

        Args:
            name: name of the frame, or number of a link: 1, 2, ...; 0 is the base. If the mechanism
                was made from a table of frames, the number is that of the frame in the table, which
                also counts fixed frames.

        Returns:
            index of the link (-1 for the base) and pose of the frame in the frame of the link.

        Raises:
            ModelError: no frame has this name or number.
        """
        return named_values.frame_of(self, name)

    def position(self, values: Mapping[str, float] | Sequence[float] | None) -> list[float]:
        """Return positions q.

        Args:
            values: positions by coordinate name [rad or m], or all positions in order. Names of FMU
                variables such as j1.q are accepted for j1. Other positions are those of the
                assembled configuration.

        Returns:
            (nq,) positions.

        Raises:
            ModelError: a name is unknown, a sequence has the wrong length, or a value is not a
                finite number.
        """
        return named_values.position_of(self, values)

    def positions_at_cuts(self, values: Mapping[str, float]) -> dict[str, float]:
        """Return the given joint positions that belong to cut joints, with the same names.

        Args:
            values: joint positions by coordinate name [rad or m]. Other joints are left out.

        Raises:
            ModelError: a position of a cut joint is not a finite number.
        """
        return named_values.positions_at_cuts(self, values)

    def velocity(self, values: Mapping[str, float] | Sequence[float] | None) -> list[float]:
        """Return velocities v (nv,).

        Args:
            values: velocities by coordinate name [rad/s or m/s], or all velocities in order. Other
                velocities are zero.

        Raises:
            ModelError: as for `position`.
        """
        return named_values.velocity_of(self, values)

    def effort(self, values: Mapping[str, float] | Sequence[float] | None) -> list[float]:
        """Return joint efforts tau (nv,).

        Args:
            values: efforts by coordinate name [N m or N], or all efforts in order. Other efforts
                are zero.

        Raises:
            ModelError: as for `position`.
        """
        return named_values.effort_of(self, values)

    def plain_names(self, values: Any, kinds: Collection[str]) -> Any:
        """Return values by coordinate name, such as j1, from names of FMU variables, such as j1.q.

        Args:
            values: values by name. An argument of another type is returned unchanged.
            kinds: accepted ends of names, such as ("q",).

        Raises:
            ModelError: a value is given by both names, or the name is of another quantity.
        """
        return named_values.plain_names(self, values, kinds)

    def parameter_values(
        self, values: Mapping[str, float] | None = None, needed: Container[str] | None = None
    ) -> list[float]:
        """Return parameters p (np,).

        Args:
            values: values by name. Other parameters have their default values.
            needed: names of the parameters that must have a value; None if all must have a value.
                Other parameters without value are NaN.

        Raises:
            ModelError: a name is unknown, a parameter has no value, a value is out of its bounds,
                or a component rejects it.
        """
        return named_values.parameter_values(self, values, needed)

    def parameter_fault(self, p: Iterable[float]) -> str:
        """Return the error message on values of the parameters; empty if they are valid.

        Args:
            p: (np,) values. NaN means that no value is given.
        """
        return named_values.parameter_fault(self, p)


def _unpickle(*parts: Any) -> System:
    """Return the system of a pickle made by `System.__reduce__`."""
    return System(**unpacked(*parts))
