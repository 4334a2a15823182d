"""Logins: one-time tokens and passwords make them, cookies carry them, they end after a while without a request and after a longest time.

A token is a file named after its hash in the data folder, with the name of its account: whoever may write there (the same user of the machine)
may let a browser in. Tries are counted (sessions/login/throttle.py) by account and address together and by address; nobody shuts an account's owner out from elsewhere. Tokens (192 random bits) and cookies (256) are kept as their SHA-256 alone.
"""

import hashlib
import secrets
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from datetime import datetime, timedelta
from pathlib import Path

from sqlalchemy import delete, select, update
from sqlalchemy.exc import DBAPIError
from sqlalchemy.orm import Session

from handscope.sessions.clinic import accounts, audit
from handscope.sessions.clinic.accounts import LOCAL
from handscope.sessions.clinic.audit import AuditEvent
from handscope.sessions.db.tables import Account, AuditLine, Login, now
from handscope.sessions.login import throttle
from handscope.sessions.store.database import hurry
from handscope.sessions.store.store import Store

TOKEN_LIFE = timedelta(minutes=15)
TOUCH_EVERY = timedelta(minutes=1)
TOUCH_WAIT = 0.1  # s
MOST, MOST_OF_ADDRESS = 5, 20  # tries that fail: of an account from an address, of the address
MOST_ELSEWHERE = 100  # of an account from addresses where it has never logged in
# numbers of tries in a window that are recorded in the audit trail
REPORTED = 1, 2, 3, 4, 5, 20, 100, 500


def new_token(data: Path, account: str = LOCAL) -> str:
    """A one-time token of an account for a server on this data folder."""
    token = secrets.token_urlsafe(24)
    folder = data / "tokens"
    folder.mkdir(mode=0o700, exist_ok=True)
    path = folder / _hash(token)
    path.touch(mode=0o600)
    path.write_text(account, "utf-8")
    return token


def redeem(db: Session, store: Store, token: str) -> Account | None:
    """The account of a one-time token, once; None where it is unknown, used or old, or the account is not in use."""
    path = store.folder / "tokens" / _hash(token)
    try:
        made, name = path.stat().st_mtime, path.read_text("utf-8")
        path.unlink()
    except OSError:
        return None
    if now().timestamp() - made > TOKEN_LIFE.total_seconds():
        return None
    account = (
        accounts.local_account(db)
        if name in ("", LOCAL)
        else db.scalar(select(Account).where(Account.name == name))
    )
    return account if account is not None and not account.disabled else None


def begin(db: Session, account: Account, before: str | None = None) -> str:
    """The cookie of a new login; the login that the same browser had `before` ends."""
    end(db, before)
    cookie = secrets.token_urlsafe(32)
    audit.set_actor(db, account.name, db.info.get("address", ""))
    audit.record(db, AuditEvent("logged in", "account", str(account.id)))
    db.add(Login(token_hash=_hash(cookie), account_id=account.id))
    db.commit()
    return cookie


def find_login(db: Session, cookie: str | None, idle: float, longest: float) -> Login | None:
    """The login that a cookie belongs to, kept alive; one that ended (`idle` s without a request, `longest` s altogether) is forgotten."""
    if not cookie:
        return None
    login = db.scalar(select(Login).where(Login.token_hash == _hash(cookie)))
    if login is None:
        return None
    moment = now()
    if (
        moment - login.seen > timedelta(seconds=idle)
        or moment - login.created > timedelta(seconds=longest)
        or login.account.disabled
    ):
        db.delete(login)
        db.commit()
        return None
    if moment - login.seen > TOUCH_EVERY:
        _touch(db, login.id, moment)
    return login


def _touch(db: Session, login_id: int, moment: datetime) -> None:
    """Keep a login alive. Where the database takes nothing now, a full disk or a lock, nobody is locked out: the next request tries again."""
    try:
        hurry(db, TOUCH_WAIT)
        db.execute(update(Login).where(Login.id == login_id).values(seen=moment))
        db.commit()
    except DBAPIError:
        db.rollback()


