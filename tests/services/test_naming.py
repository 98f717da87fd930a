"""Names of loops within a sentence leave the sentence as it is."""

import pytest

from app.services.telling.naming import isolated, named, one_line


def test_letters_that_turn_the_direction_leave_the_rest_of_a_sentence_alone() -> None:
    assert named(["FIC1\u202eEVIL", "LIC7"]) == "\u2068FIC1\u202eEVIL\u2069, LIC7"
    assert one_line("A\n B") == "A B"


@pytest.mark.parametrize("name", ["\u2069\u202eA", "\u2067\u2067A", "A\u2069B\u2068C", "\u05d7\u05d5\u05dd"])
def test_no_name_ends_its_isolation_or_keeps_it_open(name: str) -> None:
    told, depth = one_line(name), 0
    assert name in told
    for at, letter in enumerate(told):
        depth += {"\u2067": 1, "\u2068": 1, "\u2069": -1}.get(letter, 0)
        assert (depth > 0) is (at + 1 < len(told))


def test_of_a_sentence_the_words_that_are_read_from_the_right_are_isolated() -> None:
    hot, water = "\u05d7\u05dd", "\u05de\u05d9\u05dd"
    assert isolated(f"in step with {hot} {water}-7 (0.9), whose valve") == (
        f"in step with \u2068{hot} {water}-7\u2069 (0.9), whose valve"
    )
    assert isolated(f"it is {hot}: 5") == f"it is \u2068{hot}\u2069: 5"
    assert isolated("PV in m\u00b3/h, FIC-101") == "PV in m\u00b3/h, FIC-101"
