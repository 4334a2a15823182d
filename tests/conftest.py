"""Shared by all tests: one thread for linear algebra, how hypothesis draws its examples, recordings that several tests read."""

import gc
import logging
import os
import time
from collections.abc import Iterator
from contextlib import ExitStack

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
os.environ["TZ"] = "UTC"  # hours are written as the clocks of a machine show them

import numpy as np
import pytest
from hypothesis import HealthCheck, Phase, settings
from playwright.sync_api import Browser, sync_playwright
from xdist.remote import Producer

from handscope.app.workers.garbage import GARBAGE
from handscope.app.workers.process import CONTEXT
from handscope.estimators.simulation.scenario import Simulated
from tests import fork_server, schedule
from tests.browser import chromium
from tests.durations import TESTS
from tests.sessions import new_databases
from tests.simulated import pose_and_wiggle

BROWSERS: list[Browser] = []  # the one that is open
OPENED = ExitStack()  # of it and its tool

time.tzset()
gc.set_threshold(
    *GARBAGE
)  # as in every command; with Python's own a tenth of the time is the collector's
settings.register_profile(
    "handscope",
    max_examples=25,
    deadline=None,
    derandomize=True,
    database=None,
    phases=[Phase.explicit, Phase.generate, Phase.shrink],
    suppress_health_check=[HealthCheck.too_slow, HealthCheck.data_too_large],
)
settings.register_profile(
    "thorough", parent=settings.get_profile("handscope"), max_examples=1000, derandomize=False
)
settings.load_profile(os.environ.get("HYPOTHESIS_PROFILE", "handscope"))
CONTEXT.set_forkserver_preload(
    ["handscope.app.preload", "handscope.app.serving", "handscope.app.commands.glove"]
)  # tests fork these, too
fork_server.take()


@pytest.hookimpl(optionalhook=True)  # where the tests run in several processes
def pytest_xdist_setupnodes() -> None:
    fork_server.offer()


@pytest.hookimpl(optionalhook=True)
def pytest_xdist_make_scheduler(config: pytest.Config, log: Producer) -> schedule.Schedule:
    return schedule.Schedule(config, log)


@pytest.hookimpl(wrapper=True)
def pytest_collection() -> Iterator[None]:
    """Modules and tests live until the end: the garbage collector leaves them out, during the collection and after it."""
    gc.disable()
    try:
        return (yield)
    finally:
        gc.enable()
        gc.freeze()


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """The order of the schedule; whoever takes a browser, starts a program or takes long is marked so."""
    schedule.order(items)
    long = set(TESTS.read_text().splitlines())
    for item in items:
        if "browser" in getattr(item, "fixturenames", ()):
            item.add_marker("browser")
        if item.nodeid in long:
            item.add_marker("long")
        if {"virtual_glove", "subprocess"} & vars(item.module).keys():  # type: ignore[attr-defined]
            item.add_marker("process")


@pytest.fixture(scope="session", autouse=True)
def new_databases_are_copies(tmp_path_factory: pytest.TempPathFactory) -> Iterator[None]:
    with pytest.MonkeyPatch.context() as patch:
        new_databases.use(patch, tmp_path_factory.mktemp("migrated"))
        yield


@pytest.fixture(scope="module")
def browser() -> Browser:
    """A real Chromium, the same one for modules of tests in a browser that follow one another."""
    if not BROWSERS:
        tool = OPENED.enter_context(sync_playwright())
        started = tool.chromium.launch(executable_path=chromium(), args=["--no-sandbox"])
        OPENED.callback(started.close)
        BROWSERS.append(started)
    return BROWSERS[0]


@pytest.hookimpl(wrapper=True)
def pytest_runtest_teardown(item: pytest.Item, nextitem: pytest.Item | None) -> Iterator[None]:
    """The browser is closed behind the last module: the tool's event loop would be in the way of tests with one of their own."""
    try:
        return (yield)
    finally:
        if BROWSERS and not schedule.shares_browser(item, nextitem):
            BROWSERS.clear()
            OPENED.close()


@pytest.fixture(scope="module", autouse=True)
def forgotten(request: pytest.FixtureRequest) -> Iterator[None]:
    """What the functions of a test module have kept is given back after its tests: recordings are large, and a worker runs all modules."""
    yield
    for made in vars(request.module).values():
        if hasattr(made, "cache_clear") and made.__module__ == request.module.__name__:
            made.cache_clear()


@pytest.fixture(scope="module", autouse=True)
def logged_as_before() -> Iterator[None]:
    """A command that sends the log to standard error does so for its own module only: the stream is the test's and closes with it."""
    root = logging.getLogger()
    handlers, level = root.handlers[:], root.level
    yield
    root.handlers[:], root.level = handlers, level


@pytest.fixture
def rng() -> np.random.Generator:
    return np.random.default_rng(20250726)


@pytest.fixture(scope="session", params=["left", "right"])
def simulated(request: pytest.FixtureRequest) -> Simulated:
    """A hand in the initial pose, then one finger after the other bends; ideal sensors, the forearm's in a stream of its own."""
    return pose_and_wiggle(request.param)
