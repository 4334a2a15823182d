"""Second factors of local accounts: codes of an authenticator (TOTP), passkeys (WebAuthn), recovery codes.

An account that has a code or a passkey needs one at each login by password or one-time code; recovery codes stand in for a lost one,
each once. This computer's own account and those of single sign-on have none: the folder, or the organisation, is their second factor.
Source  RFC 6238 (30 s, six digits, one step of tolerance, no step twice); Web Authentication Level 2. Recovery codes (80 random bits)
        are kept as their SHA-256 alone; a TOTP secret has to be kept as it is
"""

import base64
import hashlib
import secrets
from collections.abc import Collection, Sequence
from typing import Any

from sqlalchemy import delete, select, update
from sqlalchemy.orm import Session

from handscope.estimators.errors import InputError
from handscope.estimators.messages.sentence import phrase
from handscope.sessions.clinic.accounts import LOCAL
from handscope.sessions.db.plain_text import require_plain
from handscope.sessions.db.tables import Account, SecondFactor, now

TOTP, PASSKEY, RECOVERY = "totp", "passkey", "recovery"
ISSUER = "Handscope"
TOLERANCE = 1  # steps of 30 s by which a phone's clock may be off
RECOVERY_CODES = 10
MOST = 10  # passkeys and authenticators of an account
LONGEST_NAME = 64
MISSING = phrase("login.no_second_factors")
NONE_HERE = phrase("login.no_second_factor_here")
WRONG = phrase("login.code_wrong")


def of_account(db: Session, account: Account) -> list[SecondFactor]:
    """Those that let in, the oldest first; recovery codes are not among them."""
    query = select(SecondFactor).where(
        SecondFactor.account_id == account.id,
        SecondFactor.kind != RECOVERY,
        SecondFactor.confirmed.is_(True),
    )
    return list(db.scalars(query.order_by(SecondFactor.id)))


def accounts_with_one(db: Session) -> frozenset[int]:
    """Accounts that have an authenticator or a passkey."""
    query = select(SecondFactor.account_id).where(
        SecondFactor.kind != RECOVERY, SecondFactor.confirmed.is_(True)
    )
    return frozenset(db.scalars(query))


def needs_one(db: Session, account: Account) -> bool:
    """Whether a login of the account needs a second factor."""
    return may_have_one(account) and bool(of_account(db, account))


def may_have_one(account: Account) -> bool:
    """Whether the account is one with a password of its own."""
    return account.name != LOCAL and account.subject is None


def lacks_required(db: Session, account: Account, roles: Collection[str]) -> bool:
    """Whether one of the account's roles requires a second factor that it does not have."""
    required = may_have_one(account) and not set(roles).isdisjoint(account.roles)
    return required and not of_account(db, account)


def begin_totp(db: Session, account: Account, name: str) -> tuple[SecondFactor, str]:
    """A new authenticator, not confirmed yet, and the address for its QR code."""
    pyotp = _library("pyotp")
    _require_room(db, account)
    _forget_unconfirmed(db, account)
    made = SecondFactor(
        account_id=account.id, kind=TOTP, name=_checked_name(name), secret=pyotp.random_base32()
    )
    db.add(made)
    db.commit()
    address = pyotp.TOTP(made.secret, name=account.name, issuer=ISSUER).provisioning_uri()
    return made, str(address)


def confirm_totp(db: Session, account: Account, code: str) -> list[str]:
    """Take the new authenticator into use; gives recovery codes where the account has none yet."""
    query = select(SecondFactor).where(
        SecondFactor.account_id == account.id,
        SecondFactor.kind == TOTP,
        SecondFactor.confirmed.is_(False),
    )
    waiting = db.scalar(query)
    if waiting is None:
        raise InputError("clinic.no_authenticator_to_confirm")
    if not _matches(db, waiting, code):
        raise InputError(WRONG)
    waiting.confirmed = True
    return _with_first_codes(db, account)


def add_passkey(
    db: Session, account: Account, name: str, credential: str, key: str, counter: int, host: str
) -> list[str]:
    """A passkey whose registration was verified (app/auth/passkeys.py); recovery codes as above."""
    _require_room(db, account)
    db.add(
        SecondFactor(
            account_id=account.id,
            kind=PASSKEY,
            name=_checked_name(name),
            credential=credential,
            secret=key,
            counter=counter,
            host=host,
            confirmed=True,
        )
    )
    return _with_first_codes(db, account)


def passkeys(db: Session, account: Account, host: str) -> list[SecondFactor]:
    """Those that were made for this host: browsers offer them nowhere else."""
    return [f for f in of_account(db, account) if f.kind == PASSKEY and f.host == host]


