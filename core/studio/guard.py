"""Who may talk to a page that is served on one's own machine: the page itself, and no other one in the same browser.

A browser lets any page open a socket to this machine, and names that page as the socket's origin. What is not of the
page's own origin is turned away, and where only this machine is served, so is a host of another name that was pointed
at it.
"""

from __future__ import annotations

from collections.abc import Callable, Generator
from contextlib import contextmanager
from http import HTTPStatus
from importlib import import_module
from inspect import isawaitable
from ipaddress import ip_address
from typing import Any
from urllib.parse import urlsplit


def is_loopback(host: str) -> bool:
    """Whether a name or address is this machine's, reached from nowhere else."""
    try:
        return ip_address(host.strip("[]")).is_loopback
    except ValueError:
        return host.lower().rstrip(".") == "localhost"


def may_talk(origin: str | None, host: str | None, *, loopback: bool) -> bool:
    """Whether a request is the page's own.

    Args:
        origin: Its header Origin; None: no browser sent it.
        host: Its header Host.
        loopback: Only this machine is served.
    """
    if host is None:
        return False
    if loopback and not is_loopback(urlsplit(f"//{host}").hostname or ""):
        return False
    return origin is None or urlsplit(origin).netloc.lower() == host.lower()


@contextmanager
def guarded(*, loopback: bool) -> Generator[None]:
    """What is served by websockets' asyncio server from within answers its own page only."""
    server: Any = import_module("websockets.asyncio.server")
    serve = server.serve

    def guarded_serve(*args: Any, process_request: Callable[..., Any] | None = None, **options: Any) -> Any:
        async def ask(connection: Any, request: Any) -> Any:
            headers = request.headers
            if not may_talk(headers.get("Origin"), headers.get("Host"), loopback=loopback):
                return connection.respond(HTTPStatus.FORBIDDEN, "only this page may talk to its server\n")
            answer: Any = process_request(connection, request) if process_request else None
            return await answer if isawaitable(answer) else answer

        return serve(*args, process_request=ask, **options)

    server.serve = guarded_serve
    try:
        yield
    finally:
        server.serve = serve
