"""Names of loops within a sentence leave the sentence as it is."""

from app.services.telling.naming import named, one_line


def test_letters_that_turn_the_direction_leave_the_rest_of_a_sentence_alone() -> None:
    assert named(["FIC1\u202eEVIL", "LIC7"]) == "\u2068FIC1\u202eEVIL\u2069, LIC7"
    assert one_line("A\n B") == "A B"
