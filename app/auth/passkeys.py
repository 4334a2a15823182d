"""Passkeys (Web Authentication Level 2): what a browser is asked, and whether its answer is right.

A passkey belongs to the name under which the server is opened; an IP address is no such name (localhost is one).
"""

import base64
import ipaddress
import json
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any
from urllib.parse import urlsplit

from starlette.requests import HTTPConnection

from handscope.estimators.errors import InputError
from handscope.estimators.messages.sentence import phrase
from handscope.sessions.clinic.second_factors import ISSUER, MISSING
from handscope.sessions.db.tables import Account, SecondFactor

REFUSED = phrase("login.passkey_refused")
NO_NAME = phrase("login.passkeys_need_name")


@dataclass(frozen=True)
class Asked:
    """What a browser was asked."""

    options: dict[str, Any]  # for navigator.credentials, bytes as base64url
    challenge: bytes
    host: str
    origin: str


@dataclass(frozen=True)
class Registered:
    """A passkey that a browser made."""

    credential: str  # its number, base64url
    key: str  # its public key (COSE), base64
    counter: int


def host_of(connection: HTTPConnection) -> str:
    """The name under which the browser opened this server; "" where it is an IP address."""
    name = urlsplit(f"//{connection.headers.get('host', '')}").hostname or ""
    try:
        ipaddress.ip_address(name)
    except ValueError:
        return name
    return ""


def ask_to_register(
    connection: HTTPConnection, account: Account, present: Sequence[SecondFactor]
) -> Asked:
    """Ask for a new passkey; InputError where the server was opened by an IP address."""
    webauthn = _library()
    host = host_of(connection)
    if not host:
        raise InputError(NO_NAME)
    options = webauthn.generate_registration_options(
        rp_id=host,
        rp_name=ISSUER,
        user_name=account.name,
        user_id=f"handscope-{account.id}".encode(),
        exclude_credentials=_descriptors(webauthn, present),
    )
    return _to_asked(webauthn, options, connection, host)


def ask_to_prove(connection: HTTPConnection, present: Sequence[SecondFactor]) -> Asked:
    """Ask for one of the passkeys."""
    webauthn = _library()
    host = host_of(connection)
    options = webauthn.generate_authentication_options(
        rp_id=host, allow_credentials=_descriptors(webauthn, present)
    )
    return _to_asked(webauthn, options, connection, host)


def verify_registration(asked: Asked, answer: dict[str, Any]) -> Registered:
    """InputError where the browser's answer is not right."""
    webauthn = _library()
    try:
        found = webauthn.verify_registration_response(
            credential=answer,
            expected_challenge=asked.challenge,
            expected_rp_id=asked.host,
            expected_origin=asked.origin,
        )
    except _refusals(webauthn):
        raise InputError(REFUSED) from None
    return Registered(
        webauthn.helpers.bytes_to_base64url(found.credential_id),
        base64.b64encode(found.credential_public_key).decode(),
        found.sign_count,
    )


def verify(asked: Asked, answer: dict[str, Any], present: Sequence[SecondFactor]) -> SecondFactor:
    """The passkey that proved itself, its counter moved on; InputError where none did."""
    webauthn = _library()
    factor = next((f for f in present if f.credential == answer.get("id")), None)
    if factor is None:
        raise InputError(REFUSED)
    try:
        found = webauthn.verify_authentication_response(
            credential=answer,
            expected_challenge=asked.challenge,
            expected_rp_id=asked.host,
            expected_origin=asked.origin,
            credential_public_key=base64.b64decode(factor.secret),
            credential_current_sign_count=factor.counter,
        )
    except _refusals(webauthn):
        raise InputError(REFUSED) from None
    factor.counter = found.new_sign_count
    return factor


def _to_asked(webauthn: Any, options: Any, connection: HTTPConnection, host: str) -> Asked:
    scheme = "https" if connection.scope["scheme"] in ("https", "wss") else "http"
    origin = f"{scheme}://{connection.headers['host']}"
    return Asked(json.loads(webauthn.options_to_json(options)), options.challenge, host, origin)


def _descriptors(webauthn: Any, present: Sequence[SecondFactor]) -> list[Any]:
    from webauthn.helpers.structs import PublicKeyCredentialDescriptor

    read = webauthn.helpers.base64url_to_bytes
    return [PublicKeyCredentialDescriptor(id=read(f.credential)) for f in present]


def _refusals(webauthn: Any) -> tuple[type[Exception], ...]:
    return webauthn.helpers.exceptions.WebAuthnException, ValueError, KeyError, TypeError


def _library() -> Any:
    try:
        import webauthn
        import webauthn.helpers.exceptions
    except ImportError:
        raise InputError(MISSING) from None
    return webauthn
