"""Poses for other programs: whoever holds the token gets them, and nobody who does not read holds back anybody."""

import socket
import threading
import time
from collections.abc import Iterator
from contextlib import closing
from dataclasses import dataclass
from itertools import islice
from pathlib import Path

import httpx2 as httpx
import pytest
import uvicorn

import handscope
from handscope.app.api.live import streams
from handscope.app.auth.gate import new_token
from handscope.app.live.outputs.permits import FASTEST, MOST_CLIENTS, MOST_STREAMS, Permits
from handscope.app.live.outputs.pose_message import Pose, to_json
from handscope.app.live.station import Station
from handscope.app.live.stations import Stations
from handscope.app.server import create_app
from handscope.app.settings import Settings
from handscope.app.state import Parts
from handscope.estimators.errors import InputError
from handscope.sessions.store.store import open_store
from tests.app.live.outputs.posing import poses, station

INTERVAL = 0.01  # s between two poses
WAIT = 20.0  # s until a test gives up


@dataclass
class Served:
    """A server with one live station whose tracker moves the hand."""

    url: str
    client: httpx.Client
    station: Station
    permits: Permits
    slowest: float = 0.0  # s that the tracker was held back by one pose

    def new_stream(self, **options: float) -> dict[str, str]:
        answer = self.client.post("/api/stations/test/streams", json=options)
        assert answer.status_code == 201, answer.text
        return dict(answer.json())

    def clients(self) -> list[int]:
        return [s["clients"] for s in self.client.get("/api/stations/test/streams").json()]


@pytest.fixture(scope="module")
def running(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Served]:
    folder = tmp_path_factory.mktemp("served")
    settings = Settings(data=folder / "data")
    app = create_app(settings)
    # without the application's lifespan: its working processes take seconds to come and go
    stations = Stations(lambda station: None)
    with (
        closing(open_store(settings.data)) as store,
        socket.create_server(("127.0.0.1", 0)) as listener,
        pytest.MonkeyPatch.context() as patch,
    ):
        patch.setattr(streams, "SEND_WAIT", 0.3)
        app.state.parts = Parts(settings, store, None, None, stations, None, None, None)  # type: ignore[arg-type]
        url = f"http://127.0.0.1:{listener.getsockname()[1]}"
        server = uvicorn.Server(
            uvicorn.Config(app, log_level="critical", ws="websockets-sansio", lifespan="off")
        )
        thread = threading.Thread(target=server.run, kwargs={"sockets": [listener]})
        thread.start()
        eventually(lambda: server.started)
        with httpx.Client(base_url=url, trust_env=False) as client:
            client.post("/api/login", json={"token": new_token(folder / "data")})
            made = station(folder)
            patch.setattr(made._drawing, "draw_hand_if_due", lambda interval: None)
            stations._stations["test"] = made
            served = Served(url, client, made, app.state.parts.permits)
            stop = threading.Event()
            tracker = threading.Thread(target=track, args=(served, stop))
            tracker.start()
            yield served
            stop.set()
            tracker.join(WAIT)
            stations._stations.clear()
        server.should_exit = True
        thread.join(WAIT)


@pytest.fixture
def served(running: Served) -> Iterator[Served]:
    yield running
    running.permits.withdraw("test")


def track(served: Served, stop: threading.Event) -> None:
    """Give poses as the tracker's thread does, and remember what that took."""
    began = time.monotonic()
    while not stop.wait(INTERVAL):
        now = time.monotonic()
        served.station._take_pose(poses(now - began))
        served.slowest = max(served.slowest, time.monotonic() - now)


def eventually(condition: object) -> None:
    until = time.monotonic() + WAIT
    while not condition():  # type: ignore[operator]
        assert time.monotonic() < until
        threading.Event().wait(0.01)


def test_five_lines_of_python_read_the_poses(served: Served) -> None:
    token = served.new_stream()["token"]
    read = list(islice(handscope.stream(served.url, token), 3))
    assert read[0].t < read[1].t < read[2].t
    assert read[0].hand == "left" and read[0].angles == {"index_pip_flexion": 0.5}
    assert read[0].tips == {"index": [0.01, 0.18, -0.02]}
    assert read[0].orientations == {"hand": [1.0, 0.0, 0.0, 0.0]}
    assert read[0].flags == {"index_middle": ["doubtful"]}


def test_no_more_poses_come_than_the_rate_that_was_asked_for(served: Served) -> None:
    token, began = served.new_stream(rate=20.0)["token"], time.monotonic()
    list(islice(handscope.stream(served.url, token, every=True), 11))
    assert time.monotonic() - began >= 10 / 20.0


