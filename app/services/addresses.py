"""Addresses of pages: a tag may hold slashes and whatever else, so it is percent-encoded whole."""

from urllib.parse import quote


def tag_in_url(tag: str) -> str:
    return quote(tag, safe="")


def loop_address(public_url: str, tag: str) -> str:
    """Where people find the loop's page; empty where it is not known how they reach the service."""
    return f"{public_url}/loops/{tag_in_url(tag)}" if public_url else ""
