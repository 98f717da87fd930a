"""Who makes a request, by key or session, and how often they may."""

import asyncio
import logging
from contextlib import nullcontext

from fastapi import FastAPI
from fastapi.concurrency import run_in_threadpool

from app.http.asked import Asked, key_of, session_of
from app.http.noting import note
from app.http.problems import AWAY, Refusal
from app.services.access.authentication import Authenticator, Via, may_be_token
from app.services.access.identity import ANYONE, NOBODY, Identity
from app.services.access.rates import Rates

log = logging.getLogger("loopaudit.access")


class Callers:
    """Of one process; what the app opens with its start is looked up when it is needed."""

    def __init__(self, of: FastAPI) -> None:
        self._of = of
        self._rates: Rates = of.state.rates
        self._noting: set[asyncio.Task[None]] = set()

    @property
    def _access(self) -> Authenticator:
        access: Authenticator = self._of.state.access
        return access

    async def identified(self, asked: Asked, *, closed: bool) -> Identity | None:
        """Who asks; None: nobody said. A key or session that is not good is refused wherever one is needed. closed:
        a key is asked for."""
        if asked.permission.needs is None and not asked.permission.page:
            return None
        key = key_of(asked.headers)
        if key is not None:
            found = self._access.remembered(key)
            identity = found.identity if found else await looked_up(self._of, key, "key", asked.address)
            if identity is None and asked.permission.needs is not None:
                await self._refuse_key(asked)
            return identity
        token = session_of(asked.headers)
        if token is not None:
            identity = await self._of_session(token, asked)
            if identity is not None:
                return identity
        return None if closed else ANYONE

    async def _of_session(self, token: str, asked: Asked) -> Identity | None:
        """Wrong ones are counted, apart from wrong keys, and none is refused for it: the browser of somebody whose
        session has ended sends them too, from each open page, and is led to the login."""
        found = self._access.remembered(token, "session")
        if found:
            return found.identity
        if not may_be_token(token):
            return None
        identity = await looked_up(self._of, token, "session", asked.address)
        if identity is None:
            await run_in_threadpool(self._rates.refusal_wait_s, asked.address, "session")
        return identity

    async def _refuse_key(self, asked: Asked) -> None:
        wait_s = await run_in_threadpool(self._rates.refusal_wait_s, asked.address)
        if wait_s:
            raise too_many(wait_s, "too many wrong keys came from this address")
        await note(self._of, asked, NOBODY, "refused", 401)
        raise unauthorized("the key is not known, has expired or was revoked", "invalid_key")

    async def count(self, identity: Identity) -> None:
        """Raises Refusal where a key asks too often."""
        if identity.key_id is not None and self._access.due_to_note(identity):
            noting = asyncio.create_task(self._note_use(identity.key_id))
            self._noting.add(noting)
            noting.add_done_callback(self._noting.discard)
        if self._rates.shared:
            wait_s = await run_in_threadpool(self._rates.wait_s, identity)
        else:
            wait_s = self._rates.wait_s(identity)
        if wait_s:
            raise too_many(wait_s, f"this key may make {identity.requests_per_minute} requests a minute")

    async def _note_use(self, key_id: int) -> None:
        try:
            await run_in_threadpool(self._access.note_use, key_id)
        except AWAY as error:
            log.warning("the last use of a key could not be noted: %s", type(error).__name__)


async def looked_up(of: FastAPI, secret: str, via: Via, address: str) -> Identity | None:
    """Whose it is. Of addresses that sent too many wrong ones one after the other: they take one thread and one
    connection. A proxy may be such an address, with good keys behind it."""
    access: Authenticator = of.state.access
    wait_s = 0 if access.was_good(secret, via) else await run_in_threadpool(of.state.rates.refused_s, address, via)
    async with of.state.one_by_one if wait_s else nullcontext():
        return await run_in_threadpool(access.key if via == "key" else access.session, secret)


def unauthorized(text: str, code: str) -> Refusal:
    error = ', error="invalid_token"' if code == "invalid_key" else ""
    return Refusal(401, code, text, headers={"WWW-Authenticate": f'Bearer realm="loopaudit"{error}'})


def too_many(wait_s: int, text: str) -> Refusal:
    return Refusal(429, "too_many_requests", f"{text}; try again in {wait_s} s", headers={"Retry-After": str(wait_s)})