def accept_code(db: Session, account: Account, code: str) -> bool:
    """Whether it is a code of an authenticator, or a recovery code; either lets in once. The caller commits."""
    for factor in of_account(db, account):
        if factor.kind == TOTP and _matches(db, factor, code):
            factor.used = now()
            return True
    used = db.execute(
        delete(SecondFactor).where(
            SecondFactor.account_id == account.id,
            SecondFactor.kind == RECOVERY,
            SecondFactor.secret == _hash(code),
        )
    )
    return bool(getattr(used, "rowcount", 0))


def new_recovery_codes(db: Session, account: Account) -> list[str]:
    """Ten codes; those that there were count no longer."""
    db.execute(delete(SecondFactor).where(*_recovery(account)))
    codes = [_random_code() for _ in range(RECOVERY_CODES)]
    db.add_all(
        SecondFactor(account_id=account.id, kind=RECOVERY, secret=_hash(code), confirmed=True)
        for code in codes
    )
    db.commit()
    return codes


def count_recovery_codes(db: Session, account: Account) -> int:
    """How many are left."""
    return len(db.scalars(select(SecondFactor.id).where(*_recovery(account))).all())


def remove(db: Session, account: Account, number: int) -> None:
    """Take one out of use; with the last one the recovery codes go, too."""
    found = next((f for f in of_account(db, account) if f.id == number), None)
    if found is None:
        raise InputError("clinic.second_factor_unknown", number=number)
    db.delete(found)
    db.flush()
    if not of_account(db, account):
        db.execute(delete(SecondFactor).where(*_recovery(account)))
    db.commit()


def remove_all(db: Session, account: Account) -> None:
    """For an administrator, where somebody lost all of them."""
    for factor in db.scalars(select(SecondFactor).where(SecondFactor.account_id == account.id)):
        db.delete(factor)
    db.commit()


def _with_first_codes(db: Session, account: Account) -> list[str]:
    db.flush()
    if count_recovery_codes(db, account):
        db.commit()
        return []
    return new_recovery_codes(db, account)


def _matches(db: Session, factor: SecondFactor, code: str) -> bool:
    """Whether an authenticator shows this code now; the step that it belongs to counts as used, by two at once, too."""
    totp = _library("pyotp").TOTP(factor.secret)
    typed, step = "".join(code.split()), totp.timecode(now())
    for candidate in range(step - TOLERANCE, step + TOLERANCE + 1):
        if secrets.compare_digest(totp.generate_otp(candidate).encode(), typed.encode()):
            unused = update(SecondFactor).where(
                SecondFactor.id == factor.id, SecondFactor.counter < candidate
            )
            return bool(getattr(db.execute(unused.values(counter=candidate)), "rowcount", 0))
    return False


def _recovery(account: Account) -> tuple[Any, ...]:
    return SecondFactor.account_id == account.id, SecondFactor.kind == RECOVERY


def _forget_unconfirmed(db: Session, account: Account) -> None:
    db.execute(
        delete(SecondFactor).where(
            SecondFactor.account_id == account.id, SecondFactor.confirmed.is_(False)
        )
    )


def _require_room(db: Session, account: Account) -> None:
    if not may_have_one(account):
        raise InputError(NONE_HERE)
    if len(of_account(db, account)) >= MOST:
        raise InputError("clinic.too_many_second_factors", count=MOST)


def _checked_name(name: str) -> str:
    name = " ".join(name.split())
    require_plain(name, "the name", one_line=True)
    if not 1 <= len(name) <= LONGEST_NAME:
        raise InputError("clinic.second_factor_name_length", longest=LONGEST_NAME)
    return name


def _random_code() -> str:
    """120 random bits, so that a plain hash of it may be stored (OWASP ASVS 5, 6.5.2)."""
    text = base64.b32encode(secrets.token_bytes(15)).decode().lower()
    return "-".join(text[k : k + 4] for k in range(0, len(text), 4))


def _hash(code: str) -> str:
    plain = "".join(code.lower().replace("-", "").split())
    return hashlib.sha256(plain.encode()).hexdigest()


def _library(name: str) -> Any:
    try:
        return __import__(name)
    except ImportError:
        raise InputError(MISSING) from None


def describe(factors: Sequence[SecondFactor]) -> list[dict[str, Any]]:
    """What a page shows of them."""
    return [
        {"id": f.id, "kind": f.kind, "name": f.name, "created": f.created, "used": f.used}
        for f in factors
    ]
