"""Where a server is and how it is reached: what both kinds of clients share."""

from __future__ import annotations

import os
from dataclasses import dataclass, field
from pathlib import Path

import grpc

from troupe.errors import InvalidArgumentError

KEY_VARIABLE = "TROUPE_KEY"
MAX_MESSAGE_BYTES = 64 << 20


@dataclass(frozen=True)
class Target:
    """A server's address, and how to be let in."""

    address: str
    """HOST:PORT."""
    timeout_s: float
    """Time for one call."""
    metadata: tuple[tuple[str, str], ...] = field(repr=False)
    credentials: grpc.ChannelCredentials | None = field(repr=False)
    """None: without TLS."""

    @property
    def options(self) -> list[tuple[str, int]]:
        """Options of the channel. A connection that broke is tried again at once, then at most every second."""
        return [
            ("grpc.max_receive_message_length", MAX_MESSAGE_BYTES),
            ("grpc.max_send_message_length", MAX_MESSAGE_BYTES),
            ("grpc.keepalive_time_ms", 20_000),
            ("grpc.initial_reconnect_backoff_ms", 50),
            # Despite its name the time that an attempt may take.
            ("grpc.min_reconnect_backoff_ms", 5_000),
            ("grpc.max_reconnect_backoff_ms", 1_000),
        ]


def target(
    address: str,
    key: str | None,
    ca: str | Path | None,
    cert: str | Path | None,
    cert_key: str | Path | None,
    timeout: float,
) -> Target:
    """Reads an address such as `127.0.0.1:8080`, `http://127.0.0.1:8080` or `https://motion.example.com`.

    Raises:
        InvalidArgumentError: It is no address, or certificates do not fit together.

    """
    scheme, found, rest = address.partition("://")
    if not found:
        scheme, rest = ("https" if ca or cert else "http"), address
    host = rest.rstrip("/")
    if scheme not in ("http", "https") or not host or "/" in host or " " in host:
        allowed = "HOST:PORT, http://HOST:PORT or https://HOST:PORT"
        raise InvalidArgumentError(
            f"address: {address!r} is none; allowed: {allowed}", field="address", allowed=allowed
        )
    if scheme == "http" and (ca or cert):
        message = "address: certificates need an https:// address"
        raise InvalidArgumentError(message, field="address", allowed="https://HOST:PORT")
    if (cert is None) != (cert_key is None):
        message = "cert: a client's certificate and its key come together"
        raise InvalidArgumentError(message, field="cert", allowed="both of cert and cert_key")
    if ":" not in host.rpartition("]")[2]:
        host += ":443" if scheme == "https" else ":80"
    key = os.environ.get(KEY_VARIABLE) if key is None else key
    if key and not (key.isascii() and key.isprintable()):
        raise InvalidArgumentError("key: it has characters that no key has", field="key", allowed="printable ASCII")
    credentials = None
    if scheme == "https":
        credentials = grpc.ssl_channel_credentials(_read("ca", ca), _read("cert_key", cert_key), _read("cert", cert))
    metadata = (("authorization", f"Bearer {key}"),) if key else ()
    return Target(host, timeout, metadata, credentials)


def _read(field_name: str, path: str | Path | None) -> bytes | None:
    if path is None:
        return None
    try:
        return Path(path).read_bytes()
    except OSError as error:
        raise InvalidArgumentError(f"{field_name}: {error}", field=field_name, allowed="a PEM file") from error
