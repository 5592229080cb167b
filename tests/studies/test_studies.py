"""What holds for every study: it is found, and says how its tables are read."""

import importlib
import textwrap
from pathlib import Path

import pytest

from studies import STUDIES
from tauguard.report import WIDTH


def module(name):
    return importlib.import_module(f"studies.{STUDIES[name].module}")


@pytest.mark.parametrize("name", STUDIES)
def test_notes_are_of_tables_that_there_are(name):
    study = module(name)
    parts = "".join(path.read_text() for path in Path(study.__file__).parent.glob("*.py"))
    for title in getattr(study, "NOTES", {}):
        assert parts.count(f'"{title}"') >= 2, title


@pytest.mark.parametrize("name", STUDIES)
def test_every_study_says_how_its_tables_are_read(name):
    study = module(name)
    notes = getattr(study, "NOTES", {})
    assert notes
    for note in notes.values():
        assert note.endswith(".")
        assert "  " not in note
        assert len(textwrap.wrap(note, WIDTH)) <= 5
