"""Log in through an organisation's OpenID Connect provider: authorization code with PKCE (RFC 7636), the identity token verified by its keys.

Nothing is kept between leaving and coming back: state, nonce and code verifier are derived from one random word in a short-lived cookie, so an
answer fits only the browser that asked. Off unless an issuer is named.
"""

import hashlib
import hmac
from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cache
from typing import Any

from estimators.errors import InputError
from sessions.accounts import ROLES

ALGORITHMS = ["RS256", "PS256", "ES256"]  # signed with the provider's private key; never none, never a shared secret
PATIENCE = 10.0  # s for the provider to answer
REFUSED = "the organisation's login was not accepted"


@dataclass(frozen=True, kw_only=True)
class SignOn:
    """What is agreed with the provider."""

    issuer: str
    client: str
    secret: str = field(default="", repr=False)
    claim: str = "roles"  # of the identity token
    roles: Mapping[str, str] = field(default_factory=lambda: {role: role for role in ROLES})  # the provider's word -> ours


def leave(agreed: SignOn, word: str, back: str) -> str:
    """Where the browser goes to; it comes back to `back`."""
    address, _ = _session(agreed, back).create_authorization_url(
        _provider(agreed.issuer)["authorization_endpoint"],
        state=_derived(word, "state"),
        code_verifier=_derived(word, "verifier"),
        nonce=_derived(word, "nonce"),
    )
    return str(address)


def identity(agreed: SignOn, word: str, back: str, state: str, code: str) -> dict[str, Any]:
    """Claims of who came back; InputError where anything does not fit."""
    if not word or not hmac.compare_digest(state, _derived(word, "state")):
        raise InputError(f"{REFUSED}: it was begun in another browser or too long ago")
    from authlib.integrations.base_client.errors import OAuthError
    from joserfc.errors import JoseError
    from requests import RequestException

    try:
        provider = _provider(agreed.issuer)
        token = _session(agreed, back).fetch_token(
            provider["token_endpoint"], code=code, code_verifier=_derived(word, "verifier"), timeout=PATIENCE
        )
        return _claims(agreed, str(token["id_token"]), _derived(word, "nonce"), _get(provider["jwks_uri"]))
    except (OAuthError, JoseError, RequestException, KeyError, ValueError) as problem:
        raise InputError(f"{REFUSED}: {type(problem).__name__}") from problem


def roles_of(agreed: SignOn, claims: Mapping[str, Any]) -> list[str]:
    """Our roles for the provider's words; InputError where there is none."""
    told = claims.get(agreed.claim, [])
    words = told.split() if isinstance(told, str) else told
    found = [role for role in ROLES if role in {agreed.roles.get(str(word)) for word in words}]
    if not found:
        raise InputError(f"{REFUSED}: it gives no role here")
    return found


def _claims(agreed: SignOn, token: str, nonce: str, keys: Any) -> dict[str, Any]:
    from joserfc import jwt
    from joserfc.jwk import KeySet

    claims: dict[str, Any] = jwt.decode(token, KeySet.import_key_set(keys), algorithms=ALGORITHMS).claims
    jwt.JWTClaimsRegistry(
        leeway=60,
        iss={"essential": True, "value": agreed.issuer},
        aud={"essential": True, "value": agreed.client},
        exp={"essential": True},
        sub={"essential": True},
        nonce={"essential": True, "value": nonce},
    ).validate(claims)
    return claims


def _session(agreed: SignOn, back: str) -> Any:
    from authlib.integrations.requests_client import OAuth2Session

    return OAuth2Session(agreed.client, agreed.secret, scope="openid profile", redirect_uri=back, code_challenge_method="S256")


@cache
def _provider(issuer: str) -> Mapping[str, Any]:
    """What the provider tells of itself (OpenID Connect Discovery 1.0)."""
    found: Mapping[str, Any] = _get(f"{issuer.rstrip('/')}/.well-known/openid-configuration")
    if found.get("issuer") != issuer:
        raise ValueError("the provider calls itself another issuer")
    return found


def _get(address: str) -> Any:
    import requests

    answer = requests.get(address, timeout=PATIENCE)
    answer.raise_for_status()
    return answer.json()


def _derived(word: str, what: str) -> str:
    return hmac.new(word.encode(), what.encode(), hashlib.sha256).hexdigest()
