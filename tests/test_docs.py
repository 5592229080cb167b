"""Every Python block of the README and of the pages runs as it stands, in the order of its page."""

import os
import re
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[1]
NOTES = ROOT / "docs" / "notes"  # dated results: their commands are those of their day
PAGES = [
    ROOT / "README.md",
    *(page for page in sorted((ROOT / "docs").rglob("*.md")) if page.parent != NOTES),
]
# Shown and judged by tests/contacts/test_page.py.
ELSEWHERE = {"contacts"}


def name(page):
    return str(page.relative_to(ROOT).with_suffix(""))


def blocks(page):
    return re.findall(r"^```python\n(.*?)^```", page.read_text(), re.DOTALL | re.MULTILINE)


@pytest.mark.parametrize("page", [p for p in PAGES if p.stem not in ELSEWHERE], ids=name)
def test_the_blocks_run(page, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    shared = {"__name__": "page"}
    for block in blocks(page):
        exec(compile(block, page.name, "exec"), shared)


@pytest.mark.parametrize("page", [*PAGES, ROOT / "CONTRIBUTING.md"], ids=name)
def test_links_lead_somewhere(page):
    prose = re.sub(r"```.*?```", "", page.read_text(), flags=re.DOTALL)
    for link in re.findall(r"\]\(([^)#:]+)\)", prose):
        if not (page.parent / link).is_relative_to(ROOT / "docs" / "gallery"):  # made by the build
            assert (page.parent / link).exists(), f"{page.name}: {link}"


@pytest.fixture(scope="module")
def studies():
    """Every name that `tauguard bench` takes: studies, their parts' full names and own names."""
    command = [sys.executable, "-m", "tauguard", "bench", "list"]
    listed = subprocess.run(command, capture_output=True, text=True, check=True).stdout
    found = {"NAME", "list", "all", "--quick"}
    for line in listed.splitlines():
        if not line.startswith(" "):
            study = line.partition(":")[0]
            found.add(study)
        elif line:
            words = line.split()
            alias = words[1].strip("()") if words[1].startswith("(") else words[0]
            found |= {f"{study}-{words[0]}", alias}
    return found


@pytest.mark.parametrize("page", PAGES, ids=name)
def test_commands_exist(page, studies):
    """What follows `tauguard` in shell blocks is a command, and its flags are its own."""
    from tauguard.cli import COMMANDS

    shell = "\n".join(re.findall(r"```sh\n(.*?)```", page.read_text(), re.DOTALL))
    inline = re.findall(r"`(tauguard\s[^`]+)`", page.read_text())
    told = "\n".join([shell, *(" ".join(text.split()) for text in inline)])
    for command, rest in re.findall(r"tauguard ([a-z][a-z-]*)([^\n]*)", told):
        if command == "bench":
            assert rest.split()[0] in studies, rest
        assert command in COMMANDS, command
        of_studies = command in ("bench", "report")
        folder = "studies/framework" if of_studies else "src/tauguard/cli"
        source = (ROOT / folder / f"{command.replace('-', '_')}.py").read_text()
        for flag in re.findall(r"--([a-z-]+)", rest):
            assert re.search(rf"\b{flag.replace('-', '_')}:", source), f"{command} --{flag}"


@pytest.mark.parametrize("page", PAGES, ids=name)
def test_environments_are_named_so_that_gymnasium_finds_them(page):
    from tauguard.environments import ENVIRONMENTS

    for name in re.findall(r"""make(?:_vec)?\(\s*["'](\S*?-v\d)["']""", page.read_text()):
        if name.startswith("mine/"):  # the page registers it
            continue
        assert name.removeprefix("tauguard:") in ENVIRONMENTS, name
        assert name.startswith("tauguard:"), f"{name}: found only where tauguard was imported"


def test_no_page_is_lost():
    """Every page can be reached from the README."""
    told = (ROOT / "README.md").read_text()
    docs = ROOT / "docs"
    site = {  # of the site alone
        docs / "index.md",
        docs / "reference" / "index.md",
        docs / "howto" / "index.md",
    }
    pages = [page for page in PAGES[1:] if page not in site]
    lost = []
    for page in pages:
        index = page.parent / "index.md"
        listed = page != index and f"({page.name})" in index.read_text()
        if os.path.relpath(page, ROOT) not in told and not listed:
            lost.append(page.name)
    assert not lost


def test_the_manual_stays_short_enough_to_be_read():
    """No page over 1,900 words, the manual under 24,500, lines of prose within 120 characters."""
    words = {page: len(page.read_text().split()) for page in PAGES[1:]}
    assert max(words.values()) <= 1_900, max(words, key=words.get)
    assert sum(words.values()) <= 24_500
    for page in PAGES:
        for number, line in enumerate(page.read_text().splitlines(), 1):
            assert len(line) <= 120 or line.startswith("|") or "](" in line, f"{page}:{number}"
