"""Access control of the server: only this machine's browser, with the token, on the server's own page."""

from __future__ import annotations

import secrets
from dataclasses import dataclass
from http.cookies import CookieError, SimpleCookie
from urllib.parse import parse_qs

from starlette.datastructures import Headers
from starlette.responses import PlainTextResponse, RedirectResponse, Response
from starlette.types import ASGIApp, Message, Receive, Scope, Send

_POLICY = (
    "default-src 'none'; script-src 'self'; style-src 'self'; img-src 'self' data: blob:; "
    "connect-src 'self' blob:; worker-src 'self' blob:; font-src 'self'; frame-src 'self'; base-uri 'none'; "
    "form-action 'none'; frame-ancestors 'none'"
)
TWIN_POLICY = (
    "default-src 'none'; script-src 'unsafe-inline'; style-src 'unsafe-inline'; img-src data:; "
    "base-uri 'none'; form-action 'none'; frame-ancestors 'self'; sandbox allow-scripts"
)
"""A twin's page holds its scripts. In its sandbox it has no origin: it cannot ask the server anything."""
HEADERS = {
    "content-security-policy": _POLICY,
    "x-content-type-options": "nosniff",
    "referrer-policy": "no-referrer",
    "cross-origin-opener-policy": "same-origin",
    "cross-origin-resource-policy": "same-origin",
    "cache-control": "no-store",
}
_LARGEST_BODY = 1 << 20
_CHANGING = ("POST", "PUT", "PATCH", "DELETE")


@dataclass(frozen=True)
class Guard:
    """Wraps an application: refuses foreign hosts, foreign pages, missing tokens and large bodies.

    Attributes
    ----------
    app
    token : str
        Secret of the server's start; the page's first address contains it, later a cookie does.
    port : int
    """

    app: ASGIApp
    token: str
    port: int

    @property
    def cookie(self) -> str:
        """Name of the cookie; a browser sends it to every port of a host, so each port needs its own."""
        return f"boresight-{self.port}"

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Serve a request, or refuse it with the reason."""
        if scope["type"] == "lifespan":
            await self.app(scope, receive, send)
            return
        if scope["type"] != "http":
            await send({"type": "websocket.close", "code": 1008})
            return
        refusal = self._refusal(scope)
        if refusal is not None:
            await refusal(scope, receive, _with_headers(send))
            return
        await self.app(scope, receive, _with_headers(send))

    def _refusal(self, scope: Scope) -> Response | None:
        headers = Headers(scope=scope)
        hosts = (f"127.0.0.1:{self.port}", f"localhost:{self.port}")
        if headers.get("host", "") not in hosts:
            return PlainTextResponse("this server answers to 127.0.0.1 only", 421)
        if _token_in(scope) is not None:
            return self._first_visit(scope)
        if not self._same(_cookie(headers, self.cookie)):
            return PlainTextResponse("open the address that boresight review printed", 403)
        origins = tuple(f"http://{host}" for host in hosts)
        if scope["method"] in _CHANGING and headers.get("origin", "") not in origins:
            return PlainTextResponse("this page is not the server's own", 403)
        if "transfer-encoding" in headers:
            return PlainTextResponse("the header Content-Length is missing", 411)
        if int(headers.get("content-length", "0") or 0) > _LARGEST_BODY:
            return PlainTextResponse("too large", 413)
        return None

    def _first_visit(self, scope: Scope) -> Response:
        """Move the token from the address into a cookie that scripts cannot read."""
        if not self._same(_token_in(scope) or ""):
            return PlainTextResponse("the token is not that of this server; it changes at every start", 403)
        response = RedirectResponse("/", 303)
        response.set_cookie(self.cookie, self.token, httponly=True, samesite="strict", path="/")
        return response

    def _same(self, token: str) -> bool:
        return secrets.compare_digest(token.encode(), self.token.encode())


def _token_in(scope: Scope) -> str | None:
    found = parse_qs(scope["query_string"].decode("latin-1")).get("token")
    return found[0] if found else None


def _cookie(headers: Headers, name: str) -> str:
    try:
        jar: SimpleCookie = SimpleCookie(headers.get("cookie", ""))
    except CookieError:
        return ""
    return jar[name].value if name in jar else ""


def _with_headers(send: Send) -> Send:
    async def sending(message: Message) -> None:
        if message["type"] == "http.response.start":
            given = message.get("headers", [])
            names = {k for k, _ in given}
            own = [(k.encode(), v.encode()) for k, v in HEADERS.items() if k.encode() not in names]
            message = {**message, "headers": [*given, *own]}
        await send(message)

    return sending
