"""Sends a FHIR Bundle to a server, with OAuth 2.0 client credentials where it wants them (docs/fhir.md).

Source  HL7 FHIR R4, 3.1.0.8.1 conditional create, 3.1.0.11 transaction; RFC 6749, 4.4; SMART App Launch 2.0, discovery by .well-known/smart-configuration
"""

import json
import os
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any
from urllib.parse import urlsplit

from handscope.estimators.errors import InputError

KIND = "application/fhir+json"
WAIT = 60.0  # s for an answer
SCOPE = "system/*.write"
LOOPBACK = ("127.0.0.1", "localhost", "::1")
CLIENT, SECRET, SECRET_FILE = (
    "HANDSCOPE_FHIR_CLIENT",
    "HANDSCOPE_FHIR_SECRET",
    "HANDSCOPE_FHIR_SECRET_FILE",
)
TOKEN_URL, SCOPES = "HANDSCOPE_FHIR_TOKEN_URL", "HANDSCOPE_FHIR_SCOPE"


@dataclass(frozen=True)
class Credentials:
    """Our credentials at a server; without a client the server needs none."""

    client: str = ""
    secret: str = ""
    token_url: str = ""  # where absent, the server's smart-configuration names it
    scope: str = SCOPE


def credentials(environment: Mapping[str, str] = os.environ) -> Credentials:
    """From the environment; the secret there, or in a file that it names. InputError where it is missing or cannot be read."""
    client, secret = environment.get(CLIENT, ""), environment.get(SECRET, "")
    if place := environment.get(SECRET_FILE, ""):
        try:
            secret = Path(place).read_text().strip()
        except (OSError, UnicodeDecodeError) as problem:
            raise InputError(
                "export.secret_file_unreadable",
                variable=SECRET_FILE,
                place=place,
                problem=str(problem),
            ) from None
    if client and not secret:
        raise InputError(
            "export.client_without_secret", client=CLIENT, file=SECRET_FILE, secret=SECRET
        )
    return Credentials(
        client, secret, environment.get(TOKEN_URL, ""), environment.get(SCOPES, SCOPE)
    )


def require_server(url: str) -> None:
    """InputError where the address is none, or would carry health data unencrypted over a network."""
    try:
        parts = urlsplit(url)
        host = parts.hostname
    except ValueError:
        parts, host = urlsplit(""), None
    if parts.scheme not in ("http", "https") or not host or parts.username or parts.query:
        raise InputError("export.no_fhir_address", url=url)
    if parts.scheme == "http" and host not in LOOPBACK:
        raise InputError("export.fhir_not_encrypted", url=url)


def send(bundle: bytes, url: str, known: Credentials) -> int:
    """Post a transaction Bundle; how many resources the server took. InputError where it did not take all of them.

    What is created only where the server has none goes first and by itself: servers bound the size of a transaction that has to look for something.
    """
    import requests

    require_server(url)
    content = json.loads(bundle)
    shared = [e for e in content["entry"] if "ifNoneExist" in e["request"]]
    content["entry"] = [e for e in content["entry"] if e not in shared]
    try:
        with requests.Session() as session:
            session.headers.update({"Content-Type": KIND, "Accept": KIND})
            if known.client:
                session.headers["Authorization"] = f"Bearer {_token(url, known)}"
            for entry in shared:
                _create_once(session, entry, url)
            answer = _post(session, content, url)
    except requests.RequestException as problem:
        raise InputError(
            "export.fhir_does_not_answer", url=url, problem=type(problem).__name__
        ) from None
    return len(shared) + _taken(answer, url)


def _create_once(session: Any, entry: Any, url: str) -> None:
    """Create a resource unless the server has it; InputError where it refuses."""
    request = entry["request"]
    place = f"{url.rstrip('/')}/{request['url']}"
    answer = _post(session, entry["resource"], place, {"If-None-Exist": request["ifNoneExist"]})
    if answer.status_code not in (200, 201):
        raise _refusal_of(answer, place)


def _post(session: Any, content: Any, url: str, headers: Mapping[str, str] | None = None) -> Any:
    return session.post(
        url, data=json.dumps(content), headers=headers, timeout=WAIT, allow_redirects=False
    )


def _token(url: str, known: Credentials) -> str:
    """An access token by client credentials."""
    from authlib.common.errors import AuthlibBaseError
    from authlib.integrations.requests_client import OAuth2Session

    place = known.token_url or _token_endpoint(url)
    require_server(place)
    with OAuth2Session(known.client, known.secret, scope=known.scope) as session:
        try:
            token = session.fetch_token(place, grant_type="client_credentials", timeout=WAIT)
        except (AuthlibBaseError, ValueError) as problem:
            raise InputError(
                "export.no_fhir_token", place=place, client=known.client, problem=str(problem)
            ) from None
    if not token.get("access_token"):
        raise InputError("export.no_fhir_token", place=place, client=known.client, problem="empty")
    return str(token["access_token"])


def _token_endpoint(url: str) -> str:
    import requests

    place = f"{url.rstrip('/')}/.well-known/smart-configuration"
    answer = requests.get(place, timeout=WAIT, allow_redirects=False)
    try:
        return str(answer.json()["token_endpoint"])
    except (ValueError, KeyError, TypeError):
        raise InputError("export.no_token_endpoint", place=place, variable=TOKEN_URL) from None


def _taken(answer: Any, url: str) -> int:
    body = _body(answer)
    if answer.status_code != 200 or body.get("type") != "transaction-response":
        raise _refusal_of(answer, url)
    entries = body.get("entry")
    statuses = [_status(e) for e in entries] if isinstance(entries, list) else []
    if refused := [s for s in statuses if not s.startswith("2")]:
        raise InputError("export.fhir_stored_in_part", url=url, status=refused[0])
    return len(statuses)


def _status(entry: Any) -> str:
    """Of an entry of a transaction's answer; "" where it has none."""
    response = entry.get("response") if isinstance(entry, dict) else None
    return str(response.get("status", "")) if isinstance(response, dict) else ""


def _body(answer: Any) -> Mapping[str, Any]:
    try:
        body = answer.json()
    except ValueError:
        return {}
    return body if isinstance(body, dict) else {}


def _refusal_of(answer: Any, url: str) -> InputError:
    """With the first words of its OperationOutcome."""
    issues = _body(answer).get("issue")
    first = issues[0] if isinstance(issues, list) and issues else None
    issue = first if isinstance(first, dict) else {}
    details = issue.get("details")
    text = details.get("text") if isinstance(details, dict) else None
    words = issue.get("diagnostics") or text or ""
    answered = f"{answer.status_code} {' '.join(str(words).split())[:300]}".strip()
    return InputError("export.fhir_refused", url=url, answer=answered)
