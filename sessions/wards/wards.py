"""Wards: made and named by administrators; accounts and patients belong to them.

HOUSE is the whole house: every account sees its patients, and its accounts see every patient. A database without other
wards is as it always was. Whoever belongs to no ward sees the patients of the whole house alone.
"""

from collections.abc import Collection

from sqlalchemy import ColumnElement, and_, func, or_, select
from sqlalchemy.exc import IntegrityError
from sqlalchemy.orm import Session

from handscope.estimators.errors import InputError
from handscope.sessions.clinic import accounts, audit
from handscope.sessions.clinic.accounts import LOCAL
from handscope.sessions.db.plain_text import require_plain
from handscope.sessions.db.tables import HOUSE, Account, AuditLine, Patient, Ward, WardMember
from handscope.sessions.db.visible_rows import Visibility, unrestricted, visible_patients
from handscope.sessions.wards import emergency_access

LONGEST = 64  # characters of a name


def list_wards(db: Session) -> list[Ward]:
    """All wards, the whole house first, then by name."""
    return sorted(db.scalars(select(Ward)), key=lambda w: (w.id != HOUSE, w.name.casefold()))


def get(db: Session, ward_id: int) -> Ward:
    """The ward; InputError where there is none."""
    found = db.get(Ward, ward_id)
    if found is None:
        raise InputError("wards.unknown", number=ward_id)
    return found


def find_by_name(db: Session, name: str) -> Ward:
    """The ward; InputError where there is none."""
    found = db.scalar(select(Ward).where(Ward.name == " ".join(name.split())))
    if found is None:
        raise InputError("wards.unknown_name", name=name)
    return found


def add(db: Session, name: str) -> Ward:
    """A new ward, without patients and accounts; InputError where the name is taken or none."""
    ward = Ward(name=_checked_name(name))
    db.add(ward)
    _commit_name(db, ward.name)
    return ward


def rename(db: Session, ward_id: int, name: str) -> Ward:
    """Another name; the whole house keeps its own."""
    ward = _changeable(db, ward_id)
    ward.name = _checked_name(name)
    _commit_name(db, ward.name)
    return ward


def remove(db: Session, ward_id: int) -> None:
    """Remove a ward that no patient belongs to any more; its accounts leave it."""
    ward = _changeable(db, ward_id)
    with unrestricted(db):
        patients = db.scalar(select(func.count(Patient.id)).where(Patient.ward_id == ward.id))
    if patients:
        raise InputError("wards.has_patients", name=ward.name, count=patients)
    for member in db.scalars(select(WardMember).where(WardMember.ward_id == ward.id)):
        db.delete(member)
    db.delete(ward)
    db.commit()


def assign(
    db: Session, account: Account, wards: Collection[int], heads: Collection[int] = ()
) -> None:
    """Let an account belong to these wards and no others, and head some of them; it counts from the next request on."""
    place(db, account, wards, heads)
    accounts.count_change(account)
    db.commit()


def place(db: Session, account: Account, wards: Collection[int], heads: Collection[int]) -> None:
    """The same without a commit, for a change of the account's version that was seen (account_changes.py)."""
    if account.name == LOCAL and HOUSE not in wards:
        raise InputError("wards.local_account")
    for ward_id in {*wards, *heads}:
        get(db, ward_id)
    account.memberships = [
        WardMember(ward_id=ward_id, head=ward_id in heads) for ward_id in sorted({*wards, *heads})
    ]
    numbers = [m.ward_id for m in account.memberships]
    counts = {"fields": ["wards"], "wards": numbers, "heads": sorted(heads)}
    audit.record(db, audit.AuditEvent("changed", "account", str(account.id), counts=counts))


def wards_of(account: Account) -> frozenset[int]:
    """Numbers of the wards that an account belongs to."""
    return frozenset(m.ward_id for m in account.memberships)


def headed_by(account: Account) -> frozenset[int]:
    """Numbers of the wards whose head an account is."""
    return frozenset(m.ward_id for m in account.memberships if m.head)


def visibility_of(db: Session, account: Account) -> Visibility | None:
    """Whose patients the account sees now; None: all."""
    wards = wards_of(account)
    if HOUSE in wards:
        return None
    return Visibility(wards, emergency_access.patients_open_to(db, account.id))


def known_accounts(db: Session, visibility: Visibility | None) -> list[Account]:
    """Accounts by name that share a ward with one that sees this much; None: all."""
    return [
        account
        for account in accounts.list_accounts(db)
        if visibility is None or wards_of(account) & visibility.wards
    ]


def audited_within(db: Session, visibility: Visibility | None) -> ColumnElement[bool] | None:
    """What holds of lines of the audit trail that such an account is shown; None: of all.

    Lines about patients of its wards, and lines about no patient by accounts that belong to its wards alone.
    """
    if visibility is None:
        return None
    wards = visibility.wards
    names = [a.name for a in known_accounts(db, visibility) if wards_of(a) <= wards]
    about = AuditLine.patient.in_(visible_patients(Visibility(wards)))
    return or_(about, and_(AuditLine.patient.is_(None), AuditLine.who.in_(names)))


def ward_for_new_patient(db: Session, visibility: Visibility | None, wanted: int | None) -> int:
    """The ward of a patient whom an account makes that sees this much: the wanted one, else the account's first.

    InputError where the wanted one is none of its own. Who belongs to no ward makes patients of the whole house.
    """
    own = [HOUSE] if visibility is None else sorted(visibility.wards) or [HOUSE]
    if wanted is None:
        return own[0]
    if HOUSE not in own and wanted not in own:
        raise InputError("wards.not_own", number=wanted)
    return get(db, wanted).id


def _changeable(db: Session, ward_id: int) -> Ward:
    if ward_id == HOUSE:
        raise InputError("wards.house_stays")
    return get(db, ward_id)


def _checked_name(name: str) -> str:
    require_plain(name, "the name", one_line=True)
    name = " ".join(name.split())
    if not 1 <= len(name) <= LONGEST:
        raise InputError("wards.name_length", most=LONGEST)
    return name


def _commit_name(db: Session, name: str) -> None:
    try:
        db.commit()
    except IntegrityError:
        db.rollback()
        raise InputError("wards.exists", name=name) from None
