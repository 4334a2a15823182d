"""Passwords and logins: what is kept, what is refused, and that many tries are throttled whatever is restarted or done at once."""

from collections.abc import Iterator
from pathlib import Path

import pytest
from argon2 import PasswordHasher

from handscope.estimators.errors import InputError
from handscope.sessions.clinic import accounts
from handscope.sessions.db.tables import Attempt
from handscope.sessions.login import logins
from handscope.sessions.store.store import Store, open_store

GOOD = "seven hands on a table"


@pytest.fixture(scope="module")
def cheap() -> Iterator[None]:
    """Hashes that cost next to nothing."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(
            accounts, "_hasher", PasswordHasher(time_cost=1, memory_cost=8, parallelism=1)
        )
        accounts._unknown_hash.cache_clear()
        yield
    accounts._unknown_hash.cache_clear()


@pytest.fixture(scope="module")
def store(tmp_path_factory: pytest.TempPathFactory, cheap: None) -> Store:
    store = open_store(tmp_path_factory.mktemp("data"))
    with store.database() as db:
        for name in ("anna", "ben"):
            accounts.set_password(db, accounts.add(db, name, ["clinician"]), GOOD)
    return store


@pytest.fixture(autouse=True)
def _forgotten(store: Store, cheap: None) -> None:
    with store.database() as db:
        db.query(Attempt).delete()
        db.commit()


def tried(store: Store, name: str, password: str, address: str = "10.0.0.1") -> str | None:
    with store.database() as db:
        account = logins.log_in(db, name, password, address)
        return account.name if account else None


def test_a_password_is_kept_as_an_argon2id_hash_alone_made_anew_when_its_parameters_are_old(
    store: Store, monkeypatch: pytest.MonkeyPatch
) -> None:
    for name, password in (
        ("anna", GOOD + " "),
        ("anna", ""),
        ("nobody", GOOD),
        ("ben", "seven hands on a Table"),
    ):
        assert tried(store, name, password) is None
    monkeypatch.setattr(accounts, "_hasher", PasswordHasher())
    assert tried(store, " Anna ", GOOD) == "anna"
    with store.database() as db:
        anna, ben = (accounts.find_by_name(db, name).password or "" for name in ("anna", "ben"))
    assert anna.startswith("$argon2id$v=19$m=65536,t=3,p=4$")
    assert ben.startswith("$argon2id$v=19$m=8,t=1,p=1$")
    assert not any(GOOD.encode() in p.read_bytes() for p in store.folder.rglob("*") if p.is_file())


@pytest.mark.parametrize(
    "password", ["short", "x" * 257, "aaaaaaaaaaaaaaaa", "ababababababab", "my name is anna", ""]
)
def test_a_password_that_is_easily_guessed_is_refused(store: Store, password: str) -> None:
    with store.database() as db, pytest.raises(InputError):
        accounts.set_password(db, accounts.find_by_name(db, "anna"), password)
    assert tried(store, "anna", GOOD) == "anna"


def test_a_code_of_an_account_that_is_out_of_use_lets_nobody_in(
    store: Store, tmp_path: Path
) -> None:
    token = logins.new_token(store.folder, "ben")
    with store.database() as db:
        ben = accounts.find_by_name(db, "ben")
        accounts.change(db, ben, disabled=True)
        assert logins.redeem(db, store, token) is None
        assert accounts.authenticate(db, "ben", GOOD) is None
        accounts.change(db, ben, disabled=False)
        for name in ("../anna", "gone", "anna\n"):
            assert logins.redeem(db, store, logins.new_token(store.folder, name)) is None


def test_a_person_whose_first_login_comes_twice_at_once_has_one_account(
    store: Store, monkeypatch: pytest.MonkeyPatch
) -> None:
    name = accounts._checked_name

    def meanwhile(word: str) -> str:
        monkeypatch.setattr(accounts, "_checked_name", name)
        with store.database() as other:
            accounts.get_or_add_subject(other, "issuer 1", "carla", ["clinician"])
        return name(word)

    monkeypatch.setattr(accounts, "_checked_name", meanwhile)
    with store.database() as db:
        second = accounts.get_or_add_subject(db, "issuer 1", "carla", ["scientist"])
        assert second.roles == ["scientist"]
        assert [a.name for a in accounts.list_accounts(db) if a.subject] == ["carla"]
