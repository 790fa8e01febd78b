"""Distributions of others, installed as their users install them."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
from collections.abc import Callable
from importlib.util import find_spec
from pathlib import Path

import pytest

EXAMPLES = Path(__file__).resolve().parents[2] / "examples"


@pytest.fixture(scope="session")
def installed(tmp_path_factory) -> Callable[[str], dict[str, str]]:
    """Name of an example -> an environment of processes in which it is installed."""

    def install(name: str) -> dict[str, str]:
        for tool in ("pip", "setuptools"):
            if find_spec(tool) is None:
                pytest.skip(f"{tool} is not installed, and without it nothing else can be")
        source = tmp_path_factory.mktemp("source") / name
        site = tmp_path_factory.mktemp("site")
        # building leaves its traces beside the sources
        shutil.copytree(EXAMPLES / name, source, ignore=shutil.ignore_patterns("__pycache__", "build", "*.egg-info"))
        options = ["--no-deps", "--no-index", "--no-build-isolation", "--quiet", "--disable-pip-version-check"]
        done = subprocess.run(
            [sys.executable, "-m", "pip", "install", *options, "--target", str(site), str(source)],
            capture_output=True,
            text=True,
            check=False,
        )
        assert done.returncode == 0, done.stderr
        return {**os.environ, "PYTHONPATH": str(site), "PYTEST_ADDOPTS": "", "SOURCE": str(source)}

    return install


@pytest.fixture(scope="session")
def run_pytest() -> Callable[..., subprocess.CompletedProcess[str]]:
    """Pytest in a process and folder of its own."""

    def run(folder: Path, *words: str, env: dict[str, str] | None = None) -> subprocess.CompletedProcess[str]:
        return subprocess.run(
            [sys.executable, "-m", "pytest", "-p", "no:cacheprovider", "-q", *words],
            cwd=folder,
            env=env or {**os.environ, "PYTEST_ADDOPTS": ""},
            capture_output=True,
            text=True,
            check=False,
        )

    return run
