"""A review's server as users start it, in a separate process, and plain requests to it."""

from __future__ import annotations

import http.client
import json
import os
import re
import signal
import subprocess
import sys
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from tests.patience import patience
from tests.shared_data import PROJECT_ROOT


@dataclass(frozen=True)
class Answer:
    code: int
    headers: dict[str, str]
    body: bytes

    def json(self) -> Any:
        return json.loads(self.body)


@dataclass
class ReviewServer:
    """``boresight review RUN``, with the further arguments ``words``; ``address`` includes the token."""

    run: Path
    port: int = 0
    words: tuple[str, ...] = ()
    address: str = field(init=False, default="")
    token: str = field(init=False, default="")

    def __enter__(self) -> ReviewServer:
        self.start()
        return self

    def __exit__(self, *_: object) -> None:
        self.kill(signal.SIGTERM)

    def start(self) -> None:
        command = [sys.executable, "-m", "pipeline.cli", "review", str(self.run), "--no-browser"]
        self.process = subprocess.Popen(
            [*command, "--port", str(self.port), *self.words],
            cwd=PROJECT_ROOT,
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            text=True,
            env=os.environ | {"PYTHONUNBUFFERED": "1"},
        )
        told = ""
        while (found := re.search(r"http://127\.0\.0\.1:(\d+)/\?token=(\S+)", told)) is None:
            line = self.process.stdout.readline()
            assert line, told + self.process.stderr.read()
            told += line
        self.address, self.port, self.token = found[0], int(found[1]), found[2]

    def kill(self, how: signal.Signals = signal.SIGKILL) -> None:
        self.process.send_signal(how)
        self.process.wait(timeout=patience(20))
        self.process.stdout.close()
        self.process.stderr.close()

    @property
    def origin(self) -> str:
        return f"http://127.0.0.1:{self.port}"

    def ask(self, path: str, method: str = "GET", body: object = None, **headers: str) -> Answer:
        """Send a request as the page does; ``headers`` replace the page's own, an empty one removes it."""
        own = {"Host": f"127.0.0.1:{self.port}", "Cookie": f"boresight-{self.port}={self.token}"}
        own |= {"Origin": self.origin} if method != "GET" else {}
        sent = body if isinstance(body, bytes) else json.dumps(body).encode() if body is not None else b""
        own |= {"Content-Length": str(len(sent))} if sent else {}
        connection = http.client.HTTPConnection("127.0.0.1", self.port, timeout=patience(30))
        try:
            connection.putrequest(method, path, skip_host=True, skip_accept_encoding=True)
            for name, value in (own | {k.title(): v for k, v in headers.items()}).items():
                if value:
                    connection.putheader(name, value)
            connection.endheaders(sent)
            got = connection.getresponse()
            return Answer(got.status, {k.lower(): v for k, v in got.getheaders()}, got.read())
        finally:
            connection.close()

    def act(self, revision: int, who: str = "Ada", **action: object) -> Answer:
        return self.ask("/api/actions", "POST", {"action": action, "who": who, "revision": revision})
