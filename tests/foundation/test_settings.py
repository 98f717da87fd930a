"""Settings that cannot work are refused at the start, in words."""

import re
from datetime import time
from pathlib import Path

import pytest
from kombu import Connection
from pydantic import SecretStr, ValidationError

from app.broker_addresses import OPTIONS_OF_BROKERS, PROOFS_OF_BROKERS
from app.cli.configuration import load_settings
from app.errors import RequestError
from app.misspelt_settings import misspelt
from app.services.digests.webhooks import forbidden_hosts
from app.settings import Settings


@pytest.mark.parametrize("address", ["garbage", "http://redis:6379", "redis.example:6379/0"])
def test_a_broker_that_celery_would_take_for_something_else_is_refused(address: str) -> None:
    with pytest.raises(ValidationError, match="must begin with redis://"):
        Settings(broker_url=address)


def test_a_broker_that_is_refused_is_not_told_with_its_password() -> None:
    with pytest.raises(ValidationError) as raised:
        Settings(broker_url="redi://:hunter2@host/0")
    told = [error["msg"] for error in raised.value.errors(include_input=False)]
    assert "'redi'" in told[0]
    assert "hunter2" not in told[0]


@pytest.mark.parametrize(
    "address",
    [
        "redis://:hunter2/x@host/0",
        "redis://:12/hunter2@host/0",
        "amqp://plant:hunter2#x@host//",
        "amqp://plant:12?hunter2@host//",
        "amqp://plant:[hunter2@host//",
        "amqp://plant:hunter2@host:99999//",
        "amqp://plant:right@host//;amqp://plant:hunter2/x@host//",
        "redis://:hunter2@host/plant",
    ],
)
def test_an_address_of_a_broker_that_cannot_be_read_is_refused_without_its_password(address: str) -> None:
    """It was found out where it was first used, after a commit, and part of the password was told for the port."""
    with pytest.raises(ValidationError) as raised:
        Settings(broker_url=address)
    told = [error["msg"] for error in raised.value.errors(include_input=False)]
    assert "BROKER_URL cannot be read" in told[0]
    assert "hunter2" not in told[0]


@pytest.mark.parametrize("scheme", ["redis", "rediss", "amqp"])
@pytest.mark.parametrize(
    "options", ["colour=hunter2", "heartbeat=10&colour=hunter2", "password=hunter2", "ssl=1&ssl_ca_certs=hunter2"]
)
def test_options_of_a_broker_that_it_does_not_take_are_refused_at_the_start(scheme: str, options: str) -> None:
    """They were a TypeError at its first use, after a commit."""
    with pytest.raises(ValidationError) as raised:
        Settings(broker_url=f"{scheme}://:hunter2@host/0?{options}")
    (told,) = (error["msg"] for error in raised.value.errors(include_input=False))
    assert "BROKER_URL takes no such option behind its ?" in told
    assert told.endswith("ssl_" if scheme.startswith("redis") else "ssl_, which go not with ssl")
    assert "hunter2" not in told


@pytest.mark.parametrize("scheme", ["redis", "rediss", "amqp", "amqps"])
@pytest.mark.parametrize("value", ["hunter2", "Required", "ssl.CERT_NONE", "none&ssl_cert_reqs=hunter2"])
def test_how_a_broker_proves_who_it_is_is_one_of_the_words_for_it(scheme: str, value: str) -> None:
    """Another one was a KeyError at its first use."""
    with pytest.raises(ValidationError) as raised:
        Settings(broker_url=f"{scheme}://host/0?ssl_cert_reqs={value}")
    (told,) = (error["msg"] for error in raised.value.errors(include_input=False))
    assert "ssl_cert_reqs is one of CERT_NONE, CERT_OPTIONAL, CERT_REQUIRED, none, optional, required" in told
    assert "hunter2" not in told


@pytest.mark.parametrize("value", sorted(PROOFS_OF_BROKERS))
def test_the_words_that_are_taken_are_those_of_the_client(value: str) -> None:
    address = Settings(broker_url=f"rediss://:secret@host/0?ssl_cert_reqs={value}&ssl_ca_certs=%2Fa.pem").broker_url
    assert Connection(address).hostname == "host"


