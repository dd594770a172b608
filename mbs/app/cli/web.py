"""`mbs app`: the app in the browser."""

from __future__ import annotations

from typing import Annotated

import typer

from mbs.app.cli import completion
from mbs.app.cli.arguments import Gravity, Mount, examples

EXAMPLES = examples("mbs app", "mbs app rx90", "mbs app my_robot.toml --port 8080 --no-browser")


def app(
    robot: Annotated[
        str | None,
        typer.Argument(
            metavar="ROBOT",
            help="Name in the catalogue or a robot file to begin with.",
            autocompletion=completion.robots,
            show_default=False,
        ),
    ] = None,
    *,
    port: Annotated[
        int | None,
        typer.Option(
            metavar="PORT", min=1, max=65535, help="A free one when left out.", show_default=False
        ),
    ] = None,
    gravity: Gravity = "",
    mount: Mount = None,
    browser: Annotated[
        bool, typer.Option("--browser/--no-browser", help="Whether to open the page.")
    ] = True,
) -> None:
    """Open the app: robots, equations, simulation and identification on a page.

    The server listens on the loopback address only. It requires the extra app: pip install
    "casadi-mbs[app]" (or, in a clone, pip install -e ".[app]").
    """
    from mbs.app.web.server import serve

    serve(port=port, robot=robot, open_browser=browser, gravity=gravity, mount=mount or ())
