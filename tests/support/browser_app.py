"""The app served by a process of its own, and a browser that visits it."""

from __future__ import annotations

import os
import shutil
import socket
import subprocess
import sys
import time
import urllib.error
import urllib.request
from contextlib import contextmanager
from pathlib import Path
from urllib.parse import urlsplit

import pytest

NAMES = ("chromium", "chromium-browser", "google-chrome", "chrome")
ARGUMENTS = [
    "--no-sandbox",
    "--disable-gpu",
    "--use-gl=angle",
    "--use-angle=swiftshader",
    "--enable-unsafe-swiftshader",
    "--no-first-run",
    "--disable-background-networking",
    "--disable-component-update",
    "--disable-sync",
]
PATIENCE = 60_000
"""Milliseconds that a visitor waits for anything before a test fails."""

_START = "import sys; from mbs.app.web.server import serve; serve(int(sys.argv[1]), 'rx90', False)"
_DRAWN = "() => window.appView && appView.drawn > 0"


@contextmanager
def served(log):
    """The address of a app with the RX90 that runs in a process of its own.

    Args:
        log: file for what the process says.
    """
    with socket.socket() as free:
        free.bind(("127.0.0.1", 0))
        port = free.getsockname()[1]
    address = f"http://127.0.0.1:{port}/"
    with Path(log).open("wb") as stream:
        command = [sys.executable, "-c", _START, str(port)]
        with subprocess.Popen(command, stdout=stream, stderr=stream, env=_plain()) as process:
            try:
                _wait(address, process, log)
                yield address
            finally:
                process.terminate()


def _plain():
    """The environment without what tells NiceGUI that it is being tested."""
    return {k: v for k, v in os.environ.items() if not k.startswith(("PYTEST_", "NICEGUI_"))}


def _wait(address, process, log):
    deadline = time.monotonic() + PATIENCE / 1000
    while True:
        try:
            urllib.request.urlopen(address, timeout=5).close()
            return
        except urllib.error.URLError:
            told = Path(log).read_text(errors="replace")
            assert process.poll() is None, f"the app ended: {told}"
            assert time.monotonic() < deadline, f"the app does not answer: {told}"
            time.sleep(0.05)


@contextmanager
def browser():
    """A headless Chromium; the test is skipped where there is none."""
    playwright = pytest.importorskip("playwright.sync_api", reason="playwright is not installed")
    found = next(filter(None, map(shutil.which, NAMES)), None)
    with playwright.sync_playwright() as started:
        own = Path(started.chromium.executable_path)
        if found is None and not own.exists():
            pytest.skip(f"there is no browser: none of {', '.join(NAMES)} is installed")
        launched = started.chromium.launch(executable_path=found or str(own), args=ARGUMENTS)
        try:
            yield launched
        finally:
            launched.close()


class Visitor:
    """One visitor of the app, with cookies and storage of its own."""

    def __init__(self, launched, address):
        self.address = address
        self.context = launched.new_context(
            viewport={"width": 1200, "height": 760}, accept_downloads=True
        )
        self.context.set_default_timeout(PATIENCE)
        self.outside, self.complaints = [], []
        self.context.on("request", self._asked)
        self.page = self.context.new_page()
        self.page.on("pageerror", lambda error: self.complaints.append(str(error)))

    def _asked(self, request):
        parts = urlsplit(request.url)
        if parts.scheme not in ("data", "blob") and parts.hostname != "127.0.0.1":
            self.outside.append(request.url)

    def arrive(self):
        """Open the page and wait for the picture."""
        self.page.goto(self.address)
        self.page.wait_for_function(_DRAWN)

    def come_back(self):
        """Reload the page and wait for the picture."""
        self.page.reload()
        self.page.wait_for_function(_DRAWN)

    def leave(self):
        """Close everything; nothing was asked from outside, and no script failed."""
        self.context.close()
        assert self.outside == []
        assert self.complaints == []

    def choose(self, menu, item):
        """Click an entry of a menu."""
        self.page.locator(".app-menu", has_text=menu).click()
        self.page.locator(".q-menu .q-item", has_text=item).click()

    def button(self, name):
        """The button that is shown with this text."""
        return self.page.get_by_role("button", name=name, exact=True).locator("visible=true")

    def cell(self, row, column):
        """A cell of the table that is shown."""
        place = f'.ag-row[row-index="{row}"] .ag-cell[col-id="{column}"]'
        return self.page.locator(place).locator("visible=true")

    def write(self, row, column, text):
        """Type into a cell."""
        self.cell(row, column).click()
        editor = self.page.locator(".ag-cell-inline-editing input")
        editor.fill(text)
        editor.press("Enter")

    def joint(self, number):
        """The field of the number of a joint, counted from 0."""
        return self.page.locator(".app-joint .q-field input").nth(number)

    def move(self, values):
        """Type positions of the joints, each one when the app has answered to the one before."""
        for number, value in enumerate(values):
            self.joint(number).fill(repr(value))
            self.joint(number).press("Enter")
            self.page.wait_for_function(
                "([k, text]) => document.querySelectorAll('.app-joint .q-field input')[k].value"
                " === text",
                arg=[number, f"{value:.4f}"],
            )

    def until_joint(self, number, value):
        """Wait until the field of a joint shows a value."""
        self.page.wait_for_function(
            "([k, x]) => Math.abs(document.querySelectorAll('.app-joint .q-field input')[k].value"
            " - x) < 6e-5",
            arg=[number, value],
        )

    @property
    def joints(self):
        """What the fields of the joints show."""
        fields = self.page.locator(".app-joint .q-field input").all()
        return [float(field.input_value()) for field in fields]

    @property
    def picture(self):
        """The picture as a PNG, as text."""
        return self.page.evaluate("() => appView.viewer.screenshot()")

    def until_other_picture(self, before):
        """Wait until the picture is another one."""
        self.page.wait_for_function(
            "before => appView.viewer.screenshot() !== before", arg=before, polling=300
        )

    def downloaded(self, click, folder):
        """The file that a click brings."""
        with self.page.expect_download() as coming:
            click()
        path = folder / coming.value.suggested_filename
        coming.value.save_as(path)
        return path
