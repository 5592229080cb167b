"""Names use the words of the glossary, and none that a reader would have to guess."""

import ast
import functools
import re
from pathlib import Path

import tauguard.detectors as detectors

ROOT = Path(__file__).resolve().parents[1]
#: Words of our own that had no definition; the field has others.
PRIVATE = {"zoo", "wary", "doubt", "promise", "promised", "levelled", "levelling", "told"}
#: Words that stood for several things; the table of CONTRIBUTING.md has one for each.
SEVERAL = {"watch", "watched", "watcher", "watching"}
ROOMS = ("studies", "cloth", "contacts", "datasets", "detectors", "envs", "rigid", "traces")
#: Where the one recording stands.
RECORDING = "traces/logs.py"


def glossary() -> set[str]:
    text = (ROOT / "CONTRIBUTING.md").read_text().partition("## Glossary")[2]
    rows = [line.rsplit("|", 2)[1] for line in text.splitlines() if line.startswith("| ")]
    return {name for row in rows for name in re.findall(r"`(\w+)`", row)}


def test_what_the_map_names_is_there():
    text = (ROOT / "CONTRIBUTING.md").read_text().partition("## Where to change what")[2]
    lines = text.partition("\n\nOne ")[0].splitlines()
    rows = [
        line.split("|") for line in lines if line.startswith("| ") and " file | name |" not in line
    ]
    assert len(rows) > 20
    for _, _, files, names, _ in rows:
        paths = [ROOT / file for file in re.findall(r"`([^`]+)`", files)]
        text = "".join(path.read_text() for path in paths if path.is_file())
        assert text or "NAME" in files, files
        for name in re.findall(r"`(\w+)`", names):
            assert re.search(rf"\b{name}\b", text) or "NAME" in files, name


def test_every_public_name_of_detection_has_its_term():
    assert glossary() == set(detectors.__all__)


def test_every_public_name_is_there():
    for name in detectors.__all__:
        assert getattr(detectors, name) is not None


@functools.cache
def public_names(path: Path) -> set[str]:
    """Modules, classes, functions, arguments and fields that a user can see."""
    names = {path.stem}
    for node in ast.walk(ast.parse(path.read_text())):
        if isinstance(node, ast.ClassDef | ast.FunctionDef) and not node.name.startswith("_"):
            names.add(node.name)
            if isinstance(node, ast.FunctionDef):
                names |= {arg.arg for arg in node.args.args + node.args.kwonlyargs}
        if isinstance(node, ast.AnnAssign) and isinstance(node.target, ast.Name):
            names.add(node.target.id)
    return names


def test_no_public_name_is_a_riddle():
    for path in (path for room in ROOMS for path in (ROOT / room).rglob("*.py")):
        for name in public_names(path):
            words = re.findall(r"[A-Z]?[a-z]+", name)
            private = {word.lower() for word in words} & PRIVATE
            assert not private, f"{path.relative_to(ROOT)}: {name}"


def test_one_word_stands_for_one_thing():
    for path in (path for room in ROOMS for path in (ROOT / room).rglob("*.py")):
        where = str(path.relative_to(ROOT))
        for name in public_names(path):
            words = {word.lower() for word in re.findall(r"[A-Z]?[a-z]+", name)}
            assert not words & SEVERAL, f"{where}: {name}"
        made = {
            n.name for n in ast.walk(ast.parse(path.read_text())) if isinstance(n, ast.ClassDef)
        }
        assert "Recording" not in made or where == RECORDING, where
