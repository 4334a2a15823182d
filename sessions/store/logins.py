"""Logins: one-time tokens and passwords make them, cookies carry them, they end after a while without a request and after a longest time.

A token is a file named after its hash in the data folder, with the name of its account: whoever may write there (the same user of the machine)
may let a browser in. Tries of passwords are counted in the database, by account and by address, before they are checked: tries at once count
too, and a restart forgets none. Tokens (192 random bits) and cookies (256) are kept as their SHA-256 alone.
"""

import hashlib
import secrets
from datetime import datetime, timedelta
from pathlib import Path

from sqlalchemy import delete, func, select, update
from sqlalchemy.exc import DBAPIError
from sqlalchemy.orm import Session

from handscope.estimators.errors import InputError
from handscope.sessions.clinic import accounts, audit
from handscope.sessions.clinic.accounts import LOCAL
from handscope.sessions.clinic.audit import AuditEvent
from handscope.sessions.db.tables import Account, Attempt, Login, now
from handscope.sessions.store.database import hurry
from handscope.sessions.store.store import Store

TOKEN_LIFE = timedelta(minutes=15)
TOUCH_EVERY = timedelta(minutes=1)
TOUCH_WAIT = 0.1  # s
WINDOW = timedelta(minutes=15)  # in which tries are counted
MOST_OF_ACCOUNT, MOST_OF_ADDRESS = 5, 20  # tries that fail within it


class ThrottledError(InputError):
    """Too many tries; `wait` s until the next one is taken."""

    def __init__(self, wait: float) -> None:
        super().__init__(
            "too many logins failed for this account or from this address; wait a quarter of an hour and try again"
        )
        self.wait = wait


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


def begin(db: Session, account: Account) -> str:
    """The cookie of a new login."""
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
    login = db.scalar(select(Login).where(Login.token_hash == _hash(cookie or "")))
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
    """The account that proves itself, None where it does not; ThrottledError after too many tries of the account or from the address."""
    tried = _counted(db, name, address)
    account = accounts.authenticate(db, name, password)
    if account is not None:  # who is in clears the account; the address keeps its other tries
        db.execute(
            delete(Attempt).where(Attempt.key.in_([_of_account(name)]) | Attempt.id.in_(tried))
        )
    else:
        audit.record(db, _failed(db, name))
    db.commit()
    return account


def _counted(db: Session, name: str, address: str) -> list[int]:
    """Count a try before it is checked."""
    moment = now()
    db.execute(delete(Attempt).where(Attempt.at < moment - WINDOW))
    made = [Attempt(key=key, at=moment) for key in (_of_account(name), _hash(f"address {address}"))]
    db.add_all(made)
    db.commit()
    for attempt, most in zip(made, (MOST_OF_ACCOUNT, MOST_OF_ADDRESS)):
        count, oldest = db.execute(
            select(func.count(Attempt.id), func.min(Attempt.at)).where(Attempt.key == attempt.key)
        ).one()
        if count > most:
            db.execute(
                delete(Attempt).where(Attempt.id.in_([a.id for a in made]))
            )  # what is turned away makes nobody wait longer
            db.commit()
            raise ThrottledError(_until(oldest, moment))
    return [a.id for a in made]


def _failed(db: Session, name: str) -> AuditEvent:
    """A name that no account has is not kept: it may be a password typed in the wrong place."""
    known = db.scalar(select(Account.id).where(Account.name == name.strip().casefold()))
    return AuditEvent("refused", "login", str(known or ""), counts={"by": "password"})


def _until(oldest: datetime, moment: datetime) -> float:
    return max(1.0, (oldest + WINDOW - moment).total_seconds())


def _of_account(name: str) -> str:
    """Of unknown names, too; a hash, as somebody may have typed a password in its place."""
    return _hash(f"account {name.strip().casefold()}")


def _hash(secret: str) -> str:
    return hashlib.sha256(secret.encode()).hexdigest()
