"""Accounts: who may log in, as what, and how a password is kept.

Roles   clinician      patients and everything about them, live and kept
        scientist      the same movements under codes: reads and computes, changes nothing, sees no free text and no year of birth
        administrator  accounts and the audit trail, no patients
An account may have several. LOCAL is the account of whoever may write in the data folder: the one-time codes of this machine log in as it.
Passwords are kept as argon2id hashes with the library's parameters (RFC 9106, 4: 64 MiB, t = 3, p = 4), made anew when those change.
"""

import hashlib
import logging
import math
import re
import threading
from collections.abc import Sequence
from functools import cache

from argon2 import PasswordHasher
from argon2.exceptions import InvalidHashError, VerificationError
from sqlalchemy import func, select
from sqlalchemy.exc import IntegrityError
from sqlalchemy.orm import Session

from handscope.estimators.errors import InputError
from handscope.sessions.db.roles import ADMINISTRATOR, CLINICIAN, ROLES
from handscope.sessions.db.tables import HOUSE, Account, Ward, WardMember

LOCAL = "local"
NAME = re.compile(r"[\w.@+-]{1,64}")
SHORTEST, LONGEST = 12, 256  # characters of a password
LONGEST_SUBJECT = 400  # characters of issuer and subject
DIFFERENT = 5  # characters that a password has at least
MOST_GUESSES = 1e10  # that a password must withstand: "very unguessable" of zxcvbn (Wheeler 2016)
LONGEST_GUESSED = 72  # characters of it that are looked at: longer ones are guessed no sooner
log = logging.getLogger(__name__)
_hasher = PasswordHasher()
# hashes at once: each takes 64 MiB and a tenth of a second
_working = threading.BoundedSemaphore(2)


def local_account(db: Session) -> Account:
    """The account of this machine, made when it is not there; the caller commits."""
    found = db.scalar(select(Account).where(Account.name == LOCAL))
    if found is None:
        found = Account(name=LOCAL, roles=[CLINICIAN, ADMINISTRATOR])
        found.memberships = [WardMember(ward_id=HOUSE)]
        db.add(found)
        db.flush()
    return found


def add(db: Session, name: str, roles: Sequence[str]) -> Account:
    """A new account without a password; InputError where the name is taken or not one, or a role is not known."""
    account = Account(name=_checked_name(name), roles=_checked_roles(roles))
    account.memberships = _first_wards(db)
    db.add(account)
    try:
        db.commit()
    except IntegrityError:
        db.rollback()
        raise InputError("clinic.account_exists", name=name) from None
    return account


def list_accounts(db: Session) -> list[Account]:
    """All accounts by name."""
    return list(db.scalars(select(Account).order_by(Account.name)))


def find_by_name(db: Session, name: str) -> Account:
    """The account; InputError where there is none."""
    found = db.scalar(select(Account).where(Account.name == name.strip().casefold()))
    if found is None:
        raise InputError("clinic.account_unknown_list", name=name)
    return found


def get(db: Session, account_id: int) -> Account:
    """The account; InputError where there is none."""
    found = db.get(Account, account_id)
    if found is None:
        raise InputError("clinic.account_unknown", name=account_id)
    return found


def get_or_add_subject(db: Session, subject: str, name: str, roles: Sequence[str]) -> Account:
    """The account of somebody whom the organisation vouches for, made at the first login; the roles are those of today."""
    found = db.scalar(select(Account).where(Account.subject == subject))
    if found is None:
        name = re.sub(r"[^\w.@+-]", "_", name.strip().casefold())[:50] or "account"
        if name == LOCAL or db.scalar(select(Account.id).where(Account.name == name)):
            name += f"+{hashlib.sha256(subject.encode()).hexdigest()[:8]}"
        found = Account(name=_checked_name(name), roles=_checked_roles(roles), subject=subject)
        found.memberships = _first_wards(db)
        db.add(found)
    if found.disabled:
        raise InputError("clinic.account_disabled", name=found.name)
    if set_facts(found, roles):
        count_change(found)
    try:
        db.commit()
    except (
        IntegrityError
    ):  # the same person's first login in two windows at once, or somebody of the same name
        db.rollback()
        return get_or_add_subject(db, subject, name, roles)
    return found


