"""What the README says about guarded steps runs as it stands."""

import re
from pathlib import Path

TEXT = (Path(__file__).resolve().parents[2] / "README.md").read_text()


def test_the_block_runs(capsys):
    section = TEXT.split("## Steps that cannot tunnel\n")[1].split("\n## ")[0]
    (block,) = re.findall(r"```python\n(.*?)```", section, re.DOTALL)
    exec(compile(block, "README.md", "exec"), {"__name__": "readme"})
    lines = capsys.readouterr().out.splitlines()
    assert len(lines) >= 2
    assert lines[-1] == "True"
    assert "('flex', 0), ('geom', 0)" in lines[0]
