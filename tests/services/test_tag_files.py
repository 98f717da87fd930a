"""Loops whose signals come in files of their own, set points and modes only when they change."""

import numpy as np
import pytest

from app.engine.recording import Recording
from app.services.auditing import audits, chunks
from app.services.backend import Backend
from app.services.plant import loop_verdicts
from app.services.plant.trend import trend
from app.storage import loops as stored_loops
from app.storage import series
from tests.services.sent_uploads import of_one_tag, read, send


@pytest.mark.parametrize("last", ["MODE", "PV"])
@pytest.mark.parametrize("modes", [["0"] * 300, ["MAN"]], ids=["every_scan", "when_it_changes"])
def test_a_mode_in_a_file_of_its_own_counts_in_the_audit(
    backend: Backend, warm_kernels: None, modes: list[str], last: str
) -> None:
    steps = np.arange(300)
    signals = {
        "PV": (50 + 2 * np.sin(steps / 6 - 0.8)).astype(str),
        "OP": (40 + 5 * np.sin(steps / 6)).astype(str),
        "MODE": modes,
    }
    for name in sorted(signals, key=last.__eq__):
        shift_s = -7 if len(signals[name]) == 1 else 0
        sent = send(backend, of_one_tag(signals[name], shift_s), name=f"FIC204.{name}.csv")
        done = read(backend, sent)
        assert (done.loops, done.samples_added) == (["FIC204"], len(signals[name]))
    run = audits.start_audit(backend)
    chunks.audit_chunk(backend, int(run.id), "w")
    line = loop_verdicts.loop_health(backend, "FIC204")
    assert (line["verdict"], line["automatic_share"]) == ("not_auditable", 0.0)
    assert line["reasons"] == "not_in_automatic"


def stored_record(backend: Backend, tag: str, hours: float) -> Recording:
    with backend.database.read() as connection:
        row = stored_loops.by_tag(connection, tag)
        samples = series.windows(connection, [row.id], hours, 100_000)[row.id]
    return chunks.recording_of(row, samples)


@pytest.mark.parametrize("late_s", [0, 0.4])
@pytest.mark.parametrize("last", ["OP", "PV"])
def test_files_of_pv_and_op_at_other_times_are_audited_as_one_file_of_both_is(
    backend: Backend, last: str, late_s: float
) -> None:
    op = np.round(40 + 5 * np.sin(np.arange(900) / 60))
    stored = np.flatnonzero(np.append(True, np.diff(op) != 0))
    start = np.datetime64("2026-03-01T00:00:00", "ms")
    rows = {
        "PV": [f"FIC2.PV,{start + 1000 * k},{np.sin(k / 60):.3f}\n" for k in range(900)],
        "OP": [f"FIC2.OP,{start + 1000 * k + int(1000 * late_s)},{op[k]}\n" for k in stored],
    }
    names = "Tag,Time,Value\n"
    for signal in sorted(rows, key=last.__eq__):
        read(backend, send(backend, (names + "".join(rows[signal])).encode(), name=f"{signal}.csv"))
    apart = stored_record(backend, "FIC2", 24.0)
    whole = (names + "".join([*rows["PV"], *rows["OP"]])).replace("FIC2", "FIC3")
    read(backend, send(backend, whole.encode(), name="both.csv"))
    together = stored_record(backend, "FIC3", 24.0)
    np.testing.assert_array_equal(apart.time_s, together.time_s)
    np.testing.assert_array_equal(apart.pv, together.pv)
    np.testing.assert_array_equal(apart.op, together.op)
    assert np.isfinite(apart.op).mean() > 0.9


SECONDS = 900
HELD_OP = np.round(40 + 5 * np.sin(np.arange(SECONDS) / 60))
CHANGES = np.flatnonzero(np.append(True, np.diff(HELD_OP) != 0))
COLUMNS = "Tag,Time,Value,Quality\n"


def rows_of(tag: str, values: np.ndarray, seconds: range | np.ndarray, refused: frozenset[int] = frozenset()) -> str:
    start = np.datetime64("2026-03-01T00:00:00", "ms")
    return "".join(
        f"{tag},{start + 1000 * int(k)},{values[k]:.3f},{'Bad' if k in refused else 'Good'}\n" for k in seconds
    )


def send_text(backend: Backend, *texts: str) -> None:
    for text in texts:
        read(backend, send(backend, (COLUMNS + text).encode(), name=f"{text[:6]}.csv"))


def assert_same(first: Recording, second: Recording) -> None:
    np.testing.assert_array_equal(first.time_s, second.time_s)
    np.testing.assert_array_equal(first.pv, second.pv)
    np.testing.assert_array_equal(first.op, second.op)


@pytest.mark.parametrize("last", ["OP", "PV"])
@pytest.mark.parametrize("refused", ["PV", "OP"])
def test_refused_values_are_holes_in_files_of_their_own_too(backend: Backend, refused: str, last: str) -> None:
    pv = np.sin(np.arange(SECONDS) / 60)
    bad = {"PV": frozenset(range(200, 350)), "OP": frozenset(CHANGES[10:20].tolist())}
    texts = {
        "PV": rows_of("F1.PV", pv, range(SECONDS), bad["PV"] if refused == "PV" else frozenset()),
        "OP": rows_of("F1.OP", HELD_OP, CHANGES, bad["OP"] if refused == "OP" else frozenset()),
    }
    for signal in sorted(texts, key=last.__eq__):
        send_text(backend, texts[signal], texts[signal] + " ")
    send_text(backend, "".join(texts.values()).replace("F1.", "F2."))
    one_file = stored_record(backend, "F2", 24.0)
    assert_same(stored_record(backend, "F1", 24.0), one_file)
    assert len(one_file.time_s) == SECONDS
    assert np.isfinite(one_file.pv if refused == "PV" else one_file.op).mean() < 0.9


