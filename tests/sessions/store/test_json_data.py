"""Columns of JSON give sentences back with their message codes, and texts of earlier versions as they are."""

from sqlalchemy import Column, Integer, MetaData, Table, create_engine, select, text

from handscope.estimators.messages.sentence import codes_of, phrase
from handscope.sessions.db.json_data import JsonData


def test_a_stored_reason_keeps_its_code_beside_its_text() -> None:
    rows = Table("rows", MetaData(), Column("id", Integer, primary_key=True), Column("d", JsonData))
    engine = create_engine("sqlite://")
    rows.create(engine)
    reason = phrase("force_flag.slip")
    with engine.begin() as connection:
        connection.execute(rows.insert(), [{"d": [{"grade": "poor", "reason": reason}]}])
        connection.execute(text('insert into rows (d) values (\'[{"reason": "an old text"}]\')'))
        stored = connection.execute(text("select d from rows")).scalars().first()
        assert '"force_flag.slip"' in stored and '"the object slipped"' in stored
        new, old = connection.execute(select(rows.c.d).order_by(rows.c.id)).scalars()
        inside = connection.execute(select(rows.c.d[0]["reason"]).where(rows.c.id == 1)).scalar()
    assert new == [{"grade": "poor", "reason": "the object slipped"}]
    assert codes_of(new[0]["reason"]) == codes_of(inside) == {"force_flag.slip"}
    assert old == [{"reason": "an old text"}]
