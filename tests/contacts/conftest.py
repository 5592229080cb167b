"""Checkers that a test registers are gone after it."""

import importlib

import pytest

#: The package has a function of the module's name.
MODULE = importlib.import_module("tauguard.contacts.checker")


@pytest.fixture(autouse=True)
def registry(monkeypatch):
    """A copy of the registered checkers."""
    monkeypatch.setattr(MODULE, "_FACTORIES", dict(MODULE._FACTORIES))
