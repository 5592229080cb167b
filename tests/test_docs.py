"""Every Python block of the README and of the pages runs as it stands, in the order of its page."""

import os
import re
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[1]
PAGES = [ROOT / "README.md", *sorted((ROOT / "docs").rglob("*.md"))]
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
        assert (page.parent / link).exists(), f"{page.name}: {link}"


@pytest.mark.parametrize("page", PAGES, ids=name)
def test_commands_exist(page):
    """What follows `tauguard` in shell blocks is a command, and its flags are its own."""
    from studies import STUDIES
    from tauguard.cli import COMMANDS
    from tauguard.cli.checkout import STUDY_COMMANDS

    shell = "\n".join(re.findall(r"```sh\n(.*?)```", page.read_text(), re.DOTALL))
    told = shell + "\n".join(re.findall(r"`(tauguard [^`]+)`", page.read_text()))
    for command, rest in re.findall(r"tauguard ([a-z][a-z-]*)([^\n]*)", told):
        if command == "bench":
            assert rest.split()[0] in {"NAME", "list", "all", "--quick", *STUDIES}, rest
            continue
        assert command in COMMANDS, command
        folder = ROOT / ("studies" if command in STUDY_COMMANDS else "src/tauguard/cli")
        source = (folder / f"{command.replace('-', '_')}.py").read_text()
        for flag in re.findall(r"--([a-z-]+)", rest):
            assert re.search(rf"\b{flag.replace('-', '_')}:", source), f"{command} --{flag}"


@pytest.mark.parametrize("page", PAGES, ids=name)
def test_environments_are_named_so_that_gymnasium_finds_them(page):
    from tauguard.environments import ENVIRONMENTS

    for name in re.findall(r"""make(?:_vec)?\(\s*["'](\S*?-v\d)["']""", page.read_text()):
        assert name.removeprefix("tauguard:") in ENVIRONMENTS, name
        assert name.startswith("tauguard:"), f"{name}: found only where tauguard was imported"


def test_no_page_is_lost():
    """Every page can be reached from the README."""
    told = (ROOT / "README.md").read_text()
    docs = ROOT / "docs"
    site = {docs / "index.md", docs / "reference" / "index.md"}  # of the site alone
    pages = [page for page in PAGES[1:] if page not in site]
    lost = []
    for page in pages:
        index = page.parent / "index.md"
        listed = (
            page != index and page.parent.name != "docs" and f"({page.name})" in index.read_text()
        )
        if os.path.relpath(page, ROOT) not in told and not listed:
            lost.append(page.name)
    assert not lost
