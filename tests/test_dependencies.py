"""What the code imports is declared, and two rooms need NumPy alone."""

import ast
import re
import subprocess
import sys
import tomllib
from importlib.metadata import packages_distributions
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[1]
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]
#: Modules that a distribution installs without saying so in its metadata.
UNNAMED = {"pinocchio": "pin", "coal": "pin"}
#: Refuses every module but the standard library, NumPy and this package.
BLOCK = """
import sys
class Block:
    def find_spec(self, name, path=None, target=None):
        top = name.partition(".")[0]
        if top not in {*sys.stdlib_module_names, "numpy", "tauguard"} and top[:1] != "_":
            raise ModuleNotFoundError(f"No module named {top!r}")
sys.meta_path.insert(0, Block())
"""


def imported(path):
    """Top-level names of every module that a file imports, within functions too."""
    for node in ast.walk(ast.parse(path.read_text())):
        if isinstance(node, ast.Import):
            yield from (alias.name.partition(".")[0] for alias in node.names)
        elif isinstance(node, ast.ImportFrom) and node.module and not node.level:
            yield node.module.partition(".")[0]


def declared():
    extras = PROJECT["optional-dependencies"].values()
    lines = [*PROJECT["dependencies"], *(line for extra in extras for line in extra)]
    return {re.match(r"[\w.-]+", line)[0].lower().replace("_", "-") for line in lines}


def test_every_import_is_declared():
    distributions = packages_distributions()
    allowed = declared()
    for room in (ROOT / "src/tauguard").iterdir():
        for path in room.rglob("*.py") if room.is_dir() else [room]:
            if path.suffix != ".py":
                continue
            for name in set(imported(path)) - sys.stdlib_module_names - {"tauguard"}:
                found = [UNNAMED[name]] if name in UNNAMED else distributions.get(name, [name])
                names = {one.lower().replace("_", "-") for one in found}
                assert names & allowed, f"{path.relative_to(ROOT)} imports {name}: {sorted(names)}"


@pytest.mark.parametrize("room", ["cloth", "rigid"])
def test_the_page_of_a_light_room_runs_with_numpy_alone(room, tmp_path):
    page = (ROOT / "docs" / "howto" / f"{room}.md").read_text()
    assert "pip install --no-deps ." in page
    blocks = re.findall(r"^```python\n(.*?)^```", page, re.DOTALL | re.MULTILINE)
    command = [sys.executable, "-c", BLOCK + blocks[0]]
    done = subprocess.run(command, capture_output=True, text=True, cwd=tmp_path)
    assert done.returncode == 0, done.stderr


def test_every_room_is_linked_where_tools_look_for_it():
    """Type checkers, editors and the build find ``tauguard.<room>`` below ``src``."""
    rooms = {path.parent.name for path in ROOT.glob("*/__init__.py")} - {"studies"}
    links = {path.name for path in (ROOT / "src/tauguard").iterdir() if path.is_symlink()}
    assert links == rooms
    for name in links:
        assert (ROOT / "src/tauguard" / name).resolve() == ROOT / name
