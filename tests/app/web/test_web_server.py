import asyncio
import os
import re
import socket
import subprocess
import sys
import urllib.request
from pathlib import Path
from urllib.error import HTTPError

import pytest

from mbs import MbsError
from mbs.app.web.server import (
    HOST,
    HostFilter,
    free_port,
    is_local,
    require_nicegui,
    robot_document,
)


@pytest.mark.parametrize(
    ("host", "origin", "local"),
    [
        ("127.0.0.1:8080", None, True),
        ("localhost", "http://localhost:8080", True),
        ("LOCALHOST:80", None, True),
        ("[::1]:8080", None, True),
        ("127.0.0.1:8080", "http://evil.example", False),
        ("127.0.0.1:8080", "null", False),
        ("evil.example:8080", None, False),
        ("127.0.0.1.evil.example", None, False),
        ("", None, False),
    ],
)
def test_requests_of_this_machine_alone_are_local(host, origin, local):
    headers = [(b"Host", host.encode())] + ([(b"origin", origin.encode())] if origin else [])
    assert is_local(headers) is local


@pytest.mark.parametrize(
    ("kind", "first"),
    [("http", {"type": "http.response.start", "status": 403}), ("websocket", {"code": 1008})],
)
def test_the_guard_answers_strangers_itself(kind, first):
    sent, passed = [], []

    async def app(scope, receive, send):
        passed.append(scope["headers"])

    async def send(message):
        sent.append(message)

    guard = HostFilter(app)
    stranger, friend = [(b"host", b"evil.example")], [(b"host", b"127.0.0.1:1")]
    asyncio.run(guard({"type": kind, "headers": stranger}, None, send))
    assert passed == []
    assert first.items() <= sent[0].items()
    asyncio.run(guard({"type": kind, "headers": friend}, None, send))
    assert passed == [friend]


def test_ports_are_free_or_refused():
    assert 0 < free_port(None) < 65536
    with socket.socket() as taken:
        taken.bind((HOST, 0))
        taken.listen()
        with pytest.raises(MbsError, match="cannot be used"):
            free_port(taken.getsockname()[1])
    with pytest.raises(MbsError, match="from 1 to 65535"):
        free_port(70000)


def test_the_first_robot_is_a_name_or_a_file(tmp_path):
    assert robot_document("puma560").name == "puma560"
    path = tmp_path / "arm.toml"
    path.write_text(robot_document("rx90").toml())
    assert robot_document(str(path)).name == "rx90"
    with pytest.raises(MbsError, match="did you mean 'rx90'"):
        robot_document("rx9")
    with pytest.raises(MbsError, match="cannot be read"):
        robot_document(str(tmp_path / "none.par"))


def test_without_nicegui_one_sentence_names_the_extra(monkeypatch):
    monkeypatch.setitem(sys.modules, "nicegui", None)
    with pytest.raises(MbsError, match=r'install "casadi-mbs\[app\]"'):
        require_nicegui()


def test_the_server_listens_on_the_loopback_address_only():
    port = free_port(None)
    code = (
        "from mbs.app.web.server import serve\n"
        f"if __name__ == '__main__': serve(port={port}, robot='planar_2r', open_browser=False)"
    )
    plain = {k: v for k, v in os.environ.items() if not k.startswith(("PYTEST", "NICEGUI"))}
    command = [sys.executable, "-c", code]
    with subprocess.Popen(command, stderr=subprocess.PIPE, env=plain) as process:
        try:
            page = _first_page(process, port)
            request = urllib.request.Request(f"http://{HOST}:{port}/", headers={"Host": "evil.org"})
            with pytest.raises(HTTPError, match="403"):
                urllib.request.urlopen(request)
            assert _listening(port) == {"0100007F"}
        finally:
            process.terminate()
    assert "mbs · planar_2r" in page
    assert not re.search(r"(?:src|href)=[\"']?(?:https?:)?//", page)


def _first_page(process, port):
    for _ in range(600):
        assert process.poll() is None, process.stderr.read()
        try:
            with urllib.request.urlopen(f"http://{HOST}:{port}/", timeout=30) as answer:
                return answer.read().decode()
        except ConnectionError:
            continue
        except OSError as error:
            if not isinstance(getattr(error, "reason", None), ConnectionError):
                raise
        try:
            process.wait(0.1)
        except subprocess.TimeoutExpired:
            continue
    raise AssertionError("the server does not answer")


def _listening(port):
    """Addresses that listen on the port, as Linux writes them; those of this test elsewhere."""
    table = Path("/proc/net/tcp")
    if not table.exists():
        return {"0100007F"}
    lines = table.read_text().split("\n")[1:]
    rows = [line.split() for line in lines if line.strip()]
    here = [row[1].split(":") for row in rows if row[3] == "0A"]
    return {address for address, number in here if int(number, 16) == port}
