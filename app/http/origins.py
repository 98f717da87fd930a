"""Where a request comes from: the name that it calls us by, and the site that a browser sends it from."""

import ipaddress
from collections.abc import Collection, Mapping
from urllib.parse import urlsplit

SAME_SITE = ("same-origin", "none")  # none: typed in or bookmarked by the user
LOCAL_NAMES = ("localhost",)
FORWARDED, FORWARDED_PREFIX = ("forwarded", "via", "x-real-ip"), "x-forwarded-"


def host_allowed(host_header: str, allowed: Collection[str], *, keys_required: bool) -> bool:
    """Whether the Host is ours. Without keys, a name that somebody else's DNS may point at us must be listed:
    otherwise a page from there could read everything (DNS rebinding). An address cannot be pointed elsewhere."""
    name = host_name(host_header)
    if name in allowed:
        return True
    if keys_required:
        return not allowed
    return names_a_machine(name)


def names_a_machine(name: str) -> bool:
    """Whether it is an address, or this machine's own name: nobody's DNS says where that is."""
    return name in LOCAL_NAMES or is_address(name)


def host_name(host_header: str) -> str:
    try:
        return (urlsplit(f"//{host_header}").hostname or "").rstrip(".")
    except ValueError:
        return ""


def is_address(name: str) -> bool:
    try:
        ipaddress.ip_address(name)
    except ValueError:
        return False
    return True


def is_loopback(name: str | None) -> bool:
    if name == "localhost":
        return True
    try:
        return ipaddress.ip_address(name or "").is_loopback
    except ValueError:
        return False


def is_forwarded(headers: Mapping[str, str]) -> bool:
    """Whether a proxy says that it passes on what somebody else asked."""
    return any(name in FORWARDED or name.startswith(FORWARDED_PREFIX) for name in headers)


def crosses_sites(headers: Mapping[str, str]) -> bool:
    """Whether a browser sends this from a page of another site. Clients that are no browsers send neither header."""
    site = headers.get("sec-fetch-site")
    if site is not None:
        return site.strip().lower() not in SAME_SITE
    origin = headers.get("origin")
    if origin is None:
        return False
    try:
        return urlsplit(origin).netloc.lower() != headers.get("host", "").lower()
    except ValueError:
        return True
