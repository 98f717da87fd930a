"""What is dear to find out of a column is found out once, though each layout asks for it, by names of its own."""

from pathlib import Path

import pytest

from app.ingest import read_export
from app.ingest.columns import clocks
from app.ingest.times import stamps

DAY = [f"{hour:02d}:{minute:02d}" for hour in range(24) for minute in range(60)]


def export(folder: Path, stamp: str) -> Path:
    path = folder / "FIC77.csv"
    rows = (f"{stamp.format(at=at)},50.{k},40.{k}" for k, at in enumerate(DAY))
    path.write_text("\n".join(("Zeit,FIC77.PV,FIC77.OP", *rows, "")))
    return path


@pytest.mark.parametrize("stamp", ["2026-03-07 {at}:30", "07.03.2026 {at}", "3/7/2026 {at}:30", "7-Mar-26 {at}:30"])
def test_no_column_is_parsed_twice_for_its_form(monkeypatch: pytest.MonkeyPatch, tmp_path: Path, stamp: str) -> None:
    path, parsed, parse = export(tmp_path, stamp), [], stamps._text_form

    def noted(sample: list[str], *others: object) -> object:
        parsed.append(tuple(sample))
        return parse(sample, *others)

    monkeypatch.setattr(stamps, "_text_form", noted)
    (loop,) = read_export(path).loops()
    assert loop.samples == len(DAY)
    assert 0 < len(parsed) == len(set(parsed))


@pytest.mark.parametrize("stamp", ["2026-03-07 {at}:30", "3/7/2026 {at}:30 AM"])
def test_dates_are_not_respelled_to_see_that_they_are_no_clocks(monkeypatch: pytest.MonkeyPatch, stamp: str) -> None:
    monkeypatch.setattr(clocks, "respelled", lambda _: pytest.fail("respelled"))
    assert not clocks.are_clocks([stamp.format(at=at) for at in DAY])


@pytest.mark.parametrize("clock", ["{at}:30", "{at}:30 p. m.", '"{at}"', "1899-12-30 {at}:00", "{at}:30 UTC+1"])
def test_clocks_are_clocks_however_they_are_spelled(clock: str) -> None:
    assert clocks.are_clocks([clock.format(at=at) for at in DAY])


def test_which_digits_a_stamp_has_tells_no_shape() -> None:
    for text in ("2026-03-07 10:11:12.5", "7-Mar-26 1:02 pm", "20260307T101112", "07.03.26"):
        shaped = stamps._candidates([text], zoned=False, american=False)
        assert shaped
        for digit in "3579":
            other = "".join(digit if character.isdigit() else character for character in text)
            assert stamps._candidates([other], zoned=False, american=False) == shaped