def end(db: Session, cookie: str | None) -> Account | None:
    """End a login; gives whose it was."""
    login = db.scalar(select(Login).where(Login.token_hash == _hash(cookie))) if cookie else None
    if login is None:
        return None
    account = login.account
    audit.set_actor(db, account.name, db.info.get("address", ""))
    audit.record(db, AuditEvent("logged out", "account", str(account.id)))
    db.delete(login)
    db.commit()
    return account


def end_all(db: Session, account: Account, but: str | None = None) -> None:
    """End all logins of an account, but that of a cookie."""
    db.execute(
        delete(Login).where(Login.account_id == account.id, Login.token_hash != _hash(but or ""))
    )
    db.commit()


def log_in(db: Session, name: str, password: str, address: str) -> Account | None:
    """The account that proves itself, None where it does not; ThrottledError after too many tries."""
    limits = [
        throttle.Limit(_hash(f"account {_plain(name)} from {throttle.network(address)}"), MOST),
        throttle.Limit(_hash(f"address {throttle.network(address)}"), MOST_OF_ADDRESS),
    ]
    if not _has_logged_in(db, name, address):  # nobody elsewhere may shut out who is known here
        limits.append(throttle.Limit(_hash(f"account {_plain(name)}"), MOST_ELSEWHERE))
    tried = throttle.count(db, limits)
    account = accounts.authenticate(db, name, password)
    if account is not None:  # who is in clears these tries; the address keeps its others
        throttle.forget(db, tried, limits[0])
    elif (tries := throttle.tries(db, limits[0])) in REPORTED:
        audit.record(db, _failure_event(db, name, tries))
    db.commit()
    return account


def log_in_by_code(db: Session, store: Store, token: str, address: str) -> Account | None:
    """The account of a one-time code; None where it is not right, ThrottledError after too many that were not.

    A right code always lets in: its 192 bits are not guessed, and others behind the same address shut nobody out.
    """
    account = redeem(db, store, token)
    if account is not None:
        return account
    limit = throttle.Limit(_hash(f"codes from {throttle.network(address)}"), MOST_OF_ADDRESS)
    throttle.count(db, [limit])
    if (tries := throttle.tries(db, limit)) in REPORTED:
        audit.record(db, AuditEvent("refused", "login", counts={"by": "code", "tries": tries}))
        db.commit()
    return None


@contextmanager
def counting_second(db: Session, account: Account, address: str) -> Iterator[Callable[[], None]]:
    """Count a try of a second factor; ThrottledError after too many. What is given says that it was right.

    Only who proved the first factor gets here, so that counting by the account lets nobody else shut its owner out.
    """
    limit = throttle.Limit(_hash(f"second factor of {account.id}"), MOST)
    numbers, right = throttle.count(db, [limit]), list[bool]()
    try:
        yield lambda: right.append(True)
    finally:
        if right:
            throttle.forget(db, numbers, limit)
        else:
            db.rollback()
            if (tries := throttle.tries(db, limit)) in REPORTED:
                counts = {"by": "second factor", "tries": tries}
                audit.set_actor(db, account.name, address)
                audit.record(db, AuditEvent("refused", "login", str(account.id), counts=counts))
        db.commit()


def _has_logged_in(db: Session, name: str, address: str) -> bool:
    """Whether the account has logged in from this address before, by the audit trail."""
    query = select(AuditLine.id).where(
        AuditLine.who == _plain(name),
        AuditLine.what == "logged in",
        AuditLine.address == address,
    )
    return db.scalar(query.limit(1)) is not None


def _failure_event(db: Session, name: str, tries: int) -> AuditEvent:
    """A name that no account has is not kept: it may be a password typed in the wrong place."""
    known = db.scalar(select(Account.id).where(Account.name == _plain(name)))
    counts = {"by": "password", "tries": tries}
    return AuditEvent("refused", "login", str(known or ""), counts=counts)


def _plain(name: str) -> str:
    """Of unknown names, too; kept as a hash alone, as somebody may have typed a password in its place."""
    return name.strip().casefold()


def _hash(secret: str) -> str:
    return hashlib.sha256(secret.encode()).hexdigest()
