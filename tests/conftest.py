"""Shared fixtures."""

import os
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[1]


@pytest.fixture(scope="session")
def data_dir() -> Path:
    """The folder of real data; a test that asks for it carries ``@pytest.mark.data``."""
    folder = Path(os.environ.get("TAUGUARD_DATA", ROOT / "data"))
    if not folder.is_dir():
        pytest.skip(f"no real data at {folder.name}: set TAUGUARD_DATA")
    return folder
