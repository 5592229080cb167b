"""What the page on contact checkers shows is what it says."""

import re
from pathlib import Path

import pytest

TEXT = (Path(__file__).resolve().parents[2] / "docs" / "howto" / "contacts.md").read_text()
BLOCKS = re.findall(r"```python\n(.*?)```", TEXT, re.DOTALL)


@pytest.mark.parametrize("block", BLOCKS, ids=["compare", "guard"])
def test_the_blocks_run(block, capsys):
    exec(compile(block, "contacts.md", "exec"), {"__name__": "page"})
    out = capsys.readouterr().out
    if "GuardedStepper" in block:
        lines = out.splitlines()
        assert len(lines) >= 2
        assert lines[-1] == "True"
        assert "flex 'cloth_sheet'" in lines[0]
        assert "geom 'ball'" in lines[0]
    else:
        assert "mujoco missed: body ball and flex cloth_sheet" in out
        assert out.splitlines()[-1].startswith("1.0 [")
