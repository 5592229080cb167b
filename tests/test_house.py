"""Imports point one way, and light packages load no heavy library."""

import ast
import importlib
import re
import subprocess
import sys
from pathlib import Path

import pytest

import tauguard

ROOT = Path(__file__).resolve().parents[1]

PRODUCT = {
    "geometry",
    "traces",
    "models",
    "cloth",
    "rigid",
    "detectors",
    "contacts",
    "envs",
    "datasets",
    "replay",
    "live",
    "twin",
    "benchmark",
    "speed",
}
ALLOWED = {
    "geometry": set(),
    "traces": set(),
    "models": set(),
    "cloth": {"geometry"},
    "rigid": {"geometry"},
    "detectors": {"traces", "models", "report"},
    "contacts": {"cloth", "rigid", "models", "traces"},
    "envs": {"models", "contacts", "detectors", "traces"},
    "datasets": {"envs", "contacts", "traces", "models", "detectors"},
    "replay": {"traces", "models", "detectors", "report"},
    "live": {"detectors", "traces"},
    "twin": {"detectors", "models", "traces", "report"},
    "benchmark": {"datasets", "detectors", "models", "traces", "report"},
    "speed": {"envs", "detectors", "models", "traces"},
    "report": set(),
    "hard_cases": PRODUCT,
    "cli": PRODUCT | {"report", "hard_cases"},
}
#: The packages inside envs, and what each may use of the others; plant.py is common to them.
ENVS = {"episodes": set(), "gym": {"episodes"}, "adapters": {"gym", "episodes"}}
#: Modules at the top that every package may use: they use each other and no package.
SHARED = {"arrays", "lazy", "untrusted_input", "atomic_write", "extras", "findings", "results"}
#: The entry points: what they start is in the packages.
ENTRY = {"__init__", "__main__", "environments"}
FOLDERS = {
    package: ROOT / ("src/tauguard/cli" if package == "cli" else package) for package in ALLOWED
}


def packages_imported(path: Path) -> set[str]:
    found = set()
    for node in ast.walk(ast.parse(path.read_text())):
        names = []
        if isinstance(node, ast.Import):
            names = [alias.name for alias in node.names]
        elif isinstance(node, ast.ImportFrom) and node.module:
            names = [node.module] + [f"{node.module}.{alias.name}" for alias in node.names]
        for name in names:
            parts = name.split(".")
            if parts[0] == "tauguard" and len(parts) > 1:
                found.add(parts[1])
    return found


@pytest.mark.parametrize("package", sorted(ALLOWED))
def test_imports_point_one_way(package):
    for path in FOLDERS[package].rglob("*.py"):
        backward = (packages_imported(path) & ALLOWED.keys()) - ALLOWED[package] - {package}
        assert not backward, f"{path.relative_to(ROOT)} imports {sorted(backward)}"


@pytest.mark.parametrize("part", sorted(ENVS))
def test_imports_inside_envs_point_one_way(part):
    for path in (ROOT / "envs" / part).rglob("*.py"):
        named = set(re.findall(r"tauguard\.envs\.(\w+)", path.read_text()))
        backward = (named & ENVS.keys()) - ENVS[part] - {part}
        assert not backward, f"{path.relative_to(ROOT)} names {sorted(backward)}"


def test_shared_modules_use_no_package_and_nothing_else_stands_beside_them():
    top = ROOT / "src" / "tauguard"
    assert {path.stem for path in top.glob("*.py")} == SHARED | ENTRY
    for name in SHARED:
        assert packages_imported(top / f"{name}.py") <= SHARED, name
    for package in ALLOWED:
        for path in FOLDERS[package].rglob("*.py"):
            beside = packages_imported(path) - ALLOWED.keys() - SHARED
            beside -= ENTRY | {"__version__", *tauguard.__all__} if package == "cli" else set()
            assert not beside, f"{path.relative_to(ROOT)} imports {sorted(beside)}"


