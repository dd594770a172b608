"""A mechanism: its description and its assembly."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, ClassVar

from mbs.arguments import names_given
from mbs.assembly import System
from mbs.components import Description
from mbs.components.locking import lock
from mbs.errors import DescriptionError
from mbs.loops.assemble import assemble
from mbs.result import Result, State, positions_of
from mbs.text import quoted

__all__ = ["Mechanism"]


class Mechanism(Description):
    """Bodies and joints connected in any order. Loops are found during assembly.

    Args:
        name: name of the mechanism.
        gravity: gravity acceleration in the world frame [m/s^2].
        mount: rotation of the base relative to the axes in which gravity is given, such as
            ("x", "pi") for a robot that hangs from the ceiling; or {"position": (0, 0, 2.5),
            "rotation": ("x", "pi")}. Poses stay relative to the base. Gravity and the mount are
            given in the frame "outer_world".
        parameters: values of the symbols that the components use.
        source: origin of the data, for catalogue entries and files.
        keep_order: number the links in the order in which the joints were added, as in a table of
            frames, instead of depth-first.
        guess: joint positions [rad or m] by coordinate name, from which `assemble` closes loops.

    Attributes:
        notes: changes, ignored parts, doubts and completions of the reader of a file.
        numbered: name of the body of each frame of the table from which the mechanism was made.
        shapes: shapes of the bodies with their points.
        values: number or Parameter of each symbol that has a value. Units, descriptions and
            bounds of the Parameter replace those of the components.
        mount: position and rotation of the base in the frame "outer_world".
    """

    has_fixed_attributes: ClassVar[bool] = True

    def assemble(
        self, guess: Mapping[str, float] | State | Result | None = None, active: Sequence[str] = ()
    ) -> System:
        """Assemble the mechanism: spanning tree, cut joints and loop closure.

        Args:
            guess: joint positions by coordinate name [rad or m]. The loops are closed near them.
                They replace the guesses of the mechanism itself. Positions without guess start at
                zero.
            active: names of the velocities that are to be independent in a system with loops,
                before those of the motors. Pivoting chooses the other independent velocities. If
                there are more names than the mobility, all of them have motors, and pivoting
                chooses among them.

        Returns:
            the assembled system, from which models are built.

        Raises:
            DescriptionError: guess or active has another type.
            AssemblyError: the components do not form a mechanism, or nothing in it can move.
            Unclosable: no configuration closes the loops.
        """
        guess = positions_of(guess)
        if not isinstance(guess, Mapping | None):
            raise DescriptionError(
                f"{self.name}: guess is {quoted(guess)}; give a dict of names to positions"
            )
        names = names_given(f"{self.name}: active", active, "j1", DescriptionError)
        return assemble(self, guess or {}, names)

    def lock(self, positions: Mapping[str, Any]) -> None:
        """Weld joints at given positions. Joints in loops can be locked.

        Couplings lock the joints that depend on locked joints. Each locked joint becomes a Fixed
        joint with the same name. Its motor, friction, spring and rotor are removed, as are forces
        along its coordinates and their guesses.

        Args:
            positions: positions of joints by name: a number or an expression [rad or m]. A joint
                with several positions requires as many numbers. The positions of a Spherical or
                Free joint are those of its frame_b in frame_a.

        Raises:
            DescriptionError: a joint does not exist, a position has the wrong length, couplings
                contradict the positions, or a sensor or drive line is attached to the joint.
        """
        lock(self, positions)
