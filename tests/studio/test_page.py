"""The page itself: served, guarded, and seen in a browser where one is there."""

import base64
import io
import shutil
import socket
import sys

import numpy as np
import pytest
from click.testing import CliRunner

import mbexport
from mbexport.core.cli.studio import command
from mbexport.core.errors import UsageError
from mbexport.core.studio import Bench
from mbexport.core.studio.page import Page, server_module
from mbexport.core.study.values import Place


@pytest.fixture
def page(tmp_path):
    pytest.importorskip("viser", reason="the page needs viser: pip install 'mbexport[studio]'")
    made = Page(
        Bench.of(mbexport.load("planar2r")), output=tmp_path / "out", port=0, backend="urdf", motion="excitation"
    )
    yield made
    made.close()


def answer_to(page, origin, host=None):
    """Status line of a request for a socket."""
    host = host or f"127.0.0.1:{page.port}"
    request = (
        f"GET / HTTP/1.1\r\nHost: {host}\r\nUpgrade: websocket\r\nConnection: Upgrade\r\n"
        f"Sec-WebSocket-Key: {base64.b64encode(bytes(16)).decode()}\r\nSec-WebSocket-Version: 13\r\n"
        f"Sec-WebSocket-Protocol: viser-v{server_module().__version__}\r\nOrigin: {origin}\r\n\r\n"
    )
    with socket.create_connection(("127.0.0.1", page.port), timeout=10.0) as stream:
        stream.sendall(request.encode())
        return stream.recv(200).split(b"\r\n")[0].decode()


def test_strangers_pages_are_turned_away(page):
    assert " 101 " in answer_to(page, f"http://127.0.0.1:{page.port}")
    assert " 403 " in answer_to(page, "http://evil.example")
    assert " 403 " in answer_to(page, "http://evil.example", "evil.example")
    assert page._server.get_host() == "127.0.0.1"
    assert page._server.request_share_url() is None


def test_a_base_that_tilts_is_seen_to(page):
    upright = page.session.settle().robot.base.quaternion()
    assert page._scene._base.wxyz == pytest.approx(upright)
    page.session.switch("base_tilt", True)
    page.session.change(Place("base_tilt", "roll", "robot", 0), 0.2)
    tilted = page.session.settle().robot.base
    assert np.degrees(2.0 * np.arccos(min(1.0, abs(np.dot(tilted.quaternion(), upright))))) == pytest.approx(
        np.degrees(0.2)
    )
    assert page._scene._base.wxyz == pytest.approx(tilted.quaternion())
    assert page._scene._base.position == pytest.approx(tilted.xyz)


def test_without_the_library_it_says_what_to_install(monkeypatch):
    monkeypatch.setitem(sys.modules, "viser", None)
    with pytest.raises(UsageError, match=r"pip install 'mbexport\[studio\]'"):
        server_module()


def test_an_engine_that_does_not_run_is_wrong_use():
    pytest.importorskip("viser")
    result = CliRunner().invoke(command, ["planar2r", "--backend", "adams", "--no-open"])
    assert isinstance(result.exception, UsageError)
    assert "emitted only" in str(result.exception)


@pytest.fixture(scope="module")
def browser():
    playwright = pytest.importorskip("playwright.sync_api", reason="looking at the page needs playwright")
    program = next((p for p in map(shutil.which, ("chromium", "chromium-browser", "google-chrome")) if p), None)
    if program is None:
        # a browser is no Python package; what the page's server does is tested without
        pytest.skip("Chromium is not installed: the page is looked at in it (apt-get install chromium)")
    flags = ["--no-sandbox", "--use-angle=swiftshader", "--enable-unsafe-swiftshader", "--ignore-gpu-blocklist"]
    with playwright.sync_playwright() as driver:
        launched = driver.chromium.launch(executable_path=program, args=flags)
        yield launched
        launched.close()


def picture(tab):
    """A screenshot, without waiting for frames that software draws slowly; shape (h, w, 3)."""
    from matplotlib.image import imread

    session = tab.context.new_cdp_session(tab)
    data = session.send("Page.captureScreenshot", {"format": "png"})["data"]
    return imread(io.BytesIO(base64.b64decode(data)))[:, :, :3]


@pytest.mark.slow
def test_a_person_changes_a_robot_in_a_browser(page, browser, tmp_path):
    page.session.settle()
    tab = browser.new_page(viewport={"width": 760, "height": 520})
    faults = []
    tab.on("pageerror", lambda error: faults.append(str(error)))
    tab.goto(page.address)
    tab.wait_for_selector("#readout", timeout=60_000)
    before = tab.inner_text("#error")
    assert "mm" in before
    tab.wait_for_timeout(1500)
    seen = picture(tab)
    scene = seen[:, : seen.shape[1] // 3]
    orange = (scene[..., 0] > 0.55) & (scene[..., 2] < 0.45 * scene[..., 0])
    assert orange.mean() > 0.002, "the robot is not to be seen"
    tab.get_by_role("tab", name="Effects").click()
    tab.get_by_label("joint compliance", exact=True).uncheck()
    tab.wait_for_function("before => document.querySelector('#error').innerText !== before", arg=before)
    assert "joint_compliance" not in page.session.bench.effects
    tab.get_by_role("tab", name="Files").click()
    tab.get_by_role("button", name="Save the changed database").click()
    tab.wait_for_function("() => document.body.innerText.includes('Written:')")
    saved = mbexport.load(str(tmp_path / "out" / "database-1"))
    assert "joint_compliance" not in saved.levels["studio"]
    assert faults == []
    tab.close()
