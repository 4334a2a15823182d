"""Login through an OpenID Connect provider: authorization code with PKCE (RFC 7636), the identity token verified by its keys.

The server stores nothing between redirect and answer: state, nonce and code verifier are derived from one random word
in a short-lived cookie, so an answer is valid only in the browser that asked. Off unless an issuer is configured. A
mismatch raises SignOnError with its reason, for the log, without any part of a token or of the secret.
"""

import hashlib
import hmac
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, Literal
from urllib.parse import quote_plus, urlencode

from handscope.app.auth.sign_on_scope import SCOPE
from handscope.estimators.errors import InputError
from handscope.sessions.clinic.accounts import LONGEST_SUBJECT
from handscope.sessions.db.roles import ROLES

# signed with the provider's private key; never none, never a shared secret
ALGORITHMS = ["RS256", "PS256", "ES256"]
PATIENCE = 10.0  # s for the provider to answer
LEEWAY = 60  # s that the provider's clock may differ from ours
NAME = "preferred_username"  # the claim that an account is called by
LONGEST = 300  # characters of a reason
# mismatch, too late, no role here, provider cannot be reached
Kind = Literal["refused", "late", "role", "away"]


class SignOnError(InputError):
    """The login is refused; the browser gets the kind only."""

    def __init__(self, kind: Kind, reason: str) -> None:
        super().__init__(" ".join(reason.split())[:LONGEST])
        self.kind: Kind = kind


@dataclass(frozen=True, kw_only=True)
class SignOn:
    """The configuration agreed with the provider."""

    issuer: str
    client: str
    secret: str = field(default="", repr=False)
    scope: str = SCOPE
    claim: str = "roles"  # of the identity token, or of the provider's user information
    # the provider's word -> ours
    roles: Mapping[str, str] = field(default_factory=lambda: {role: role for role in ROLES})


@dataclass(frozen=True, kw_only=True)
class Answer:
    """What the browser brings back in its address (RFC 6749, 4.1.2; RFC 9207)."""

    state: str
    code: str
    error: str = ""
    issuer: str = ""


def authorization_address(agreed: SignOn, word: str, back: str) -> str:
    """Address of the provider's login; the browser returns to `back`."""
    address, _ = _session(agreed, back).create_authorization_url(
        _require_entry(_provider(agreed), "authorization_endpoint"),
        state=_derive_key(word, "state"),
        code_verifier=_derive_key(word, "verifier"),
        nonce=_derive_key(word, "nonce"),
    )
    return str(address)


def logout_address(agreed: SignOn, back: str) -> str | None:
    """Address that ends the provider's own login (OpenID Connect RP-Initiated Logout 1.0), then returns to `back`; None where
    the provider has none."""
    ends = _provider(agreed).get("end_session_endpoint")
    query = urlencode({"client_id": agreed.client, "post_logout_redirect_uri": back})
    return f"{ends}{'&' if '?' in str(ends) else '?'}{query}" if ends else None


def verify_identity(agreed: SignOn, word: str, back: str, answer: Answer) -> Mapping[str, Any]:
    """Verified claims of the account that logged in; SignOnError where they do not verify."""
    if not word or not hmac.compare_digest(
        answer.state.encode(), _derive_key(word, "state").encode()
    ):
        raise SignOnError("late", "it was begun in another browser or too long ago")
    if answer.issuer and answer.issuer != agreed.issuer:
        raise SignOnError(
            "refused", f"the answer comes from {answer.issuer!r}, not from {agreed.issuer}"
        )
    if answer.error or not answer.code:
        raise SignOnError("refused", f"the provider says {answer.error or 'nothing'!r}")
    provider = _provider(agreed)
    token = _token(agreed, provider, word, back, answer.code)
    claims = _claims(
        agreed,
        str(token.get("id_token")),
        _derive_key(word, "nonce"),
        _get(_require_entry(provider, "jwks_uri")),
    )
    return _with_information(agreed, provider, token, claims)


def roles_of(agreed: SignOn, claims: Mapping[str, Any]) -> list[str]:
    """Our roles for the provider's words."""
    value = claims.get(agreed.claim) or []
    words = (
        value.split()
        if isinstance(value, str)
        else value
        if isinstance(value, Sequence)
        else [value]
    )
    roles = [role for role in ROLES if role in {agreed.roles.get(str(word)) for word in words}]
    if not roles:
        held = (
            "is not told"
            if agreed.claim not in claims
            else f"holds {', '.join(map(repr, words)) or 'nothing'}"
        )
        raise SignOnError(
            "role", f"no role here for {claims['sub']!r}: the claim {agreed.claim!r} {held}"
        )
    return roles


def subject_of(agreed: SignOn, claims: Mapping[str, Any]) -> str:
    """A permanent identifier of the account: a name may pass to somebody else, this may not."""
    subject = f"{agreed.issuer} {claims['sub']}"
    if len(subject) > LONGEST_SUBJECT:
        raise SignOnError(
            "refused", f"issuer and subject have more than {LONGEST_SUBJECT} characters"
        )
    return subject