#: Public modules that are no packages; the docstring of ``tauguard.envs`` names those of envs.
MODULES = {"tauguard.environments", "tauguard.envs.policies", "tauguard.envs.wrappers"}


@pytest.mark.parametrize("path", sorted(FOLDERS["cli"].glob("*.py")), ids=lambda path: path.stem)
def test_commands_import_public_names_only(path):
    for node in ast.walk(ast.parse(path.read_text())):
        module = getattr(node, "module", None) or ""
        if not isinstance(node, ast.ImportFrom) or module.split(".")[0] != "tauguard":
            continue
        if module in MODULES or module.removeprefix("tauguard.").split(".")[0] in SHARED | {"cli"}:
            continue
        public = {*importlib.import_module(module).__all__, "__version__"}
        private = {alias.name for alias in node.names} - public
        assert not private, f"{path.name}: {sorted(private)} of {module}"


def test_the_product_does_not_know_the_studies():
    for path in (path for folder in FOLDERS.values() for path in folder.rglob("*.py")):
        assert not re.search(r"^\s*(from|import) (studies|oracles)\b", path.read_text(), re.M), path


@pytest.mark.parametrize("package", sorted(ALLOWED))
def test_includes_point_one_way(package):
    # Kernels of every package may include the headers of geometry, contacts on those of rigid too;
    # their own are found beside them.
    others = {"geometry", "rigid"} if package in ("rigid", "contacts") else {"geometry"}
    for path in [*(ROOT / package).rglob("*.cpp"), *(ROOT / package).rglob("*.hpp")]:
        for name in re.findall(r'#include "([^"]+)"', path.read_text()):
            shared = re.fullmatch(rf"tauguard/({'|'.join(others)})/\w+\.hpp", name)
            beside = (path.parent / name).resolve()
            assert shared or (beside.is_file() and beside.is_relative_to(ROOT / package)), (
                f"{path.relative_to(ROOT)} includes {name}"
            )


#: The layers of detectors, from samples to answers. A layer imports those before it, never later
#: ones, not even inside a function. `calibration` (which arm model) and `faults` (which samples can
#: be believed) need the estimator and come before everything that is learned from residuals.
LAYERS = (
    "dynamics",
    "estimation",
    "calibration",
    "faults",
    "features",
    "scores",
    "thresholds",
    "alarms",
    "diagnosis",
    "evaluation",
)
#: Modules of detectors below all layers, and above them.
BELOW, ABOVE = (
    {"codec", "events", "frozen", "model_archive", "one_thread", "samples"},
    {
        "__init__",
        "arm_calibration",
        "detection",
        "detector",
        "evaluating",
        "model_file",
        "registry",
        "training",
    },
)
NATIVE = {"_kernel", "_observer", "_network"}


def detector_imports(path: Path) -> set[str]:
    """Modules of detectors that a file imports anywhere in it, by their path below detectors."""
    found = set()
    for node in ast.walk(ast.parse(path.read_text())):
        if isinstance(node, ast.ImportFrom) and (node.module or "").startswith(
            "tauguard.detectors"
        ):
            inner = node.module.split(".")[2:]
            found |= {"/".join([*inner, a.name] if len(inner) < 2 else inner) for a in node.names}
    here = {str(p.relative_to(ROOT / "detectors"))[:-3] for p in detector_files()}
    return {name if name in here else name.split("/")[0] for name in found}


def detector_files() -> list[Path]:
    return sorted((ROOT / "detectors").rglob("*.py"))


def test_the_layers_of_detectors_import_only_those_before_them():
    assert {p.name for p in (ROOT / "detectors").iterdir() if (p / "__init__.py").exists()} == set(
        LAYERS
    )
    assert {p.stem for p in (ROOT / "detectors").glob("*.py")} == BELOW | ABOVE
    for path in detector_files():
        own = path.relative_to(ROOT / "detectors")
        imported = {name.split("/")[0] for name in detector_imports(path)} - NATIVE
        if len(own.parts) > 1:
            allowed = BELOW | set(LAYERS[: LAYERS.index(own.parts[0]) + 1])
        else:
            allowed = BELOW | (set(LAYERS) | ABOVE if own.stem in ABOVE else set())
        assert imported <= allowed, f"{own} imports {sorted(imported - allowed)}"