def test_a_program_waits_no_longer_for_a_pose_than_it_says(
    served: Served, monkeypatch: pytest.MonkeyPatch
) -> None:
    token = served.new_stream()["token"]
    monkeypatch.setattr(served.station, "_take_pose", lambda pose: None)  # as before calibration
    with pytest.raises(InputError, match=r"no pose came from .* within 0\.3 s"):
        list(handscope.stream(served.url, token, timeout=0.3))


@pytest.mark.parametrize("token", ["", "wrong", "a" * 43])
def test_nobody_reads_without_the_token(served: Served, token: str) -> None:
    served.new_stream()
    with pytest.raises(InputError, match="refused the token"):
        next(handscope.stream(served.url, token))


def test_a_stream_that_was_ended_ends_the_loop_and_its_token_opens_nothing(served: Served) -> None:
    made = served.new_stream()
    reading = handscope.stream(served.url, made["token"])
    next(reading)
    served.client.delete(f"/api/stations/test/streams/{made['stream']}")
    assert len(list(reading)) < 1000  # it ends
    with pytest.raises(InputError, match="refused the token"):
        next(handscope.stream(served.url, made["token"]))


def test_a_client_that_never_reads_holds_back_neither_tracker_nor_others_and_is_let_go(
    served: Served, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(
        streams.pose_message, "to_json", long_message
    )  # the network's buffers hold megabytes
    fast, other = served.new_stream(rate=FASTEST), served.new_stream(rate=FASTEST)
    served.slowest = 0.0
    with deaf(served.url, fast["token"]):
        eventually(lambda: served.clients()[0] == 1)
        read = [pose.t for pose in islice(handscope.stream(served.url, other["token"]), 100)]
        assert max(b - a for a, b in zip(read, read[1:])) < 0.5
        eventually(lambda: served.clients()[0] == 0)
    assert served.slowest < 0.25  # s; of a thread that waits for nobody


def long_message(pose: Pose) -> bytes:
    return to_json(pose)[:-1] + b',"padding":"' + b"x" * 100_000 + b'"}'


def deaf(url: str, token: str) -> socket.socket:
    """A client that opens the stream and never reads."""
    host, port = url.removeprefix("http://").split(":")
    opened = socket.socket()
    opened.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 2048)
    opened.connect((host, int(port)))
    opened.sendall(
        f"GET /api/stream HTTP/1.1\r\nHost: {host}:{port}\r\nOrigin: {url}\r\nAuthorization: Bearer {token}\r\n"
        "Upgrade: websocket\r\nConnection: Upgrade\r\nSec-WebSocket-Version: 13\r\n"
        "Sec-WebSocket-Key: dGhlIHNhbXBsZSBub25jZQ==\r\n\r\n".encode()
    )
    return opened


def test_streams_of_a_session_and_clients_of_a_stream_are_bounded(served: Served) -> None:
    token = served.new_stream()["token"]
    for _ in range(MOST_STREAMS - 1):
        served.new_stream()
    more = served.client.post("/api/stations/test/streams", json={})
    assert more.status_code == 422 and "end one of them first" in more.text
    reading = [handscope.stream(served.url, token) for _ in range(MOST_CLIENTS)]
    for one in reading:
        next(one)
    with pytest.raises(InputError, match="enough clients"):
        next(handscope.stream(served.url, token))
    for one in reading:
        one.close()  # type: ignore[attr-defined]


@pytest.mark.parametrize("rate", [0.0, -1.0, 121.0])
def test_a_rate_out_of_bounds_is_refused(served: Served, rate: float) -> None:
    answer = served.client.post("/api/stations/test/streams", json={"rate": rate})
    assert answer.status_code == 422 and "choose 1 to 120" in answer.text


@pytest.mark.parametrize("url", ["nonsense", "ftp://127.0.0.1", "http://"])
def test_what_is_no_address_is_refused_in_words(url: str) -> None:
    with pytest.raises(InputError, match="is no address of a server"):
        next(handscope.stream(url, "token"))


def test_a_server_that_does_not_answer_is_named(tmp_path: Path) -> None:
    with socket.socket() as unused:
        unused.bind(("127.0.0.1", 0))
        url = f"http://127.0.0.1:{unused.getsockname()[1]}"
        with pytest.raises(InputError, match="no stream at"):
            next(handscope.stream(url, "token"))