@pytest.mark.parametrize("joint_first", [False, True])
def test_what_came_apart_is_brought_together_beside_what_came_in_one_file(backend: Backend, joint_first: bool) -> None:
    pv = np.sin(np.arange(SECONDS) / 60)
    joint = range(60) if joint_first else range(SECONDS - 60, SECONDS)
    alone = range(60, SECONDS) if joint_first else range(SECONDS - 60)
    changes = np.array([alone[0], *(k for k in CHANGES if k in alone)])
    both = rows_of("F3.PV", pv, joint) + rows_of("F3.OP", HELD_OP, joint)
    apart = (rows_of("F3.PV", pv, alone), rows_of("F3.OP", HELD_OP, np.unique(changes)))
    send_text(backend, *((both, *apart) if joint_first else (*apart, both)))
    record = stored_record(backend, "F3", 24.0)
    assert len(record.time_s) == SECONDS
    assert np.isfinite(record.op).mean() > 0.95
    np.testing.assert_array_equal(record.op[joint], HELD_OP[joint])


@pytest.mark.parametrize("last", ["SP", "PV"])
def test_a_set_point_stored_when_it_changes_holds_over_uploads(backend: Backend, last: str) -> None:
    changes = f"{of_one_tag(['48'], -86_400 * 90).decode()}{of_one_tag(['50'], 30).decode()}".encode()
    files = {"SP": changes, "PV": of_one_tag(["1.5"] * 120), "OP": of_one_tag(["2.5"] * 120)}
    for name in sorted(files, key=last.__eq__):
        read(backend, send(backend, files[name], name=f"FIC7.{name}.csv"))
    record = stored_record(backend, "FIC7", 24.0)
    assert record.sp is not None
    assert record.sp.tolist() == [48.0] + [50.0] * 119
    assert stored_record(backend, "FIC7", 1.0).sp.tolist() == [50.0] * 61


def test_a_mode_that_changed_long_before_the_window_is_known(backend: Backend, warm_kernels: None) -> None:
    steps = np.arange(300)
    read(backend, send(backend, of_one_tag(["AUTO", "MAN"], -86_400 * 30), name="FIC8.MODE.csv"))
    read(backend, send(backend, of_one_tag((50 + np.sin(steps / 6)).astype(str)), name="FIC8.PV.csv"))
    read(backend, send(backend, of_one_tag((40 + np.cos(steps / 6)).astype(str)), name="FIC8.OP.csv"))
    run = audits.start_audit(backend)
    chunks.audit_chunk(backend, int(run.id), "w")
    line = loop_verdicts.loop_health(backend, "FIC8")
    assert (line["verdict"], line["reasons"], line["automatic_share"]) == ("not_auditable", "not_in_automatic", 0.0)


def test_a_trend_shows_the_set_point_that_holds(backend: Backend) -> None:
    read(backend, send(backend, of_one_tag(["48"], -86_400 * 30), name="FIC9.SP.csv"))
    read(backend, send(backend, of_one_tag(["1.5"] * 5), name="FIC9.PV.csv"))
    shown = trend(backend, "FIC9", points=100)
    assert shown.sp == [48.0] * 5
    assert shown.sp_held_since == "2026-01-30T00:00:00Z"
    assert shown.mode_held_since is None


def test_a_set_point_that_is_no_longer_exported_ceases_to_hold(backend: Backend, warm_kernels: None) -> None:
    steps = np.arange(300)
    for name, values in (("PV", 50 + np.sin(steps / 6)), ("OP", 40 + np.cos(steps / 6))):
        read(backend, send(backend, of_one_tag(values.astype(str)), name=f"FIC10.{name}.csv"))
    assert audited_with_set_point(backend, days_before=36) == ({}, None)
    since, error = audited_with_set_point(backend, days_before=34)
    assert since == {"sp": "2026-01-26T00:00:00Z"}
    assert error == pytest.approx(2.0, abs=0.2)


def audited_with_set_point(backend: Backend, days_before: int) -> tuple[dict[str, str], float | None]:
    read(backend, send(backend, of_one_tag(["52"], -86_400 * days_before), name="FIC10.SP.csv"))
    run = audits.start_audit(backend)
    chunks.audit_chunk(backend, int(run.id), "w")
    error = loop_verdicts.loop_health(backend, "FIC10")["error_mean"]
    return loop_verdicts.verdict_detail(backend, "FIC10")["held_since"], error


def test_a_loop_of_which_only_the_mode_was_sent_is_not_auditable(backend: Backend) -> None:
    read(backend, send(backend, of_one_tag(["AUTO"] * 60), name="FIC204.MODE.csv"))
    run = audits.start_audit(backend)
    chunks.audit_chunk(backend, int(run.id), "w")
    assert audits.get_audit(backend, run.id).failed == 0
    assert loop_verdicts.loop_health(backend, "FIC204")["verdict"] == "not_auditable"