def test_no_files_of_detectors_import_each_other():
    waiting = {
        str(p.relative_to(ROOT / "detectors"))[:-3]: detector_imports(p) for p in detector_files()
    }
    while waiting:
        ready = {name for name, needs in waiting.items() if not needs & waiting.keys()}
        assert ready, f"these import each other: {sorted(waiting)}"
        waiting = {name: needs for name, needs in waiting.items() if name not in ready}


#: Modules below packages from which examples import names that are not public.
NOT_PUBLIC = {
    "cloth", "cloth.scenes", "contacts.scenes", "detectors.calibration.nominal", "envs.policies",
    "envs.stable_baselines", "envs.tasks", "envs.wrappers", "models.impact", "replay.video",
}  # fmt: skip


def test_examples_import_public_names_but_for_a_list():
    needed = set()
    for path in (ROOT / "examples").rglob("*.py"):
        for node in ast.walk(ast.parse(path.read_text())):
            module = getattr(node, "module", None) or ""
            if not isinstance(node, ast.ImportFrom) or not module.startswith("tauguard"):
                continue
            names, below = {alias.name for alias in node.names}, module.count(".") > 1
            if below or not names <= set(importlib.import_module(module).__all__):
                needed.add(module.removeprefix("tauguard."))
    assert needed - {"cli.watch"} <= NOT_PUBLIC, sorted(needed - NOT_PUBLIC)


def loaded_by(code: str, libraries: tuple[str, ...]) -> list[str]:
    """Those of ``libraries`` that a fresh interpreter has loaded after ``code``."""
    code += f"\nimport sys; print(*(m for m in {libraries!r} if m in sys.modules))"
    out = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    return out.stdout.splitlines()[-1].split()


def test_light_packages_leave_heavy_libraries_unloaded():
    code = "from tauguard import cloth, geometry, replay, report, rigid, traces"
    assert not loaded_by(code, ("mujoco", "pinocchio", "sklearn", "rerun", "mcap", "scipy.spatial"))


#: What takes longer to import than all that an environment needs.
HEAVY = ("sklearn", "pandas", "scipy", "matplotlib", "rerun", "pyarrow", "trimesh", "mcap")


@pytest.mark.parametrize("detector", ["observer", None])
def test_an_environment_leaves_heavy_libraries_unloaded(detector):
    code = (
        "import gymnasium\n"
        f"env = gymnasium.make('tauguard:tauguard/Reach-v0', detector={detector!r})\n"
        "env.reset(seed=1); env.step(env.action_space.sample())"
    )
    assert loaded_by(code, ("tauguard.envs.gym.reach", *HEAVY)) == ["tauguard.envs.gym.reach"]


def test_the_list_of_commands_leaves_heavy_libraries_unloaded():
    code = "from tauguard.cli import main; main(['--help'])"
    assert not loaded_by(code, (*HEAVY, "mujoco", "pinocchio", "tyro"))


def test_models_are_looked_for_without_the_learning_libraries():
    code = (
        "from tauguard.detectors import load_model\n"
        "from tauguard.detectors import poisson_rate\n"
        "from tauguard.detectors.registry import make_detector\n"
        "make_detector('free-motion'); poisson_rate(1, 1.0)\n"
        "try: load_model('none.tauguard')\n"
        "except ValueError: pass"
    )
    assert not loaded_by(code, ("sklearn", "pandas", "scipy.stats"))


def test_nothing_generic_is_importable_by_itself(tmp_path):
    code = "import datasets"
    out = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, cwd=tmp_path)
    assert "ModuleNotFoundError" in out.stderr