def _token(
    agreed: SignOn, provider: Mapping[str, Any], word: str, back: str, code: str
) -> Mapping[str, Any]:
    """The provider's token for the code; the secret is encoded as RFC 6749, 2.3.1 requires."""
    from authlib.common.errors import AuthlibBaseError
    from requests import RequestException
    from requests.auth import HTTPBasicAuth

    proof = (
        HTTPBasicAuth(quote_plus(agreed.client), quote_plus(agreed.secret))
        if agreed.secret
        else None
    )
    place = _require_entry(provider, "token_endpoint")
    try:
        token = _session(agreed, back).fetch_token(
            place,
            code=code,
            code_verifier=_derive_key(word, "verifier"),
            auth=proof,
            timeout=PATIENCE,
        )
    except AuthlibBaseError as problem:
        raise SignOnError("refused", f"{place} says {problem}") from problem
    except (RequestException, ValueError) as problem:
        raise SignOnError(
            "away", f"{place} gives no token: {type(problem).__name__} {problem}"
        ) from problem
    if not isinstance(token, Mapping):
        raise SignOnError("away", f"{place} gives no token")
    return token


def _claims(agreed: SignOn, token: str, nonce: str, keys: Any) -> Mapping[str, Any]:
    """Verified claims of an identity token: issuer, audience, time and nonce (OpenID Connect Core 1.0, 3.1.3.7)."""
    from joserfc import jwt
    from joserfc.errors import JoseError
    from joserfc.jwk import KeySet

    try:
        claims: dict[str, Any] = jwt.decode(
            token, KeySet.import_key_set(keys), algorithms=ALGORITHMS
        ).claims
        jwt.JWTClaimsRegistry(
            leeway=LEEWAY,
            iss={"essential": True, "value": agreed.issuer},
            aud={"essential": True, "value": agreed.client},
            exp={"essential": True},
            sub={"essential": True},
            nonce={"essential": True, "value": nonce},
        ).validate(claims)
    except (JoseError, KeyError, TypeError, ValueError) as problem:
        raise SignOnError(
            "refused", f"the identity token: {type(problem).__name__} {problem}"
        ) from problem
    party = claims.get("azp")
    if party not in (agreed.client, None) or (
        party is None and claims["aud"] not in (agreed.client, [agreed.client])
    ):
        raise SignOnError(
            "refused", "the identity token was made for another program, too, or for that alone"
        )
    return claims


def _with_information(
    agreed: SignOn, provider: Mapping[str, Any], token: Mapping[str, Any], claims: Mapping[str, Any]
) -> Mapping[str, Any]:
    """The claims; where name or roles are missing, with the provider's user information (Core, 5.3 and 5.4)."""
    place = provider.get("userinfo_endpoint")
    if not place or (NAME in claims and agreed.claim in claims):
        return claims
    more = _get(str(place), {"Authorization": f"Bearer {token.get('access_token')}"})
    if more.get("sub") != claims["sub"]:
        raise SignOnError("refused", "the provider's user information is about somebody else")
    return {**more, **claims}


def _session(agreed: SignOn, back: str) -> Any:
    from authlib.integrations.requests_client import OAuth2Session

    return OAuth2Session(
        agreed.client,
        agreed.secret,
        scope=agreed.scope,
        redirect_uri=back,
        code_challenge_method="S256",
    )


def _provider(agreed: SignOn) -> Mapping[str, Any]:
    """The provider's configuration (OpenID Connect Discovery 1.0)."""
    configuration = _get(f"{agreed.issuer.rstrip('/')}/.well-known/openid-configuration")
    if configuration.get("issuer") != agreed.issuer:
        raise SignOnError(
            "away",
            f"the provider calls itself {configuration.get('issuer')!r}, the issuer named here is {agreed.issuer!r}",
        )
    return configuration


def _require_entry(provider: Mapping[str, Any], what: str) -> str:
    if not provider.get(what):
        raise SignOnError("away", f"the provider tells no {what}")
    return str(provider[what])


def _get(address: str, headers: Mapping[str, str] | None = None) -> Mapping[str, Any]:
    import requests

    try:
        answer = requests.get(address, headers=headers, timeout=PATIENCE)
        answer.raise_for_status()
        value = answer.json()
    except (requests.RequestException, ValueError) as problem:
        raise SignOnError(
            "away", f"{address} cannot be read: {type(problem).__name__} {problem}"
        ) from problem
    if not isinstance(value, Mapping):
        raise SignOnError("away", f"{address} gives no object of JSON")
    return value


def _derive_key(word: str, what: str) -> str:
    return hmac.new(word.encode(), what.encode(), hashlib.sha256).hexdigest()
