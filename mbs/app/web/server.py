"""Server of the app: on this computer only, for browsers on this computer only."""

from __future__ import annotations

import socket
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from mbs.errors import MbsError
from mbs.text import install_command, quoted

if TYPE_CHECKING:
    from mbs.app.web.document.document import Document

HOST = "127.0.0.1"
_PATIENCE = 60.0
"""Time [s] that a page may lose its connection, on a busy computer, before it is reloaded."""

_DAY = 86400.0
"""Time [s] for which the session of a closed tab is kept: one day."""

_NAMES = ("127.0.0.1", "localhost", "[::1]")


def serve(
    port: int | None = None,
    robot: str | None = None,
    open_browser: bool = True,
    *,
    gravity: str = "",
    mount: Sequence[str] = (),
) -> None:
    """Serve the app and show it in a browser until the process is interrupted.

    The server listens on the loopback address. Requests with other host names or origins are
    rejected, so that pages of other sites cannot access the server.

    The address is printed as soon as the server is ready.

    Args:
        port: port number. Default: a free port.
        robot: name in the catalogue, or file, with which new visitors start. Default: the RX90.
        open_browser: whether to open the page in the browser of this computer.
        gravity: gravity of this robot in the world, "X,Y,Z" [m/s^2]; empty for its own.
        mount: steps of the mount of this robot, such as "x=pi" and "position=0,0,2.5".

    Raises:
        MbsError: NiceGUI is not installed, the robot cannot be read, or the port is in use.
    """
    require_nicegui()
    from nicegui import app, ui

    from mbs.app.web.app import warm_up
    from mbs.app.web.page import page_of
    from mbs.app.web.style import serve_assets

    first = robot_document(robot or "rx90", gravity, mount)
    number = free_port(port)
    serve_assets()
    app.storage.max_tab_storage_age = _DAY
    app.add_middleware(HostFilter)
    app.on_startup(warm_up)
    address = f"http://{HOST}:{number}/"
    app.on_startup(lambda: print(f"The app is at {address}; Ctrl+C ends it.", flush=True))
    ui.run(
        page_of(first),
        host=HOST,
        port=number,
        title=f"mbs · {first.name}",
        favicon="🦾",
        dark=None,
        tailwind=False,
        reload=False,
        reconnect_timeout=_PATIENCE,
        show=open_browser,
        show_welcome_message=False,
    )


class HostFilter:
    """Middleware that rejects requests to other host names or from pages of other sites."""

    def __init__(self, app: Any) -> None:
        self._app = app

    async def __call__(self, scope: Any, receive: Any, send: Any) -> None:
        """Pass a request of this computer to the app; answer 403 to other requests."""
        if scope["type"] not in ("http", "websocket") or is_local(scope["headers"]):
            await self._app(scope, receive, send)
        elif scope["type"] == "websocket":
            await send({"type": "websocket.close", "code": 1008})
        else:
            text = b"this server answers to 127.0.0.1 and localhost only"
            headers = [(b"content-type", b"text/plain"), (b"content-length", b"%d" % len(text))]
            await send({"type": "http.response.start", "status": 403, "headers": headers})
            await send({"type": "http.response.body", "body": text})


def is_local(headers: Iterable[tuple[bytes, bytes]]) -> bool:
    """Whether host and origin of a request are this computer.

    Args:
        headers: names and values of the HTTP headers.
    """
    found = {name.lower(): value.decode("latin-1") for name, value in headers}
    origin = found.get(b"origin")
    host = _host(found.get(b"host", ""))
    return host in _NAMES and (origin is None or _host(origin.partition("://")[2]) in _NAMES)


def _host(text: str) -> str:
    """Return the name in "name:port", in lower case."""
    name, colon, port = text.rpartition(":")
    return name.lower() if colon and port.isdecimal() else text.lower()


def robot_document(robot: str, gravity: str = "", mount: Sequence[str] = ()) -> Document:
    """Return the document of a robot from the catalogue or a file.

    Args:
        robot: name in the catalogue, or path of a file.
        gravity: "X,Y,Z" [m/s^2] instead of the gravity of the robot; empty to keep it.
        mount: steps of the mount of the robot, such as "x=pi".

    Raises:
        MbsError: the robot does not exist or is malformed, or gravity or mount is invalid.
    """
    from mbs.app.tasks.mounting import mounting_of
    from mbs.app.web.document.tables import GRAVITY_ROWS, MOUNT_ROW, Cell

    given = mounting_of(gravity, mount, names=("--gravity", "--mount"))
    document = _document(robot)
    for row, text in zip(GRAVITY_ROWS, given.get("gravity", ()), strict=False):
        document = document.changed(Cell("general", row, "value"), text)
    if mount:
        document = document.changed(Cell("general", MOUNT_ROW, "value"), "; ".join(mount))
    return document


def _document(robot: str) -> Document:
    """Return the document of a robot from the catalogue or a file.

    Raise an MbsError if the robot does not exist or the file is malformed.
    """
    from mbs.app.web.document.document import Document
    from mbs.robots import catalogue

    path = Path(robot)
    if robot in catalogue() or not path.suffix:
        return Document.of_name(robot)
    try:
        content = path.read_bytes()
    except OSError as error:
        raise MbsError(
            f"{robot}: the file cannot be read ({error.strerror}); give a readable file"
        ) from None
    return Document.of_upload(content, path.suffix)


def free_port(port: int | None) -> int:
    """Return the port, or a free port if it is None.

    Args:
        port: port number from 1 to 65535, or None.

    Raises:
        MbsError: the port number is invalid, or the port is in use.
    """
    if port is not None and not 0 < port < 65536:
        raise MbsError(f"port {quoted(port)}: a port is a number from 1 to 65535; give another one")
    with socket.socket(socket.AF_INET, socket.SOCK_STREAM) as trial:
        trial.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        try:
            trial.bind((HOST, port or 0))
        except OSError as error:
            raise MbsError(
                f"port {port} cannot be used ({error.strerror}); give another one, or none"
            ) from None
        return int(trial.getsockname()[1])


def require_nicegui() -> None:
    """Raise if NiceGUI is not installed.

    Raises:
        MbsError: NiceGUI is not installed.
    """
    try:
        import nicegui  # noqa: F401
    except ImportError:
        raise MbsError(
            "the app is shown by nicegui, which is not installed; run: " + install_command("app")
        ) from None
