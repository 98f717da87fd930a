"""Fields in quotes: what is left open, broken or stands behind them spoils its row alone."""

import numpy as np
import pytest

from app.ingest import IngestOptions

from .conftest import Read
from .test_bad_input import GOOD, HEADER


def test_a_quote_left_open_in_the_last_line_is_refused(read: Read) -> None:
    """Its comma once made a decimal of two fields: 6.6."""
    content = read(HEADER + GOOD + '2024-03-01 00:05:00,"6,60\n')
    assert content.loops["A"].pv.tolist() == [1, 2, 3, 4]
    assert [(reject.line, reject.code) for reject in content.rejects.listed] == [(6, "unbalanced_quote")]


def test_quoted_fields_beside_a_row_that_is_refused(read: Read) -> None:
    content = read(
        HEADER
        + GOOD
        + '2024-03-01 00:04:00,"5","5,5"\n2024-03-01 00:05:00,6,60,,\n2024-03-01 00:06:00,"7,70\n'
        + '2024-03-01 00:07:00,"no ""data""",80\n'
    )
    loop = content.loops["A"]
    np.testing.assert_array_equal(loop.pv, [1, 2, 3, 4, 5, 6, np.nan])
    assert loop.op.tolist() == [10, 20, 30, 40, 5.5, 60, 80]
    assert [(reject.line, reject.code) for reject in content.rejects.listed] == [
        (8, "unbalanced_quote"), (9, "not_a_number")
    ]  # fmt: skip


def test_a_comma_in_quotes_that_do_not_begin_the_field(read: Read) -> None:
    content = read(HEADER + GOOD + '2024-03-01 00:04:00,5 "5,5",50\n2024-03-01 00:05:00,6,60\n')
    assert content.loops["A"].pv.tolist() == [1, 2, 3, 4, 6]
    assert [(reject.line, reject.code) for reject in content.rejects.listed] == [(6, "ragged_row")]
    content = read(HEADER + GOOD + '2024-03-01 00:04:00,x","y\n2024-03-01 00:05:00,6,60\n')
    np.testing.assert_array_equal(content.loops["A"].pv, [1, 2, 3, 4, np.nan, 6])
    assert [(reject.line, reject.code) for reject in content.rejects.listed] == [(6, "not_a_number")] * 2


def test_a_quoted_field_longer_than_any(read: Read) -> None:
    content = read(HEADER + GOOD + '2024-03-01 00:04:00,"' + "x" * 140_000 + '",50\n')
    assert content.loops["A"].op.tolist() == [10, 20, 30, 40, 50]
    assert dict(content.rejects.counts) == {"not_a_number": 1}


@pytest.mark.parametrize("chunk_bytes", [1, 50, 1 << 20])
@pytest.mark.parametrize("end", ["\n", "\r\n"])
def test_names_broken_inside_their_quotes(read: Read, end: str, chunk_bytes: int) -> None:
    names = ["Plant 7, night shift", 'time,"A.PV\n[m3/h]","A.OP\n[%]","B.PV', '\n",B.OP']
    rows = [f"2024-03-01 00:00:0{i},{i},1{i},2{i},3{i}" for i in range(6)] + ['2024-03-01 00:00:06,"6,16,26,36']
    text = end.join([*"\n".join(names).split("\n"), *rows, ""])
    content = read(text, options=IngestOptions(chunk_bytes=chunk_bytes))
    assert content.loops["A"].pv.tolist() == [0, 1, 2, 3, 4, 5]
    assert content.loops["B"].op.tolist() == [30, 31, 32, 33, 34, 35]
    assert [(reject.line, reject.code) for reject in content.rejects.listed] == [(13, "unbalanced_quote")]


def test_rows_with_open_quotes_are_no_names(read: Read) -> None:
    first = '2024-03-01 00:00:00,"1,10\n2024-03-01 00:00:30,"1,10\n'
    assert dict(read(HEADER + first + GOOD).rejects.counts) == {"unbalanced_quote": 2}


@pytest.mark.parametrize("field", ['""ü', '"Ventil"é', '"soon"x', '""€'])
def test_text_behind_a_quote_spoils_its_row_alone(read: Read, field: str) -> None:
    rows = "2024-03-01 00:00:00,1,2\n2024-03-01 00:01:00,3,4\n"
    content = read(f"Time,A.PV,A.OP\n{rows}{field},5,6\n2024-03-01 00:02:00,7,8\n")
    assert content.loops["A"].pv.tolist() == [1, 3, 7]
    assert dict(content.rejects.counts) == {"bad_time": 1}
    assert content.rejects.listed[0].text.startswith(repr(field.replace('"', "")))


def test_half_a_letter_behind_a_quote_spoils_no_long_table(read: Read) -> None:
    content = read('Tagname,TimeStamp,Value,DataQuality\nA.PV,2024-03-01 00:00:00,1,Good\n""€')
    assert content.loops["A"].pv.tolist() == [1]
    assert content.rejects.total == 1


def test_numbers_behind_a_quote_keep_their_digits(read: Read) -> None:
    content = read('Time,A.PV,A.OP\n2024-03-01 00:00:00,"1"5,2\n2024-03-01 00:01:00,"3","4"\n')
    assert content.loops["A"].pv.tolist() == [15, 3]
