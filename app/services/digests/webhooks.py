"""A digest as a signed POST: by the scheme of Standard Webhooks, to no address that is not meant for it.

https://github.com/standard-webhooks/standard-webhooks/blob/main/spec/standard-webhooks.md
"""

import asyncio
import base64
import hashlib
import hmac
import ipaddress
import socket
import time
from urllib.parse import urlsplit

import httpx

from app.services.digests.sending import NotSentError, Post
from app.settings import IN_BASE64, Settings

TIMEOUT = httpx.Timeout(10.0, connect=5.0)
WHOLE_S = 30.0
"""Until there is an answer. Each byte of one may take the time above, and the audits wait behind this."""
LATER = (408, 409, 425, 429)
NAT64 = ipaddress.ip_network("64:ff9b::/96")
UNICAST = ipaddress.ip_network("2000::/3")
"""All that IPv6 has given out for the world; what is not of it, as the old site-local addresses, is special."""


def send_webhook(settings: Settings, made: Post, address: str) -> None:
    """Raises NotSentError; final where the receiver says that it will never take it."""
    timestamp = int(time.time())
    headers = {
        "Content-Type": "application/json",
        "User-Agent": "loopaudit",
        "webhook-id": made.id,
        "webhook-timestamp": str(timestamp),
        "webhook-signature": signature(settings.digest_webhook_secret.get_secret_value(), made, timestamp),
    }
    try:
        url = httpx.URL(address)
        target = checked_address(url, settings.digest_private_webhooks)
        status = asyncio.run(asyncio.wait_for(_post(url, target, headers, made.body), WHOLE_S))
    except (httpx.HTTPError, httpx.InvalidURL, OSError, UnicodeError) as error:
        # Their texts may hold the address, and that a secret.
        raise NotSentError(f"the receiver cannot be reached: {type(error).__name__}") from error
    if 300 <= status < 400:
        raise NotSentError(f"the receiver answered {status}: redirects are not followed", final=True)
    if not 200 <= status < 300:
        raise NotSentError(f"the receiver answered {status}", final=400 <= status < 500 and status not in LATER)


def signature(secret: str, made: Post, timestamp: int) -> str:
    """`v1,` and the HMAC-SHA256 of id.timestamp.body in base64."""
    signed = f"{made.id}.{timestamp}.".encode() + made.body
    return "v1," + base64.b64encode(hmac.new(key_of(secret), signed, hashlib.sha256).digest()).decode()


def key_of(secret: str) -> bytes:
    """What `whsec_` and base64 stand for; any other text as it is."""
    if secret.startswith(IN_BASE64) and not is_taken_as_it_is(secret):
        return base64.b64decode(secret.removeprefix(IN_BASE64), validate=True)
    return secret.encode()


def is_taken_as_it_is(secret: str) -> bool:
    """Whether it begins with `whsec_` and goes on as no base64, or as one of another alphabet or without its padding:
    receivers differ in what they make of these, so that each is signed with as it always was."""
    if not secret.startswith(IN_BASE64):
        return False
    try:
        base64.b64decode(secret.removeprefix(IN_BASE64), validate=True)
    except ValueError:
        return True
    return False


def checked_address(url: httpx.URL, private: bool) -> str:
    """The IP address to connect to. What the name resolves to is checked and then used, so that a name cannot mean
    something else a moment later. Raises NotSentError for a private, loopback or otherwise special address, OSError or
    UnicodeError where it resolves to none."""
    port = url.port or (443 if url.scheme == "https" else 80)
    found = [str(entry[4][0]) for entry in socket.getaddrinfo(url.host, port, type=socket.SOCK_STREAM)]
    if not private and not all(_public(address) for address in found):
        text = f"{url.host} is a private or special address; LOOPAUDIT_DIGEST_PRIVATE_WEBHOOKS=true allows these"
        raise NotSentError(text, final=True)
    return found[0]


def forbidden_hosts(settings: Settings) -> list[str]:
    """Of receivers that go inside by what is written, whatever a name server says, and are not let there."""
    webhooks = [receiver for receiver in settings.digest_receivers if not receiver.startswith("mailto:")]
    hosts = [urlsplit(address).hostname or "" for address in webhooks]
    return [] if settings.digest_private_webhooks else [host for host in hosts if _is_inside(host)]


def _is_inside(host: str) -> bool:
    try:
        return not _public(host)
    except ValueError:
        return host == "localhost" or host.endswith(".localhost")


def _public(address: str) -> bool:
    """An IPv6 address that carries an IPv4 one is judged by that too."""
    ip = ipaddress.ip_address(address.partition("%")[0])
    carried = [ip]
    if isinstance(ip, ipaddress.IPv6Address):
        if not (ip in UNICAST or ip in NAT64 or ip.ipv4_mapped):
            return False
        carried += [inner for inner in (ip.ipv4_mapped, ip.sixtofour) if inner]
        carried += [ipaddress.IPv4Address(ip.packed[-4:])] if ip in NAT64 else []
    return all(one.is_global and not one.is_multicast for one in carried)


async def _post(url: httpx.URL, target: str, headers: dict[str, str], body: bytes) -> int:
    """The status. The answer's body is not read; the certificate is checked against the name."""
    given = headers | {"Host": url.netloc.decode("ascii")}
    async with (
        httpx.AsyncClient(timeout=TIMEOUT, follow_redirects=False, trust_env=False) as client,
        client.stream(
            "POST",
            url.copy_with(host=target, userinfo=b""),
            content=body,
            headers=given,
            auth=(url.username, url.password) if url.username else None,
            extensions={"sni_hostname": url.host},
        ) as answer,
    ):
        return answer.status_code
