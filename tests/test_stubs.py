"""Every native module carries a generated stub: complete, with names, dtypes and shapes."""

import ast
import importlib
import re
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[1]
MODULES = [
    f"tauguard.{folder}.{name}"
    for file in sorted(ROOT.glob("*/src/CMakeLists.txt"))
    for folder, name in re.findall(r"tauguard_module\((\w+) (\w+)", file.read_text())
]


def test_native_modules_are_found():
    assert "tauguard.cloth._mesh" in MODULES


@pytest.mark.parametrize("name", MODULES)
def test_stub_describes_the_compiled_module(name):
    module = importlib.import_module(name)
    tree = ast.parse((Path(module.__file__).parent / f"{name.split('.')[-1]}.pyi").read_text())
    assert ast.get_docstring(tree) == module.__doc__
    named = {node.name for node in tree.body if isinstance(node, ast.FunctionDef | ast.ClassDef)}
    named |= {node.target.id for node in tree.body if isinstance(node, ast.AnnAssign)}
    assert named == {n for n in vars(module) if not n.startswith("_")}
    for function in ast.walk(tree):
        if isinstance(function, ast.FunctionDef):
            arguments = function.args.posonlyargs + function.args.args
            unnamed = [a.arg for a in arguments if re.fullmatch(r"arg\d*", a.arg)]
            assert not unnamed, f"{function.name}: arguments without names"
    text = ast.unparse(tree)
    assert re.search(r"NDArray\[numpy\.float64\], dict\(shape=\(None, ", text)
    assert not re.search(r"\bndarray\b|NDArray(?!\[numpy\.\w+\])(?!\n)", text)


def test_a_checkout_has_the_stubs_where_type_checkers_look():
    for name in MODULES:
        _, folder, module = name.split(".")
        beside = Path(importlib.import_module(name).__file__).parent / f"{module}.pyi"
        assert (ROOT / folder / f"{module}.pyi").read_text() == beside.read_text()
