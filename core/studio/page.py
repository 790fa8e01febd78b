"""The page: a viser server that shows one session."""

from __future__ import annotations

import contextlib
import io
import threading
import time
from importlib import import_module
from pathlib import Path
from typing import Any

from ..errors import UsageError
from .bench import Bench
from .guard import guarded, is_loopback
from .panel import Panel
from .paths import Drive
from .scene import Scene
from .session import Session, View

# pictures a second while the motion plays
PICTURES = 20.0


def server_module() -> Any:
    """The library that serves pages.

    Raises:
        UsageError: It is not installed.
    """
    try:
        return import_module("viser")
    except ImportError as error:
        raise UsageError("studio needs viser: pip install 'mbexport[studio]'.") from error


class Page:
    """A running page, until it is closed."""

    def __init__(
        self,
        bench: Bench,
        *,
        output: Path,
        host: str = "127.0.0.1",
        port: int = 8080,
        backend: str = "mjcf",
        motion: str | None = None,
        drive: Drive = "motion",
    ) -> None:
        """Serve a bench.

        Args:
            bench: The robot.
            output: Folder that saves and exports go into.
            host: Address to serve at.
            port: Port to serve at, or the next one that is free.
            backend: Name of the engine that runs the robot.
            motion: Name of the motion; None: the Greca, or what the robot can do instead.
            drive: How the robot is driven.

        Raises:
            MbexportError: The library is not there, the robot cannot be built, or cannot do the motion.
        """
        viser = server_module()
        self._drawing = threading.Lock()
        self._ready = threading.Event()
        self._ended = threading.Event()
        self._plays = threading.Event()
        self.session = Session(bench, backend=backend, motion=motion, drive=drive, output=output, show=self._show)
        # the library greets on standard output
        with guarded(loopback=is_loopback(host)), contextlib.redirect_stdout(io.StringIO()):
            self._server: Any = viser.ViserServer(
                host=host, port=port, label=f"{bench.original.name} · mbexport", verbose=False
            )
        # nobody shall make the page public by a button of the library's
        self._server.request_share_url = lambda verbose=True: None
        self.host, self.port = host, int(self._server.get_port())
        robot = self.session.view.robot
        self._scene = Scene(self._server, robot, bench.original.folder)
        self._panel = Panel(self._server, self.session, self._redraw, self._play)
        self._ready.set()
        self._redraw()
        self._player = threading.Thread(target=self._keep_playing, daemon=True)
        self._player.start()
        self.session.run()

    @property
    def address(self) -> str:
        """Where a browser finds it."""
        name = f"[{self.host}]" if ":" in self.host else self.host
        return f"http://{name}:{self.port}"

    def wait(self) -> None:
        """Until the page is closed, or the user stops the program."""
        while not self._ended.wait(0.5):
            pass

    def close(self) -> None:
        """End it."""
        self._ended.set()
        self._plays.set()
        self.session.close()
        with contextlib.redirect_stdout(io.StringIO()):
            self._server.stop()

    def _show(self, view: View) -> None:
        if not self._ready.is_set() or self._ended.is_set():
            return
        with self._drawing, self._server.atomic():
            factor = self._scene.show(view, self._panel.shown)
            self._panel.show(view, factor)

    def _redraw(self) -> None:
        self._show(self.session.view)

    def _play(self, on: bool) -> None:
        (self._plays.set if on else self._plays.clear)()

    def _keep_playing(self) -> None:
        while self._plays.wait() and not self._ended.is_set():
            begin = time.monotonic()
            shown = self.session.view.time or 0.0
            following = shown + 1.0 / PICTURES
            self.session.place_at(following if following <= self.session.duration else 0.0)
            self._ended.wait(max(0.0, begin + 1.0 / PICTURES - time.monotonic()))
