"""What is installed with tauguard has a licence that lets it be used and passed on."""

import os
import re
import subprocess
import sys
from importlib.metadata import PackageNotFoundError, distribution

import pytest

#: Licences of what is needed: none asks more than a notice, weak copyleft in libraries included.
ALLOWED = re.compile(
    r"apache|bsd|boost|qhull|\bmit\b|expat|python software|psf|isc\b|0bsd|zlib|unlicense|hpnd"
    r"|public domain|mozilla|mpl|cc0|lgpl",
    re.IGNORECASE,
)
REFUSED = re.compile(r"\bA?GPL", re.IGNORECASE)
#: Their metadata name no licence; read in their own files.
STATED = {
    "cmeel-boost": "Boost Software License",
    "cmeel-qhull": "Qhull's own, of the kind of MIT's",
}


def required(name, seen):
    """The installed distributions that ``name`` needs, extras left out."""
    try:
        found = distribution(name)
    except PackageNotFoundError:
        return seen
    key = found.metadata["Name"].lower().replace("_", "-")
    if key in seen:
        return seen
    seen[key] = found
    for line in found.requires or []:
        if "extra ==" not in line:
            required(re.match(r"[\w.-]+", line)[0], seen)
    return seen


def licence(found):
    """What the metadata say, in whichever field."""
    data = found.metadata
    fields = [data.get("License-Expression"), (data.get("License") or "")[:200]]
    fields += [c for c in data.get_all("Classifier") or [] if c.startswith("License ::")]
    return " | ".join(field for field in fields if field)


PACKAGES = required("tauguard", {})


def test_the_list_is_not_empty():
    assert {"mujoco", "numpy", "pin", "scikit-learn", "mcap"} <= set(PACKAGES)


@pytest.mark.parametrize("name", sorted(PACKAGES))
def test_the_licence_is_known_and_allowed(name):
    said = STATED.get(name) or licence(PACKAGES[name])
    assert ALLOWED.search(said), f"{name}: {said or 'no licence in its metadata'}"
    assert not REFUSED.search(said), f"{name}: {said}"


def test_analytics_of_rerun_are_off_unless_they_are_asked_for():
    for given, wanted in ((None, "0"), ("1", "1")):
        env = {k: v for k, v in os.environ.items() if k != "RERUN_ANALYTICS"}
        env |= {} if given is None else {"RERUN_ANALYTICS": given}
        code = "import os, tauguard.replay; print(os.environ['RERUN_ANALYTICS'])"
        run = subprocess.run([sys.executable, "-c", code], env=env, capture_output=True, text=True)
        assert run.stdout.strip() == wanted
