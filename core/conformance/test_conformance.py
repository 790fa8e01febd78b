"""What pytest collects; the checks stand in `checks`, fixtures and options in `hooks`."""

from typing import Any


def test_conformance(conformance_check: Any, conformance_subject: Any, conformance_result: Any) -> None:
    """One check on the backend."""
    conformance_result(conformance_check.run(conformance_subject))
