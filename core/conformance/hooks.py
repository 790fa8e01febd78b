"""The suite under pytest: a test a check, declared limits as strict expected failures, refusals listed at the end."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from importlib.metadata import entry_points
from typing import Any

import pytest

from ..errors import MbexportError
from ..simulation.backend import Backend
from ..simulation.backends import backend_named
from .check import Check
from .checks import checks
from .subject import DURATION, Subject

AUTHORS = "mbexport.conformance"
"""Group of entry points: a backend's name to the module with its author's fixtures."""

REFUSED = "mbexport refused"


def pytest_addoption(parser: pytest.Parser) -> None:
    """--backend and --duration."""
    group = parser.getgroup("mbexport conformance")
    group.addoption("--backend", metavar="NAME", help="The backend to try, by the name of its entry point.")
    group.addoption(
        "--duration", type=float, default=DURATION, metavar="S", help=f"Of every run [s]; {DURATION!r} where not given."
    )


def pytest_configure(config: pytest.Config) -> None:
    """Make the marker known, and the fixtures that the backend's author ships."""
    config.addinivalue_line("markers", "quick: the part of the conformance suite that a test suite has the time for")
    name = config.getoption("--backend")
    points = [point for point in entry_points(group=AUTHORS) if point.name == name]
    if points:
        config.pluginmanager.import_plugin(points[0].value)


def pytest_generate_tests(metafunc: pytest.Metafunc) -> None:
    """One test a check."""
    if "conformance_check" in metafunc.fixturenames:
        metafunc.parametrize(
            "conformance_check",
            [pytest.param(check, id=name, marks=[pytest.mark.quick] * check.quick) for name, check in checks().items()],
        )


def _of_author(request: pytest.FixtureRequest, name: str) -> Any:
    """What a fixture of the author gives; None where there is none."""
    try:
        return request.getfixturevalue(name)
    except pytest.FixtureLookupError as error:
        if error.argname != name:
            raise
        return None


@pytest.fixture(scope="session")
def conformance_subject(request: pytest.FixtureRequest) -> Subject:
    """The backend: the author's fixture `backend_under_test`, else the one named by --backend."""
    named = request.config.getoption("--backend")
    backend = _of_author(request, "backend_under_test")
    if backend is None:
        if named is None:
            pytest.exit("name a backend by --backend NAME, or give a fixture `backend_under_test`.", returncode=4)
        try:
            backend = backend_named(named)
        except MbexportError as error:
            pytest.exit(str(error), returncode=4)
    if not isinstance(backend, Backend):
        pytest.exit(f"the fixture `backend_under_test` gives {backend!r}, which is no mbexport.Backend.", returncode=4)
    if named is not None and backend.name != named:
        pytest.exit(f"--backend is {named!r}, the fixture `backend_under_test` gives {backend.name!r}.", returncode=4)
    duration: Any = request.config.getoption("--duration")
    return Subject(backend, float(duration))


@pytest.fixture(scope="session")
def conformance_limits(request: pytest.FixtureRequest) -> Mapping[str, str]:
    """The author's fixture `declared_limits`: ids of checks (or all cases of a name) to reasons."""
    limits: Mapping[str, str] = _of_author(request, "declared_limits") or {}
    known = {*checks(), *(check.name for check in checks().values())}
    for name, reason in limits.items():
        if name not in known:
            pytest.exit(f"declared_limits names {name!r}, and there is no such check.", returncode=4)
        if not reason.strip():
            pytest.exit(f"declared_limits gives no reason for {name!r}.", returncode=4)
    return limits


@pytest.fixture(autouse=True)
def conformance_limit(request: pytest.FixtureRequest) -> Iterator[None]:
    """A check under a declared limit must fail: a limit that is none any more is an error."""
    if "conformance_check" in request.fixturenames:
        check: Check = request.getfixturevalue("conformance_check")
        limits: Mapping[str, str] = request.getfixturevalue("conformance_limits")
        reason = limits.get(check.id, limits.get(check.name))
        if reason is not None:
            request.applymarker(pytest.mark.xfail(reason=f"declared: {reason}", strict=True))
    yield


@pytest.fixture
def conformance_result(request: pytest.FixtureRequest) -> Any:
    """Where a check puts what the backend refused by name."""

    def keep(refusals: Any) -> None:
        for reason in dict.fromkeys(refusals):
            request.node.user_properties.append((REFUSED, reason))

    return keep


def pytest_terminal_summary(terminalreporter: Any) -> None:
    """List what was refused by name: allowed, and worth knowing."""
    refused: dict[str, list[str]] = {}
    for report in terminalreporter.getreports("passed"):
        for name, reason in report.user_properties:
            if name == REFUSED:
                refused.setdefault(reason, []).append(report.nodeid.rpartition("[")[2].rstrip("]"))
    if refused:
        terminalreporter.section("refused by name")
        for reason, ids in sorted(refused.items()):
            terminalreporter.write_line(f"{', '.join(ids)}: {reason}")
