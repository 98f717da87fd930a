"""The measurement of the size of stiction: loops that know their S, and a table that counts what was said of them."""

from app.lab.testbench.sizing import Sized, fitted, sized, table, verify


def test_loops_know_their_S_and_are_sized():
    loops = [*verify(3, 5), *fitted(2, 5)]
    assert len(loops) == 5
    assert all(loop.S > 0.0 for loop in loops)
    assert any(answer is not None for answer in map(sized, loops))


def test_the_same_seed_gives_the_same_loops():
    one, other = next(verify(1, 3)), next(verify(1, 3))
    assert (one.S, one.valve, one.record.op.tolist()) == (other.S, other.valve, other.record.op.tolist())


def test_the_table_counts_errors_and_coverage_by_valve():
    said = [
        Sized("he", True, 0.1, (False, True, True)),
        Sized("he", True, -0.3, (True, True, True)),
        Sized("kano", True, 0.0, (True, True, True)),
        Sized("kano", False, 2.0, (False, False, False)),
    ]
    rows = table(said, 10).splitlines()
    assert rows[0].startswith("| of 10 loops")
    assert rows[2] == "| identifiable | 3 | 10.0 % | 0.0 % | 26.0 % | 67 % | 100 % | 100 % |"
    assert [row.split(" | ")[0] for row in rows[3:]] == ["| he", "| kano", "| not identifiable"]
