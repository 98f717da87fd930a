"""Ctrl-C ends a command though compiled code, or a generator that is let go of, swallowed it."""

import io
import signal
import sys
from pathlib import Path

import pytest

from app.cli import audit, interrupts, main
from app.ingest import IngestOptions


class SwallowsOne:
    """As a generator that is let go of: what is raised while it ends is told to nobody who could catch it."""

    def __del__(self) -> None:
        signal.raise_signal(signal.SIGINT)


@pytest.fixture
def unraisable(monkeypatch) -> list[str]:
    told: list[str] = []
    monkeypatch.setattr(sys, "unraisablehook", lambda what: told.append(what.exc_type.__name__))
    return told


@pytest.fixture(autouse=True)
def as_in_a_terminal():
    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    yield
    signal.signal(signal.SIGINT, before)


def compiled_code(*_) -> audit.AuditedFile:
    try:
        signal.raise_signal(signal.SIGINT)
    except KeyboardInterrupt as interrupt:
        raise SystemError("returned a result with an exception set") from interrupt
    raise AssertionError("no interrupt came")


def test_an_interrupt_that_nobody_swallows_is_raised_as_ever():
    with pytest.raises(KeyboardInterrupt), interrupts.remembered():
        signal.raise_signal(signal.SIGINT)
    assert signal.getsignal(signal.SIGINT) is signal.SIG_DFL
    with interrupts.remembered():
        pass
    assert not interrupts.came()


def test_a_swallowed_one_is_raised_when_asked_for_and_not_printed(unraisable):
    with interrupts.remembered():
        interrupts.raise_swallowed()
        SwallowsOne()
        assert interrupts.came()
        with pytest.raises(KeyboardInterrupt):
            interrupts.raise_swallowed()
    assert unraisable == []


def test_what_else_cannot_be_raised_is_told(unraisable):
    class Fails:
        def __del__(self) -> None:
            raise ValueError

    with interrupts.remembered():
        Fails()
    assert unraisable == ["ValueError"]


def test_an_earlier_command_s_interrupt_is_forgotten(unraisable):
    with interrupts.remembered():
        SwallowsOne()
    with interrupts.remembered():
        interrupts.raise_swallowed()
    assert unraisable == []


def test_what_is_to_be_done_whole_is_and_the_interrupt_comes_behind_it():
    done = []

    def one_after_the_other() -> None:
        with interrupts.done_whole():
            signal.raise_signal(signal.SIGINT)
            done.append("whole")
        done.append("behind")

    with pytest.raises(KeyboardInterrupt), interrupts.remembered():
        one_after_the_other()
    assert done == ["whole"]


def test_a_key_that_is_pressed_twice_in_haste_is_one_interrupt():
    def pressed_twice() -> None:
        try:
            signal.raise_signal(signal.SIGINT)
        finally:
            signal.raise_signal(signal.SIGINT)

    with pytest.raises(KeyboardInterrupt) as ended, interrupts.remembered():
        pressed_twice()
    assert ended.value.__context__ is None
    assert signal.getsignal(signal.SIGINT) is signal.SIG_DFL


def test_one_that_comes_later_ends_what_the_first_did_not(monkeypatch):
    now = iter((10.0, 10.7, 11.4))
    monkeypatch.setattr(interrupts.time, "monotonic", lambda: next(now))
    with interrupts.remembered():
        with pytest.raises(KeyboardInterrupt):
            signal.raise_signal(signal.SIGINT)
        signal.raise_signal(signal.SIGINT)
        with pytest.raises(KeyboardInterrupt):
            signal.raise_signal(signal.SIGINT)


def test_sigterm_ends_in_order_what_asks_for_it_and_nothing_else():
    with pytest.raises(SystemExit) as ended, interrupts.ended_in_order():
        signal.raise_signal(signal.SIGTERM)
    assert ended.value.code == 128 + signal.SIGTERM
    assert signal.getsignal(signal.SIGTERM) is signal.SIG_DFL


def test_sigterm_that_somebody_handles_is_left_to_them():
    told = []
    before = signal.signal(signal.SIGTERM, lambda *_: told.append("theirs"))
    try:
        with interrupts.ended_in_order():
            signal.raise_signal(signal.SIGTERM)
    finally:
        signal.signal(signal.SIGTERM, before)
    assert told == ["theirs"]


def test_an_interrupt_behind_it_is_raised_at_once():
    with interrupts.remembered():
        with interrupts.done_whole():
            pass
        with pytest.raises(KeyboardInterrupt):
            signal.raise_signal(signal.SIGINT)


def test_a_file_that_counts_as_audited_is_written(capsys):
    results = (audit.AuditedFile(Path(f"{name}.csv"), ({"recording": name},), ("a note",)) for name in "AB")

    class Interrupted(io.StringIO):
        def write(self, text: str) -> int:
            if not self.getvalue():
                signal.raise_signal(signal.SIGINT)
            return super().write(text)

    audited, stream = [], Interrupted()
    with pytest.raises(KeyboardInterrupt), interrupts.remembered():
        audit._audit_into(stream, audited, results, 2, audit.Format.jsonl)
    assert stream.getvalue().splitlines() == ['{"recording": "A"}']
    assert (len(audited), capsys.readouterr().err.count("a note")) == (1, 1)


def test_where_interrupts_are_ignored_they_stay_so():
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    with interrupts.remembered():
        signal.raise_signal(signal.SIGINT)
    assert not interrupts.came()


def test_an_audit_ends_behind_the_file_in_which_one_was_swallowed(monkeypatch):
    def audited(path: Path, _how: audit.Reading) -> audit.AuditedFile:
        return compiled_code() if path.name == "B.csv" else audit.AuditedFile(path)

    monkeypatch.setattr(audit, "audit_file", audited)
    found = audit.audit_files([Path(f"{name}.csv") for name in "ABC"], 1, audit.Reading(IngestOptions()))
    with interrupts.remembered():
        assert next(found).path.name == "A.csv"
        with pytest.raises(KeyboardInterrupt):
            next(found)


def test_a_command_that_ends_by_one_in_compiled_code_was_interrupted(monkeypatch):
    monkeypatch.setattr(main, "cli", compiled_code)
    with pytest.raises(SystemExit) as ended:
        main.main()
    assert ended.value.code == 130


def test_a_fault_of_compiled_code_is_no_interrupt(monkeypatch):
    def fault() -> None:
        raise SystemError("error return without exception set")

    monkeypatch.setattr(main, "cli", fault)
    with pytest.raises(SystemError):
        main.main()
