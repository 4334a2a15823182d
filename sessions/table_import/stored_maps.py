"""Maps of the columns of other loggers' tables, kept by the tables' headers and offered again with the next one.

Hand and lengths are a patient's and are left out.
"""

from collections.abc import Mapping
from typing import Any

from sqlalchemy import select
from sqlalchemy.orm import Session

from handscope.sessions.db.tables import StoredColumnMap, now

OF_A_PATIENT = ("hand", "geometry")


def find(db: Session, key: str) -> StoredColumnMap | None:
    """The map that was last used for a table with this header, by preview.header_key."""
    return db.scalars(select(StoredColumnMap).where(StoredColumnMap.key == key)).one_or_none()


def store(db: Session, key: str, columns: Mapping[str, Any]) -> StoredColumnMap:
    """Keep a map, as MAP.json has it, in place of the last one; the caller commits."""
    data = {name: value for name, value in columns.items() if name not in OF_A_PATIENT}
    found = find(db, key)
    if found is None:
        found = StoredColumnMap(key=key, data={})
        db.add(found)
    if found.data != data:
        found.data, found.changed = data, now()
    return found
