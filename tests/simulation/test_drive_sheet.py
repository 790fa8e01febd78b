"""The drives as plain data."""

from __future__ import annotations

from dataclasses import asdict

import mbexport
from mbexport.core.simulation.drive_sheet import DriveSheet


def test_plain_data_is_that_of_the_dataclasses() -> None:
    sheets = [DriveSheet.of(mbexport.build(mbexport.load(name))) for name in ("imece2013", "puma560")]
    drives = [drive for sheet in sheets for drive in sheet.drives]
    assert any(drive.spring for drive in drives)
    assert any(drive.terms for drive in drives)
    for sheet in sheets:
        for joint, drive in zip(sheet.to_data()["joints"], sheet.drives, strict=True):
            expected = {name: value for name, value in asdict(drive).items() if name != "torque_limit"}
            assert {name: joint[name] for name in expected} == expected
        assert DriveSheet.from_json(sheet.to_json()) == sheet
