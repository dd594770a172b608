"""`mbs solve-ik`: all configurations in which a frame has a given pose."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Annotated, Any

import typer

from mbs.app.cli.arguments import Json, Parameters, Robot, examples
from mbs.app.cli.loading import configuration, numbers, system
from mbs.app.cli.printing import note, print_json
from mbs.errors import ModelError

if TYPE_CHECKING:
    from mbs.app.tasks.configurations import ConfigurationList
    from mbs.assembly import System

EXAMPLES = examples(
    "mbs solve-ik puma560 --xyz 0.4 0.1 0.3 --rpy 0 pi/2 0",
    "mbs solve-ik rx90 --q q1=0.3 --q q2=0.5 --q q5=1",
    'mbs solve-ik scara --pose "1 0 0 0.4  0 1 0 0.2  0 0 1 0.1"',
    "mbs solve-ik panda --q q2=0.4 --locked q3=0 --json",
    "mbs solve-ik panda --q q2=0.4 --redundant q7=16",
)

Triple = tuple[str, str, str]


Pose = Annotated[
    str | None,
    typer.Option(
        metavar="TEXT",
        help="Pose of the frame in the base: 12 or 16 numbers, row by row, or x y z roll"
        " pitch yaw in m and rad.",
        show_default=False,
    ),
]
Xyz = Annotated[
    Triple | None,
    typer.Option(metavar="X Y Z", help="Position of the frame in m.", show_default=False),
]
Rpy = Annotated[
    Triple | None,
    typer.Option(
        metavar="R P Y",
        help="Roll, pitch and yaw about the fixed axes x, y, z in rad; zero when left out.",
        show_default=False,
    ),
]
Q = Annotated[
    list[str] | None,
    typer.Option(
        metavar="NAME=VALUE",
        help="The pose that the frame has in this configuration in rad or m; may be repeated.",
        show_default=False,
    ),
]
Frame = Annotated[
    str | None,
    typer.Option(
        metavar="FRAME",
        help="Number of a link or name of a frame; the terminal one when left out.",
        show_default=False,
    ),
]
Seed = Annotated[
    list[str] | None,
    typer.Option(
        metavar="NAME=VALUE",
        help="Configuration that solutions are sorted by their distance from; may be repeated.",
        show_default=False,
    ),
]
Locked = Annotated[
    list[str] | None,
    typer.Option(
        metavar="NAME=VALUE",
        help="Joint that stays where it is; may be repeated.",
        show_default=False,
    ),
]
Redundant = Annotated[
    list[str] | None,
    typer.Option(
        metavar="NAME=COUNT",
        help="Joint beyond six that takes so many positions, from limit to limit; may be repeated.",
        show_default=False,
    ),
]


def solve_ik(
    robot: Robot,
    *,
    pose: Pose = None,
    xyz: Xyz = None,
    rpy: Rpy = None,
    q: Q = None,
    frame: Frame = None,
    options: dict[str, Any],
    seed: Seed = None,
    locked: Locked = None,
    redundant: Redundant = None,
    parameter: Parameters = None,
    json: Json = False,
) -> None:
    """Solve the inverse kinematics: all configurations in which a frame has a given pose.

    Specify the pose either by --pose, by --xyz with or without --rpy, or by --q. If there is no
    solution, the exit code is 1 and the reason is printed on the standard error.
    """
    from mbs.app.tasks.configurations import configurations

    assembled = system(robot, parameter)
    place = int(frame) if frame is not None and frame.isdecimal() else frame
    wanted = _pose(assembled, place, pose=pose, xyz=xyz, rpy=rpy, q=q)
    found = configurations(
        assembled,
        wanted,
        place,
        **options,
        seed=numbers(seed, "--seed") or None,
        locked=numbers(locked, "--locked") or None,
        redundant=_counts(redundant),
    )
    if json:
        print_json({**_data(found), "pose": wanted})
    elif found.rows:
        typer.echo(found.text)
    if not found.rows:
        note(f"mbs: {_reason(found)}")
        raise typer.Exit(1)


def pose_options() -> type:
    """Return the dataclass of the options of the inverse geometric model."""
    from mbs.models.inverse_geometry.options import PoseOptions

    return PoseOptions


def _counts(texts: list[str] | None) -> dict[str, int] | None:
    """Return the number of positions of each redundant joint, by name; None without texts.

    Raise a ModelError if a number is not an integer.
    """
    counts = dict[str, int]()
    for name, value in numbers(texts, "--redundant").items():
        if value != int(value):
            raise ModelError(f"--redundant {name}: {value:g} is no whole number of positions")
        counts[name] = int(value)
    return counts or None


def _pose(
    system: System,
    frame: str | int | None,
    *,
    pose: str | None,
    xyz: Triple | None,
    rpy: Triple | None,
    q: list[str] | None,
) -> Any:
    """Return the target pose (4, 4) from the options of the command.

    Raises:
        ModelError: not exactly one of the options specifies the pose.
    """
    from mbs.app.tasks.configurations import pose_from, pose_from_text, pose_of

    ways = [pose is not None, xyz is not None, bool(q)]
    if sum(ways) != 1 or (rpy is not None and xyz is None):
        raise ModelError(
            "solve-ik: say the pose in one way: --pose, --xyz with or without --rpy, or --q"
        )
    if pose is not None:
        return pose_from_text(pose)
    if xyz is not None:
        return pose_from(_three(xyz, "--xyz"), _three(rpy or ("0", "0", "0"), "--rpy"))
    return pose_of(system, configuration(system, q), frame)


def _three(texts: Sequence[str], option: str) -> list[float]:
    """Return texts as numbers; `option` is for error messages."""
    from mbs.expressions import number

    return [number(text, option) for text in texts]


def _reason(found: ConfigurationList) -> str:
    """Return the reason why there is no solution, with the nearest configuration if it is known."""
    reason = f"{found.system}: no solution, {found.reason}"
    near = found.nearest
    if near is None:
        return reason
    nearest = ", ".join(
        f"{name}={round(x, 6) + 0.0:g}" for name, x in zip(found.names, near.q, strict=True)
    )
    return f"{reason}; the nearest configuration is {nearest}"


def _data(found: ConfigurationList) -> dict[str, Any]:
    """Return the solutions as data for JSON."""
    near = found.nearest
    return {
        "robot": found.system,
        "frame": found.frame,
        "method": found.method,
        "names": found.names,
        "units": found.units,
        "solutions": [
            {
                "q": dict(zip(found.names, row.q, strict=True)),
                "branch": row.label,
                "residual": row.residual,
                "sigma_min": row.sigma,
                "multiplicity": row.multiplicity,
                "within_limits": row.within_limits,
                "family": row.family or None,
            }
            for row in found.rows
        ],
        "reason": found.reason,
        "nearest": near
        and {
            "q": dict(zip(found.names, near.q, strict=True)),
            "distance": near.distance,
            "angle": near.angle,
        },
    }
