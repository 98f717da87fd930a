"""The text of a key: `la_<role>_<id>_<secret><crc>`.

The role and the id may be read by anyone, the secret has 256 bit from the system's generator. The check sum lets a
typing error be told without a look into the database, and lets scanners of source code know a key when they see one.
"""

import hashlib
import hmac
import re
import secrets
import zlib
from dataclasses import dataclass

from app.services.access.identity import Role

ALPHABET = "0123456789ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz"
ID_ALPHABET = "abcdefghijklmnopqrstuvwxyz234567"
ID_LENGTH, SECRET_LENGTH, CRC_LENGTH = 10, 43, 6  # 62**43 > 2**256, 62**6 > 2**32
PATTERN = re.compile(
    rf"la_(read|upload|audit|admin)_([a-z2-7]{{{ID_LENGTH}}})_([0-9A-Za-z]{{{SECRET_LENGTH + CRC_LENGTH}}})"
)


@dataclass(frozen=True)
class KeyText:
    """A key as its owner holds it."""

    text: str
    role: Role
    public_id: str

    @property
    def digest(self) -> str:
        """What is stored. A plain hash will do: nobody can guess 256 bit, however fast the hash."""
        return hashlib.sha256(self.text.encode()).hexdigest()

    def matches(self, digest: str) -> bool:
        return hmac.compare_digest(self.digest, digest)


def make(role: Role) -> KeyText:
    public_id = "".join(secrets.choice(ID_ALPHABET) for _ in range(ID_LENGTH))
    body = f"la_{role}_{public_id}_{_digits(secrets.randbits(256), SECRET_LENGTH)}"
    return KeyText(body + _crc(body), role, public_id)


def parse(text: str) -> KeyText | None:
    """None where this cannot be a key: wrong form or wrong check sum."""
    found = PATTERN.fullmatch(text)
    if found is None or _crc(text[:-CRC_LENGTH]) != text[-CRC_LENGTH:]:
        return None
    return KeyText(text, Role(found[1]), found[2])


def _crc(body: str) -> str:
    return _digits(zlib.crc32(body.encode()), CRC_LENGTH)


def _digits(number: int, length: int) -> str:
    digits = []
    for _ in range(length):
        number, digit = divmod(number, len(ALPHABET))
        digits.append(ALPHABET[digit])
    return "".join(reversed(digits))
