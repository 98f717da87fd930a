"""Every code of an error, of a refused row and of a failed loop has a sentence in one table, and no other has."""

import ast
import re

import pytest

from app.services.telling import error_words
from tests.api.code_scan import every, name_of, parts, scanned

TABLES = {name: words for name, words in vars(error_words).items() if name.endswith("_WORDS")}
SENTENCES = [(code, sentence) for words in TABLES.values() for code, sentence in words.items()]
STATUS_OF_ITSELF = {
    "CODE_BY_STATUS.get(error.status_code, f'http_{error.status_code}')",  # whose values are looked up
    "f'http_{error.status}'",
}
KNOWN = STATUS_OF_ITSELF | {
    "1008",  # of a web socket
    "bindparam('why')",  # of a statement, with the code of a failure
    "effect['effect']",  # of an effect
    "failures",  # whole ones
    "found.refused.items()",  # of the odd numbers
    "rows.faults",  # of the lines that are cleaned
    "str(told.get('code', NO_PROBLEM))",  # what the service said
}
"""What stands in the place of a code, and is looked at elsewhere or is none."""


def test_there_are_six_tables():
    assert set(TABLES) == {f"{name}_WORDS" for name in ("REFUSED", "FILE", "REJECT", "COMPARED", "LOOP", "COMMAND")}


def test_every_code_of_the_source_is_told_and_no_other():
    told = {code for code, _ in SENTENCES}
    assert scanned().codes - told == set()
    assert told - scanned().codes == set()


def test_each_code_is_in_one_table_once():
    parts_of_tables = [words for name, words in vars(error_words).items() if isinstance(words, dict) and name[0] == "_"]
    codes = [code for code, _ in SENTENCES]
    assert len(codes) == len(set(codes))
    written = [code for words in (*parts_of_tables, *TABLES.values()) for code in words]
    split = {code for words in parts_of_tables for code in words}
    assert len(written) == len(codes) + len(split)


def test_every_sentence_says_more_than_its_code():
    assert not [code for code, sentence in SENTENCES if not says_more(code, sentence)]


def says_more(code: str, sentence: str) -> bool:
    """Whether it is one of at least six words that are not those of the code, with a capital and a full stop."""
    words = set(re.findall("[a-z]+", sentence.lower())) - set(code.split("_"))
    begins = sentence == sentence.strip() and (sentence[0].isupper() or sentence[0] == "`")
    return begins and re.search(r"[^.]\.$", sentence) is not None and len(words) >= 6


@pytest.mark.parametrize(
    "code",
    [
        "too_many_requests",  # of a refusal before the route
        "too_slow",  # of a status
        "cross_site",
        "key_needed",  # handed to a function
        "unknown_layout",  # of an error with a code of its own
        "bad_mapping",  # in a constant with other things
        "no_loops",  # in a constant
        "off_line",  # in a variable
        "unclear_mark",  # as a key
        "unbalanced_quote",  # returned
        "sheet_not_read",
        "sentinel",  # of a log of refused rows
        "reader_lost",  # written by a statement
        "worker_lost",
        "cancelled",
        "memory",
        "no_problem_details",
        "broker_login",  # of a log, as a field
        "broker_refused",
        "same_file",  # in brackets
        "damaged",
    ],
)
def test_the_source_is_looked_through_in_all_the_ways_in_which_codes_are_given(code):
    assert code in scanned().codes


def test_whatever_else_stands_in_the_place_of_a_code_is_known():
    assert scanned().forwarded == KNOWN


def test_every_status_that_is_raised_has_a_code():
    statuses = {
        part.value
        for _, call in every(ast.Call)
        if name_of(call.func) == "HTTPException"
        for part in call.args[:1]
        if isinstance(part, ast.Constant)
    }
    tables = [
        (module, node.value)
        for module, node in every(ast.Assign)
        if [name_of(target) for target in node.targets] == ["CODE_BY_STATUS"]
    ]
    (module, table) = tables[0]
    assert {400, 408, 413} <= statuses
    assert statuses <= {key.value for key in table.keys}
    assert all(isinstance(code, str) for value in table.values for code in parts(value, module))