@pytest.mark.parametrize(
    "address",
    ["redis://h/0?ssl=1", "rediss://h/0?ssl=True", "amqp://h//?connect_timeout=3", "redis://h/0;redis://g/0?ssl=1"],
)
def test_an_option_that_its_kind_of_broker_cannot_have_is_refused(address: str) -> None:
    """The client takes it, and its transport then fails: a ValueError, a TypeError at the first use."""
    with pytest.raises(ValidationError, match="takes no such option behind its"):
        Settings(broker_url=address)


@pytest.mark.parametrize(
    "provider", ["hunter2.of", "json.hunter2", "json:hunter2", ".hunter2", ":", "", "..", "..hunter2.of", "a.hunter2\0"]
)
def test_a_provider_of_credentials_that_cannot_be_imported_is_refused_before_its_first_use(provider: str) -> None:
    """And the address is not repeated: what stands in it may be a password."""
    with pytest.raises(ValidationError) as raised:
        Settings(broker_url=f"rediss://:secret@host/0?heartbeat=2&credential_provider={provider}x")
    (told,) = (error["msg"] for error in raised.value.errors(include_input=False))
    assert told.endswith("BROKER_URL: credential_provider names nothing that can be imported")
    assert "hunter2" not in told
    assert "secret" not in told
    assert Settings(broker_url="redis://host/0?credential_provider=redis.CredentialProvider").broker_url


