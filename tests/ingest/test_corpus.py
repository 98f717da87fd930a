"""What a fuzzer once found in the readers, and what plants and attackers send: nothing but declared refusals, the good
part kept, and every row accounted for."""

from pathlib import Path

import pytest

from tests.fuzz.files import FILES
from tests.fuzz.judging import judge
from tests.fuzz.seeds import seeds

FOUND = sorted((Path(__file__).parents[1] / "corpus" / "readers").iterdir())


@pytest.mark.parametrize("path", FOUND, ids=lambda path: path.name)
def test_what_was_once_found_stays_mended(path: Path) -> None:
    judge(path.read_bytes())


@pytest.mark.parametrize("name", FILES)
def test_hostile_files(name: str) -> None:
    file = FILES[name]
    outcome = judge(file.make(), file.name)
    if outcome.refused is None:
        assert file.kept or file.refused == () or "cut at" in name
        assert outcome.rows_kept >= file.kept
    else:
        assert outcome.refused in file.refused


@pytest.mark.parametrize("name", seeds())
def test_good_files_of_every_layout_are_read(name: str) -> None:
    outcome = judge(seeds()[name], name)
    assert outcome.refused is None
    assert [loop.samples for loop in outcome.loops.values()] == [20]
