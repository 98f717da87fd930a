"""What can be wrong with the address of a broker, told before anybody uses it."""

import re
from urllib.parse import parse_qsl, urlsplit

UNREAD_BROKER = (
    "a port is a number, and so is the database of a Redis; / ? # ; [ % in a password are %2F %3F %23 %3B %5B %25"
)
_FOR_ALL = frozenset({"credential_provider", "heartbeat", "insist", "login_method"})
OPTIONS_OF_BROKERS = {"redis": _FOR_ALL | {"connect_timeout"}, "amqp": _FOR_ALL | {"ssl"}}
"""What kombu takes behind the ? of an address, and its transport can use, beside ssl_...: another one is a TypeError or
a ValueError at its first use."""
PROOFS_OF_BROKERS = frozenset({"CERT_NONE", "CERT_OPTIONAL", "CERT_REQUIRED", "none", "optional", "required"})
BROKERS = ("redis://", "rediss://", "folder://", "amqp://", "amqps://")


def is_read_by_kombu(broker: str) -> bool:
    """Whether host, port and database stand where kombu looks for them: behind a password whose letters end them early
    it fails at the first use, and tells part of the password."""
    try:
        parts = urlsplit(broker)
        _ = parts.port
    except ValueError:
        return False
    if "@" in parts.path + parts.query + parts.fragment and "@" not in parts.netloc:
        return False
    name = parts.path.removeprefix("/")
    return not parts.scheme.startswith("redis") or name == "" or name.isdecimal()


def wrong_option(broker: str) -> str:
    """What is wrong behind the ? of an address that can be read, going on from the setting's name; empty: nothing."""
    parts = urlsplit(broker)
    given = parse_qsl(parts.query)
    names = {name for name, _ in given}
    of_tls = {name for name in names if name.startswith("ssl_")}
    taken = OPTIONS_OF_BROKERS["redis" if parts.scheme.startswith("redis") else "amqp"]
    if not names <= taken | of_tls or ("ssl" in names and of_tls):
        tls = "those that begin with ssl_" + (", which go not with ssl" if "ssl" in taken else "")
        return f" takes no such option behind its ?; there is {', '.join(sorted(taken))}, and {tls}"
    if not PROOFS_OF_BROKERS.issuperset(value for name, value in given if name == "ssl_cert_reqs"):
        return f": ssl_cert_reqs is one of {', '.join(sorted(PROOFS_OF_BROKERS))}"
    beats = [value for name, value in given if name == "heartbeat"]
    numbers = all(re.fullmatch(r"\d+(\.\d*)?", value, re.ASCII) for value in beats)
    if not numbers:
        return ": heartbeat is a number of seconds"
    providers = (value for name, value in given if name == "credential_provider")
    return next(filter(None, map(_wrong_provider, providers)), "")


def _wrong_provider(name: str) -> str:
    """What is wrong with what makes the credentials, which is imported as kombu does at its first use: whoever made it
    installs it beside us. Of what it raises the kind is told alone: the rest may hold a secret."""
    from kombu.utils.imports import symbol_by_name

    option = ": credential_provider"
    try:
        maker = symbol_by_name(name)
    except (ImportError, AttributeError, TypeError, ValueError):  # TypeError: of a name that begins with two dots
        return option + " names nothing that can be imported"
    except (Exception, SystemExit) as error:  # noqa: BLE001 - it runs code of others, before anything of ours does
        return f"{option} fails as it is imported, by {type(error).__name__}"
    return "" if callable(maker) else option + " names nothing that makes credentials"