def change(
    db: Session, account: Account, roles: Sequence[str] | None = None, disabled: bool | None = None
) -> None:
    """Other roles, or in and out of use, whoever changed it meanwhile; they count from the next request on."""
    if set_facts(account, roles, disabled):
        count_change(account)
    db.commit()


def set_facts(
    account: Account, roles: Sequence[str] | None = None, disabled: bool | None = None
) -> bool:
    """The same without a commit and without a new version; whether something differs now."""
    before = account.roles, account.disabled
    if roles is not None:
        account.roles = _checked_roles(roles)
    if disabled is not None:
        account.disabled = disabled
    return before != (account.roles, account.disabled)


def count_change(account: Account) -> None:
    """Another version of what administrators change, from the next flush on."""
    account.version = Account.version + 1


def set_password(db: Session, account: Account, password: str) -> None:
    """Keep a new password; InputError where it is easily guessed."""
    _require_good(password, account.name)
    account.password = _hash_password(password)
    db.commit()


def has_passwords(db: Session) -> bool:
    """Whether anybody can log in by name and password."""
    return bool(
        db.scalar(
            select(func.count(Account.id)).where(
                Account.password.is_not(None), Account.disabled.is_(False)
            )
        )
    )


def authenticate(db: Session, name: str, password: str) -> Account | None:
    """The account that name and password belong to. An unknown name takes as long as a wrong password and gives the same answer."""
    account = db.scalar(select(Account).where(Account.name == name.strip().casefold()))
    stored = account.password if account is not None and not account.disabled else None
    with _working:
        right = _verify(stored or _unknown_hash(), password)
    if account is None or stored is None or not right:
        return None
    if _hasher.check_needs_rehash(stored):
        account.password = _hash_password(password)
        db.commit()
    return account


def _first_wards(db: Session) -> list[WardMember]:
    """A new account belongs to the whole house where there are no wards; else to none until somebody assigns it."""
    wards = db.scalar(select(func.count(Ward.id)))
    return [WardMember(ward_id=HOUSE)] if wards == 1 else []


def _verify(stored: str, password: str) -> bool:
    try:
        return _hasher.verify(stored, password)
    except (VerificationError, InvalidHashError):
        return False


def _hash_password(password: str) -> str:
    with _working:
        return _hasher.hash(password)


@cache
def _unknown_hash() -> str:
    """The hash of a random password, which is not kept."""
    return _hasher.hash(b"\0" * 32)


def _checked_name(name: str) -> str:
    name = name.strip().casefold()
    if not NAME.fullmatch(name):
        raise InputError("clinic.account_name_form")
    return name


def _checked_roles(roles: Sequence[str]) -> list[str]:
    unknown = [role for role in roles if role not in ROLES]
    if unknown:
        raise InputError("clinic.unknown_role", role=unknown[0], roles=", ".join(ROLES))
    if not roles:
        raise InputError("clinic.no_role", roles=", ".join(ROLES))
    return [role for role in ROLES if role in roles]


def _require_good(password: str, name: str) -> None:
    if not SHORTEST <= len(password) <= LONGEST:
        raise InputError("clinic.password_length", least=SHORTEST, most=LONGEST)
    if len(set(password)) < DIFFERENT or name.casefold() in password.casefold():
        raise InputError("clinic.password_easily_guessed")
    if _guesses(password, name) < MOST_GUESSES:
        raise InputError("clinic.password_common")


def _guesses(password: str, name: str) -> float:
    """How many guesses find it (zxcvbn: lists of the commonest passwords, words, dates, patterns of keys)."""
    try:
        from zxcvbn import zxcvbn
    except ImportError:
        log.error("zxcvbn is not installed: passwords are checked by their length alone")
        return math.inf
    return float(zxcvbn(password[:LONGEST_GUESSED], [name, "handscope"])["guesses"])
