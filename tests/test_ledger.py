"""Every test that the pages name as the keeper of a claim is there."""

import ast
import re
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
LEDGER = [ROOT / "docs" / "reference" / name for name in ("trust.md", "faults.md")]
TEXT = "".join(page.read_text() for page in LEDGER)


def test_tests_that_the_ledger_names_exist():
    named = re.findall(r"`(tests/[\w/]+\.py)::(\w+)`", TEXT)
    assert len(named) >= 10
    for path, name in set(named):
        tree = ast.parse((ROOT / path).read_text())
        there = {node.name for node in ast.walk(tree) if isinstance(node, ast.FunctionDef)}
        assert name in there, f"{path}::{name}"


def test_test_files_that_the_ledger_names_exist():
    for path in set(re.findall(r"`(tests/[\w/]+\.py)`", TEXT)):
        assert (ROOT / path).exists(), path
