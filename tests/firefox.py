"""Firefox without a screen, controlled by its own remote protocol, Marionette.

No driver has to be installed.
"""

from __future__ import annotations

import json
import os
import shutil
import socket
import subprocess
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import pytest

from tests.patience import patience

_NAMES = ("firefox-esr", "firefox")
_START_S, _ANSWER_S = patience(60), patience(60)
# A fresh profile that opens no pages by itself; without a graphics card the processor draws WebGL.
_SETTINGS = {
    "marionette.port": 0, "webgl.force-enabled": True, "browser.shell.checkDefaultBrowser": False,
    "datareporting.policy.dataSubmissionEnabled": False, "toolkit.telemetry.reportingpolicy.firstRun": False,
    "browser.startup.page": 0, "network.proxy.type": 0,
}  # fmt: skip


# Keys without a character, as WebDriver names them (W3C WebDriver, 17.4.2).
_KEYS = {
    "Backspace": "\ue003", "Tab": "\ue004", "Enter": "\ue007", "Shift": "\ue008", "Control": "\ue009",
    "Escape": "\ue00c", "ArrowLeft": "\ue012", "ArrowUp": "\ue013", "ArrowRight": "\ue014",
    "ArrowDown": "\ue015", "Space": " ",
}  # fmt: skip


class Firefox:
    """One window of Firefox."""

    def __init__(self, port: int) -> None:
        self._socket = socket.create_connection(("127.0.0.1", port), timeout=_ANSWER_S)
        self._stream, self._last = self._socket.makefile("rb"), 0
        self._read()
        self.ask("WebDriver:NewSession", capabilities={})

    def ask(self, command: str, **given: object) -> Any:
        self._last += 1
        sent = json.dumps([0, self._last, command, given]).encode()
        self._socket.sendall(b"%d:%b" % (len(sent), sent))
        _, _, error, result = self._read()
        assert error is None, f"{command}: {error}"
        return result

    def js(self, expression: str) -> Any:
        """Return the value of an expression evaluated in the page."""
        script = f"return (0, eval)({json.dumps(expression)})"
        return self.ask("WebDriver:ExecuteScript", script=script, args=[], sandbox=None)["value"]

    def until(self, expression: str, seconds: float = 30) -> Any:
        end = time.monotonic() + patience(seconds)
        while time.monotonic() < end:
            if found := self.js(expression):
                return found
            time.sleep(0.1)
        raise AssertionError(f"never true: {expression}")

    def keys(self, *names: str) -> None:
        """Press keys one after the other; ``Shift+Tab`` presses both together."""
        for name in names:
            pressed = [_KEYS.get(part, part) for part in name.split("+")] if len(name) > 1 else [name]
            down = [{"type": "keyDown", "value": key} for key in pressed]
            up = [{"type": "keyUp", "value": key} for key in reversed(pressed)]
            hands = {"type": "key", "id": "keyboard", "actions": [*down, *up]}
            self.ask("WebDriver:PerformActions", actions=[hands])

    def close(self) -> None:
        self._stream.close()
        self._socket.close()

    def _read(self) -> Any:
        length = b""
        while not length.endswith(b":"):
            byte = self._stream.read(1)
            assert byte, "Firefox has gone"
            length += byte
        return json.loads(self._stream.read(int(length[:-1])))


@contextmanager
def firefox(folder: Path) -> Iterator[Firefox]:
    """Yield a Firefox with its profile in ``folder``, or skip the calling test and give the reason."""
    program = next((found for name in _NAMES if (found := shutil.which(name))), None)
    if program is None:
        pytest.skip("no Firefox: install the system's, for example firefox-esr of Debian")
    settings = (f"user_pref({json.dumps(k)}, {json.dumps(v)});\n" for k, v in _SETTINGS.items())
    (folder / "user.js").write_text("".join(settings))
    command = [program, "--headless", "--marionette", "--no-remote", "--profile", str(folder)]
    plain = {k: v for k, v in os.environ.items() if "proxy" not in k.lower()} | {"HOME": str(folder)}
    process = subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL, env=plain)
    try:
        window = Firefox(_port(folder, process))
        try:
            yield window
        finally:
            window.close()
    finally:
        process.terminate()
        process.wait(timeout=patience(20))


def _port(folder: Path, process: subprocess.Popen[bytes]) -> int:
    """Return the port that Firefox has chosen and written into its profile."""
    told, end = folder / "MarionetteActivePort", time.monotonic() + _START_S
    while time.monotonic() < end and process.poll() is None:
        if told.exists() and (port := told.read_text().strip()):
            return int(port)
        time.sleep(0.1)
    pytest.skip("Firefox does not start, or is too old to be driven")
