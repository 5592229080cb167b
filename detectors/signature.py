"""Signatures of model files with a user's key, because a checksum does not detect manipulation."""

from __future__ import annotations

import hashlib
import hmac
import os
from pathlib import Path

#: Environment variable with the path of the key file, whose bytes are the key.
KEY_FILE = "TAUGUARD_MODEL_KEY"
#: Least length of a key [bytes].
SHORTEST = 16


def key_of_user() -> bytes | None:
    """The key in the file that the environment variable ``TAUGUARD_MODEL_KEY`` names.

    Raises:
        ValueError: the file cannot be read, or is shorter than 16 bytes.
    """
    path = os.environ.get(KEY_FILE)
    if not path:
        return None
    try:
        key = Path(path).read_bytes()
    except OSError as error:
        raise ValueError(f"{path}: the key cannot be read ({error.strerror})") from None
    if len(key) < SHORTEST:
        raise ValueError(f"{path}: a key of {len(key)} bytes, expected {SHORTEST} or more")
    return key


def signed(checksum: str, key: bytes) -> str:
    """HMAC-SHA256 of a content's checksum."""
    return hmac.new(key, checksum.encode(), hashlib.sha256).hexdigest()


def check_signature(checksum: str, signature: object, key: bytes) -> None:
    """Refuse a content that was not signed with this key.

    Raises:
        ValueError: no signature, or one with another key.
    """
    if not isinstance(signature, str):
        raise ValueError("not signed, and a key is set: sign it by writing it with the key")
    if not hmac.compare_digest(signed(checksum, key), signature):
        raise ValueError("signed with another key, or changed since")
