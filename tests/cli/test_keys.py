"""`loopaudit keys` and `trail`: keys that are made, listed and revoked, and who did it."""

import json

import pytest

from app.services import mounts
from app.services.moments import PlantClock
from tests.cli.calling import as_program


def test_keys_are_made_shown_once_listed_and_revoked(monkeypatch, capsys, tmp_path):
    monkeypatch.setenv("LOOPAUDIT_DATA_DIR", str(tmp_path))
    code, out, err = as_program(monkeypatch, capsys, "keys", "create", "the historian", "--role", "upload")
    assert code == 0
    key = out.strip()
    assert key.startswith("la_upload_")
    assert key not in err
    _, listed, _ = as_program(monkeypatch, capsys, "keys", "list", "--json")
    shown = json.loads(listed)
    assert (shown["name"], shown["role"], shown["state"]) == ("the historian", "upload", "active")
    assert key[-49:] not in listed
    _, rotated, _ = as_program(monkeypatch, capsys, "keys", "rotate", shown["id"], "--overlap", "1")
    assert rotated.strip().startswith("la_upload_")
    assert as_program(monkeypatch, capsys, "keys", "revoke", shown["id"])[0] == 0
    _, table, _ = as_program(monkeypatch, capsys, "keys", "list")
    assert "revoked" in table
    _, trail, _ = as_program(monkeypatch, capsys, "trail", "--json")
    actions = [json.loads(line)["action"] for line in trail.splitlines()]
    assert actions == ["key.revoke", "key.rotate", "key.create", "key.create"]
    assert as_program(monkeypatch, capsys, "keys", "revoke", "nonsense")[0] == 2


def test_a_key_of_a_data_base_that_was_not_there_says_that_it_is_new(monkeypatch, capsys, tmp_path):
    """Made without the settings of the service it is good for nothing there."""
    monkeypatch.setenv("LOOPAUDIT_DATA_DIR", str(tmp_path))
    told = f"there is no database in {tmp_path} yet: a new one is made there (LOOPAUDIT_DATA_DIR)"
    _, _, first = as_program(monkeypatch, capsys, "keys", "create", "me")
    _, _, second = as_program(monkeypatch, capsys, "keys", "create", "me too")
    assert (told in first, told in second) == (True, False)


def test_a_data_base_that_is_not_made_is_not_said_to_be(monkeypatch, capsys, tmp_path):
    """One that is not the embedded one waits for `loopaudit migrate`, wherever the data folder is."""
    monkeypatch.setenv("LOOPAUDIT_DATA_DIR", str(tmp_path))
    monkeypatch.setenv("LOOPAUDIT_DATABASE_URL", f"sqlite:///{tmp_path}/plant.db")
    code, _, err = as_program(monkeypatch, capsys, "keys", "create", "me")
    assert (code, "a new one is made" in err, "[no_tables]" in err) == (2, False, True)


def test_no_data_base_is_begun_below_a_mount_that_is_away(monkeypatch, capsys, tmp_path):
    """It would be gone from sight with the return of the mount, and the plant's own one is there."""
    place, other = tmp_path / "srv", tmp_path / "usr"
    fstab, mounted = tmp_path / "fstab", tmp_path / "mounts"
    fstab.write_text(f"/dev/sdb1 {place} ext4 defaults 0 2\n")
    monkeypatch.setattr(mounts, "FSTAB", fstab)
    monkeypatch.setattr(mounts, "MOUNTED", mounted)
    for folder, refused in ((place / "loopaudit", True), (other, False)):
        monkeypatch.setenv("LOOPAUDIT_DATA_DIR", str(folder))
        code, _, err = as_program(monkeypatch, capsys, "keys", "create", "me")
        assert (code == 2, "[not_mounted]" in err, folder.exists()) == (refused, refused, not refused)
    mounted.write_text(fstab.read_text())
    monkeypatch.setenv("LOOPAUDIT_DATA_DIR", str(place / "loopaudit"))
    assert as_program(monkeypatch, capsys, "keys", "create", "me")[0] == 0


def test_keys_and_trail_are_told_by_the_clock_of_the_plant(monkeypatch, capsys, tmp_path):
    monkeypatch.setenv("LOOPAUDIT_DATA_DIR", str(tmp_path))
    monkeypatch.setenv("LOOPAUDIT_TIME_ZONE", "Asia/Kolkata")
    monkeypatch.setenv("COLUMNS", "200")
    clock = PlantClock("Asia/Kolkata")
    _, _, said = as_program(monkeypatch, capsys, "keys", "create", "me", "--role", "admin")
    _, listed, _ = as_program(monkeypatch, capsys, "keys", "list", "--json")
    key = json.loads(listed)
    assert f"good until {clock.told(key['expires_at'])}. Shown" in said
    _, table, _ = as_program(monkeypatch, capsys, "keys", "list")
    assert "Created, Asia/Kolkata" in table
    assert clock.short(key["created_at"]) in table
    assert clock.short(key["expires_at"]) in table
    _, listed, _ = as_program(monkeypatch, capsys, "trail", "--json")
    _, table, _ = as_program(monkeypatch, capsys, "trail")
    assert "When, Asia/Kolkata" in table
    assert clock.to_the_second(json.loads(listed)["at"]) in table
    assert "UTC" not in table


@pytest.mark.parametrize("too_much", [("--days", "1e9"), ("--days", "9e6"), ("--per-minute", "9" * 20)])
def test_a_key_for_longer_or_more_than_can_be_kept_is_refused_in_words(monkeypatch, capsys, tmp_path, too_much):
    monkeypatch.setenv("LOOPAUDIT_DATA_DIR", str(tmp_path))
    code, made, said = as_program(monkeypatch, capsys, "keys", "create", "me", *too_much)
    assert (code, made) == (2, "")
    assert "Invalid value" in said


def test_no_key_is_for_ever(tmp_path, monkeypatch, capsys):
    monkeypatch.setenv("LOOPAUDIT_DATA_DIR", str(tmp_path))
    code, made, _ = as_program(monkeypatch, capsys, "keys", "create", "me", "--days", "0")
    assert (code, made) == (2, "")


def test_the_trail_is_asked_for_whole_names_and_says_so(tmp_path, monkeypatch, capsys):
    monkeypatch.setenv("LOOPAUDIT_DATA_DIR", str(tmp_path))
    assert as_program(monkeypatch, capsys, "keys", "create", "historian")[0] == 0
    code, shown, said = as_program(monkeypatch, capsys, "trail", "--who", "command line", "--json")
    assert (code, json.loads(shown)["who"], said) == (0, "command line", "")
    code, shown, said = as_program(monkeypatch, capsys, "trail", "--who", "command", "--json")
    assert (code, shown) == (0, "")
    assert said == (
        "loopaudit: nothing in the trail matches; --who and --action take whole names, as the trail shows them\n"
    )
    assert "called exactly so" in as_program(monkeypatch, capsys, "trail", "--help")[1]
