"""What an administrator changes of an account: roles, wards, in and out of use; all of it or nothing.

Of two administrators who change one account at once the second gets a ConflictError, and the change is not stored.
"""

from collections.abc import Collection
from dataclasses import dataclass

from sqlalchemy.orm import Session

from handscope.estimators.messages.sentence import phrase
from handscope.sessions.clinic import accounts
from handscope.sessions.db.conflicts import claim_version
from handscope.sessions.db.tables import Account
from handscope.sessions.wards import wards


@dataclass(frozen=True, kw_only=True)
class AccountChange:
    """None: stays as it is."""

    roles: Collection[str] | None = None
    disabled: bool | None = None
    wards: Collection[int] | None = None
    heads: Collection[int] | None = None  # wards among these that the account heads


def change(db: Session, account: Account, version: int, to: AccountChange) -> None:
    """Change an account as it stood at `version`; ConflictError where somebody else changed it meanwhile."""
    claim_version(db, account, version, phrase("conflict.account", name=account.name))
    if to.wards is not None or to.heads is not None:
        wards.place(
            db,
            account,
            wards.wards_of(account) if to.wards is None else to.wards,
            wards.headed_by(account) if to.heads is None else to.heads,
        )
    accounts.set_facts(account, None if to.roles is None else list(to.roles), to.disabled)
    db.commit()