@pytest.mark.parametrize(
    ("written", "told"),
    [
        ("raise RuntimeError('hunter2')", "RuntimeError"),
        ("import os; os.environ['HUNTER2']", "KeyError"),
        ("hunter2 = (", "SyntaxError"),
        ("raise SystemExit", "SystemExit"),  # a script: the command would end without a word
    ],
)
def test_a_provider_of_credentials_that_fails_as_it_is_imported_is_refused_in_a_word(
    written: str, told: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Whatever it raises is not ours, and may tell what it looked for: its kind is told alone."""
    (tmp_path / "provider_that_fails.py").write_text(written)
    monkeypatch.syspath_prepend(tmp_path)
    monkeypatch.setenv("LOOPAUDIT_BROKER_URL", "redis://h/0?credential_provider=provider_that_fails.Own")
    with pytest.raises(RequestError) as raised:
        load_settings()
    assert raised.value.message.endswith(f"BROKER_URL: credential_provider fails as it is imported, by {told}")


@pytest.mark.parametrize("provider", ["json", "json:", "os.sep", "math.pi"])
def test_a_provider_of_credentials_is_something_that_can_be_called(provider: str) -> None:
    """Another one was a TypeError at its first use."""
    with pytest.raises(ValidationError, match="BROKER_URL: credential_provider names nothing that makes credentials"):
        Settings(broker_url=f"redis://host/0?credential_provider={provider}")


@pytest.mark.parametrize("value", ["hunter2", "10s", "nan", "-1"])
def test_a_heartbeat_of_a_broker_is_a_number_of_seconds(value: str) -> None:
    with pytest.raises(ValidationError) as raised:
        Settings(broker_url=f"amqp://h//?heartbeat={value}")
    (told,) = (error["msg"] for error in raised.value.errors(include_input=False))
    assert told.endswith("BROKER_URL: heartbeat is a number of seconds")
    assert Settings(broker_url="amqp://h//?heartbeat=2.5").broker_url


@pytest.mark.parametrize(
    ("scheme", "option"), [(scheme, option) for scheme, taken in OPTIONS_OF_BROKERS.items() for option in sorted(taken)]
)
def test_the_options_that_are_taken_are_those_of_the_client(scheme: str, option: str) -> None:
    value = "redis.CredentialProvider" if option == "credential_provider" else "1"
    address = Settings(broker_url=f"{scheme}://:secret@host/0?{option}={value}").broker_url
    assert Connection(address).hostname == "host"


@pytest.mark.parametrize(
    "address",
    [
        "",
        "redis://127.0.0.1:6379/3",
        "redis://127.0.0.1:6379",
        "redis://:a@b@[::1]:6379/",
        "rediss://host/0",
        "rediss://:secret@host/0?ssl_ca_certs=/etc/ca@plant.pem",
        "amqp://plant:p%2Fw@host:5672//",
        "amqp://plant:secret@one//;amqp://plant:secret@two//",
        "folder:///data/100%#1?x@y",
    ],
)
def test_known_brokers_are_taken(address: str) -> None:
    assert Settings(broker_url=address).broker_url == address


@pytest.mark.parametrize("name", ["localtime", "Nowhere/City", "", "UTC+8", "../UTC"])
def test_a_zone_is_one_that_browsers_know_too(name):
    with pytest.raises(ValueError, match="is no time zone"):
        Settings(time_zone=name)


@pytest.mark.parametrize("told", ["2:00", "02:00", "02:00:00", " 2:00"])
def test_the_hour_of_the_night_is_taken_as_people_write_it(told: str) -> None:
    assert Settings(nightly_at=told).nightly_at == time(2)


@pytest.mark.parametrize("told", ["2", "7200", "25:00", "02:60", "2am", "", "02:00+01:00"])
def test_another_hour_is_refused_with_an_example(told: str) -> None:
    with pytest.raises(ValidationError, match="HH:MM is needed, such as 02:00"):
        Settings(nightly_at=told)


@pytest.mark.parametrize(("budget_s", "limit_s"), [(10.0, 700.0), (595.0, 20.0), (300.0, 270.0), (560.0, 0.1)], ids=str)
def test_a_loop_must_end_before_its_task_is_ended(budget_s: float, limit_s: float) -> None:
    """It would end as worker_lost, and not as time_limit."""
    told = f"at most 560 together, got {budget_s} and {limit_s}"
    with pytest.raises(ValidationError, match=f"LOOPAUDIT_CHUNK_BUDGET_S and LOOPAUDIT_LOOP_LIMIT_S must be {told}"):
        Settings(chunk_budget_s=budget_s, loop_limit_s=limit_s, lease_s=2 * limit_s)
    assert Settings(chunk_budget_s=60.0, loop_limit_s=500.0, lease_s=1000.0).loop_limit_s == 500.0


@pytest.mark.parametrize("name", ["", "  "])
def test_a_plant_has_a_name(name: str) -> None:
    with pytest.raises(ValidationError, match="a name is needed"):
        Settings(plant=name)


@pytest.mark.parametrize(
    ("variable", "meant"),
    [
        ("LOOPAUDIT_REQUIRE_KEY", "did you mean LOOPAUDIT_REQUIRE_KEYS?"),
        ("LOOPAUDIT_NIGHTLYAT", "did you mean LOOPAUDIT_NIGHTLY_AT?"),
        ("loopaudit_allowed_host", "did you mean LOOPAUDIT_ALLOWED_HOSTS?"),
        ("LOOPAUDIT_PORT", "docs/SETTINGS.md lists them"),
    ],
)
def test_a_variable_that_is_no_setting_is_told_with_what_may_be_meant(variable: str, meant: str) -> None:
    (told,) = misspelt({variable: "hunter2"})
    assert told.startswith(f"{variable} is no setting; {meant}")
    assert "hunter2" not in told


def test_settings_and_what_others_read_are_no_misspelt_ones() -> None:
    known = {f"LOOPAUDIT_{name.upper()}": "1" for name in Settings.model_fields}
    elsewhere = ("URL", "KEY", "RECORDINGS", "TEST_POSTGRES_URL", "TEST_REQUIRE_SERVERS")
    of_kubernetes = ("SERVICE_HOST", "SERVICE_PORT", "SERVICE_PORT_HTTP", "PORT_8000_TCP", "PORT_8000_TCP_ADDR", "PORT")
    others = {f"LOOPAUDIT_{name}": "tcp://10.0.0.1:8000" for name in (*elsewhere, *of_kubernetes)}
    assert misspelt({**known, **others, "loopaudit_plant": "north", "PATH": "/bin"}) == []


def test_every_variable_that_the_project_itself_names_is_known() -> None:
    root = Path(__file__).resolve().parents[2]
    files = [*root.glob("docs/**/*.md"), root / "README.md", root / "docker-compose.yml", root / "Makefile"]
    files += [file for part in ("app", "tests/e2e", "tests/chaos") for file in (root / part).rglob("*.py")]
    named = {name for file in files for name in re.findall(r"\bLOOPAUDIT_[A-Z]\w*[A-Z]\b", file.read_text())}
    assert len(named) > 50
    assert misspelt(dict.fromkeys(named, "")) == []


@pytest.mark.parametrize(
    ("wrong", "said"),
    [
        ({"digest_webhook_secret": "whsec_"}, "what follows it is the secret"),
        ({"digest_smtp_host": "mail..example.com"}, "1 to 63 characters between its dots"),
        ({"digest_smtp_host": f"{'a' * 64}.example.com"}, "1 to 63 characters between its dots"),
        ({"digest_smtp_host": "mail.."}, "1 to 63 characters between its dots"),
        ({"digest_smtp_host": "."}, "1 to 63 characters between its dots"),
        ({"allowed_hosts": "loops..example.com"}, "names alone"),
        ({"digest_smtp_host": "http://mail"}, "is a name alone"),
        ({"digest_smtp_host": "mail:25"}, "is a name alone"),
        ({"digest_smtp_host": "mail/hidden"}, "is a name alone"),
        ({"allowed_hosts": "plant.example, http://foo:80/"}, "names alone, .*; got 'http://foo:80/'"),
        ({"allowed_hosts": "foo:80"}, "names alone"),
        ({"allowed_hosts": "*.example"}, "names alone"),
        ({"allowed_hosts": "[::1]"}, "without brackets"),
        ({"digest_webhooks": "https://"}, "number 1 of DIGEST_WEBHOOKS is no address"),
        ({"digest_webhooks": "https://a.example/,https://a.example:99999/hidden"}, "number 2 of DIGEST_WEBHOOKS"),
        ({"digest_webhooks": "https://hooks..example.com/hidden"}, "1 to 63 characters between its dots"),
        ({"digest_webhooks": f"https://{'a' * 64}.example/hidden"}, "1 to 63 characters between its dots"),
    ],
)
def test_what_can_never_work_is_refused_at_the_start(wrong: dict[str, str], said: str) -> None:
    with pytest.raises(ValidationError, match=said) as raised:
        Settings(**wrong)
    assert all("hidden" not in error["msg"] for error in raised.value.errors(include_input=False))


@pytest.mark.parametrize(
    "right",
    [
        {"digest_webhook_secret": "whsec_MfKQ9r8GKYqrTwjUPD8ILPZIo2LaLaSw"},
        {"digest_webhook_secret": "whsec_MfKQ9r8GKYqrTwjUPD8ILPZIo2LaLaSw8"},
        {"digest_webhook_secret": "whsec_@@@"},
        {"digest_webhook_secret": "a word of the plant @@@"},
        {"digest_smtp_host": f"{'a' * 63}.example"},
        {"digest_smtp_host": "mail-1.plant.example"},
        {"digest_smtp_host": "fd00::5"},
        {"allowed_hosts": "loops.plant.example, plant_server,10.0.0.7,::1"},
        {"digest_webhooks": "http://127.0.0.1:9/"},
        {"digest_webhooks": "https://93.184.216.34/hook,http://hooks.inside.example.:8080/?x=1,http://[::1]/"},
    ],
)
def test_what_may_work_is_taken(right: dict[str, object]) -> None:
    found = Settings(**right)
    for name, value in right.items():
        told = getattr(found, name)
        assert (told.get_secret_value() if isinstance(told, SecretStr) else told) == value


def test_the_dot_that_ends_a_whole_name_is_left_out() -> None:
    assert Settings(digest_smtp_host="smtp.example.com.").digest_smtp_host == "smtp.example.com"


@pytest.mark.parametrize(
    ("addresses", "forbidden"),
    [
        ("http://127.0.0.1:9/", ["127.0.0.1"]),
        ("https://a.example/,http://localhost/", ["localhost"]),
        ("http://[::1]/", ["::1"]),
        ("http://10.1.2.3/", ["10.1.2.3"]),
        ("https://93.184.216.34/hook,http://hooks.inside.example/", []),
    ],
)
def test_webhooks_that_go_inside_as_they_are_written_are_known(addresses: str, forbidden: list[str]) -> None:
    assert forbidden_hosts(Settings(digest_webhooks=addresses)) == forbidden
    assert forbidden_hosts(Settings(digest_webhooks=addresses, digest_private_webhooks=True)) == []


def test_a_rule_between_two_settings_is_told_without_a_stray_colon(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("LOOPAUDIT_LEASE_S", "1")
    with pytest.raises(RequestError) as raised:
        load_settings()
    assert raised.value.message.startswith("LOOPAUDIT_LEASE_S must be at least twice")
