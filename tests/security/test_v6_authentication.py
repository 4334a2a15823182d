"""ASVS 5, 6.2, 6.3 and 7.2: guessed passwords, tries without end, and what a new login ends."""

from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from datetime import datetime, timedelta

import pytest
from argon2 import PasswordHasher

from handscope.estimators.errors import InputError
from handscope.sessions.clinic import accounts
from handscope.sessions.db.tables import AuditLine, Login, now
from handscope.sessions.login import logins, throttle
from handscope.sessions.login.logins import MOST, MOST_OF_ADDRESS, REPORTED
from handscope.sessions.login.throttle import LONGEST_WAIT, WINDOW, ThrottledError
from handscope.sessions.store.store import Store, open_store

GOOD = "seven hands on a table"


class Clock:
    """Time as the test sets it."""

    def __init__(self) -> None:
        self.moment = now()

    def __call__(self) -> datetime:
        return self.moment

    def advance(self, seconds: float) -> None:
        self.moment += timedelta(seconds=seconds)


@pytest.fixture
def clock(monkeypatch: pytest.MonkeyPatch) -> Clock:
    clock = Clock()
    monkeypatch.setattr(throttle, "now", clock)
    return clock


@pytest.fixture
def store(
    tmp_path_factory: pytest.TempPathFactory, monkeypatch: pytest.MonkeyPatch
) -> Iterator[Store]:
    cheap = PasswordHasher(time_cost=1, memory_cost=8, parallelism=1)
    monkeypatch.setattr(accounts, "_hasher", cheap)
    accounts._unknown_hash.cache_clear()
    store = open_store(tmp_path_factory.mktemp("data"))
    with store.database() as db:
        for name in ("anna", "ben"):
            accounts.set_password(db, accounts.add(db, name, ["clinician"]), GOOD)
    yield store
    store.close()
    accounts._unknown_hash.cache_clear()


def _try(store: Store, name: str, password: str, address: str = "10.0.0.1") -> str:
    with store.database() as db:
        db.info["address"] = address
        try:
            account = logins.log_in(db, name, password, address)
        except ThrottledError:
            return "wait"
        if account is None:
            return "wrong"
        logins.begin(db, account)
        return "in"


@pytest.mark.parametrize("password", ["password1234", "qwertzuiop12", "letmeinletmein", "Iloveyou12345", "anna1988anna", "Handscope2024!"])  # fmt: skip
def test_passwords_of_the_commonest_lists_are_refused(store: Store, password: str) -> None:
    pytest.importorskip("zxcvbn")
    with store.database() as db, pytest.raises(InputError):
        accounts.set_password(db, accounts.find_by_name(db, "anna"), password)


def test_nobody_locks_an_account_from_elsewhere(store: Store, clock: Clock) -> None:
    assert _try(store, "anna", GOOD, "10.0.0.9") == "in"
    for k in range(60):
        for _ in range(3):
            _try(store, "anna", "wrong", f"10.0.1.{k}")
    assert _try(store, "anna", "wrong", "10.0.2.1") == "wait", "addresses where she never was"
    assert _try(store, "anna", GOOD, "10.0.0.9") == "in"


def test_after_five_tries_each_next_one_waits_longer_and_a_restart_forgets_none(
    store: Store, clock: Clock
) -> None:
    assert [_try(store, "anna", "wrong") for _ in range(MOST + 1)] == ["wrong"] * MOST + ["wait"]
    assert _try(open_store(store.folder), "anna", GOOD) == "wait"
    clock.advance(2.1)
    assert _try(store, "anna", "wrong") == "wrong"
    clock.advance(2.1)
    assert _try(store, "anna", GOOD) == "wait", "four seconds now"
    clock.advance(2.1)
    assert _try(store, "anna", GOOD) == "in", "no lock: the owner waits for seconds"
    assert _try(store, "anna", "wrong") == "wrong", "who is in begins anew"


def test_the_tries_of_a_quarter_of_an_hour_are_bounded(store: Store, clock: Clock) -> None:
    outcomes = []
    for _ in range(int(WINDOW.total_seconds() / 5)):
        outcomes.append(_try(store, "anna", "wrong"))
        clock.advance(5.0)
    assert outcomes.count("wrong") < MOST + 7 + WINDOW.total_seconds() / LONGEST_WAIT


def test_an_address_waits_after_twenty_tries_of_any_names(store: Store, clock: Clock) -> None:
    for k in range(MOST_OF_ADDRESS):
        assert _try(store, f"guess{k}", "wrong") == "wrong"
    assert _try(store, "anna", GOOD) == "wait"
    assert _try(store, "anna", GOOD, "10.0.0.2") == "in"


def test_an_ipv6_host_has_one_count_for_all_its_addresses(store: Store, clock: Clock) -> None:
    found = [_try(store, "anna", "wrong", f"2001:db8::{k:x}") for k in range(MOST + 1)]
    assert found[-1] == "wait"


def test_tries_at_once_are_counted_before_any_is_checked(store: Store, clock: Clock) -> None:
    with ThreadPoolExecutor(8) as many:
        outcomes = list(many.map(lambda _: _try(store, "anna", "wrong"), range(12)))
    assert outcomes.count("wrong") <= MOST and set(outcomes) == {"wrong", "wait"}


def test_wrong_codes_by_the_hundred_write_few_lines_and_a_right_one_lets_in(
    store: Store, clock: Clock
) -> None:
    with store.database() as db:
        before = db.query(AuditLine).count()
        waits = 0
        for k in range(300):
            try:
                assert logins.log_in_by_code(db, store, f"wrong{k}", "10.0.0.1") is None
            except ThrottledError:
                waits += 1
        assert db.query(AuditLine).count() - before <= len(REPORTED)
        assert waits > 250
        token = logins.new_token(store.folder, "ben")
        assert logins.log_in_by_code(db, store, token, "10.0.0.1") is not None


def test_a_code_is_right_for_a_quarter_of_an_hour(
    store: Store, monkeypatch: pytest.MonkeyPatch
) -> None:
    late = logins.new_token(store.folder)
    monkeypatch.setattr(logins, "now", lambda: now() + timedelta(minutes=16))
    with store.database() as db:
        assert logins.redeem(db, store, late) is None


def test_a_new_login_ends_the_one_that_the_browser_had(store: Store) -> None:
    with store.database() as db:
        anna = accounts.find_by_name(db, "anna")
        old = logins.begin(db, anna)
        new = logins.begin(db, anna, old)
        assert logins.find_login(db, old, 1e6, 1e6) is None
        assert logins.find_login(db, new, 1e6, 1e6) is not None
        assert db.query(Login).count() == 1
