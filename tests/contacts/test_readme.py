"""What the README says about contact checkers runs as it stands."""

import re
from pathlib import Path

import pytest

TEXT = (Path(__file__).resolve().parents[2] / "README.md").read_text()
SECTION = TEXT.split("## Contact checkers\n")[1].split("\n## ")[0]
BLOCKS = re.findall(r"```python\n(.*?)```", SECTION, re.DOTALL)


@pytest.mark.parametrize("block", BLOCKS, ids=["compare", "own_checker"])
def test_the_blocks_run(block, capsys):
    exec(compile(block, "README.md", "exec"), {"__name__": "readme"})
    out = capsys.readouterr().out
    if "BoundingSpheres" in block:
        assert "spheres false" in out
        lines = {line.split()[0]: line.split() for line in out.splitlines() if line.strip()}
        assert lines["rigid"][1:3] == ["1", "1"]
        assert float(lines["spheres"][1]) < 0.5
    else:
        assert "mujoco missed: body ball and flex cloth_sheet" in out
        assert out.splitlines()[-1].startswith("1.0 [")
