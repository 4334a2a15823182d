"""The patient's screen: a code without a login, this session alone, to be looked at and no more."""

import json
from collections.abc import Iterator
from contextlib import closing
from dataclasses import dataclass, replace
from typing import Any

import msgspec
import pytest
from starlette.testclient import TestClient
from starlette.websockets import WebSocketDisconnect

from handscope.app.api.patient_view import screen_access, screen_routes
from handscope.app.api.patient_view.screen_access import COOKIE
from handscope.app.auth.gate import new_token
from handscope.app.live.patient_view.invitations import Invitations
from handscope.app.live.patient_view.screen_state import screen_state
from handscope.app.live.station import Station
from handscope.app.live.stations import Stations
from handscope.app.live.wizard.machine import State
from handscope.app.protocols import load_all
from handscope.app.scene.bridge import CAMERA, is_camera
from handscope.app.server import create_app
from handscope.app.settings import Settings
from handscope.app.state import Parts
from handscope.sessions.clinic import accounts, patients
from handscope.sessions.db.tables import PatientSession
from handscope.sessions.store.store import open_store
from tests.app.live.outputs.posing import poses, station

BASE = "http://127.0.0.1:8420"
ORIGIN = {"Origin": BASE}
SOCKETS = "ws://127.0.0.1:8420"
CODE_OF_PATIENT = "P-SECRET-77"
SHOWN = {
    *("stage", "hand", "mirrored", "flowing", "title", "instruction", "passive", "remaining"),
    *("progress", "still", "pace", "done", "target", "unit", "value"),
}


@dataclass
class Served:
    """A server with a live station; the therapist is logged in, the tablet is not."""

    therapist: TestClient
    tablet: TestClient
    station: Station
    parts: Parts

    def invite(self, language: str = "de") -> dict[str, Any]:
        answer = self.therapist.post("/api/stations/test/screens", json={"language": language})
        assert answer.status_code == 201, answer.text
        return dict(answer.json())

    def open(self, code: str) -> Any:
        return self.tablet.post("/api/patient-view", json={"code": code}, headers=ORIGIN)

    def state(self) -> dict[str, Any]:
        """The first state that the tablet is sent."""
        with self.tablet.websocket_connect(f"{SOCKETS}/api/patient-view/live", headers=ORIGIN) as s:
            return dict(s.receive_json())

    def refused(self, path: str = "/api/patient-view/live") -> int:
        with (
            pytest.raises(WebSocketDisconnect) as closed,
            self.tablet.websocket_connect(SOCKETS + path, headers=ORIGIN) as socket,
        ):
            socket.receive_json()
        return closed.value.code

    def trail(self) -> list[tuple[str, str]]:
        lines = self.therapist.get("/api/audit", params={"patient": 1}).json()
        return [(one["who"], one["what"]) for one in lines if one["kind"] == "screen"][::-1]


@pytest.fixture(scope="module")
def running(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Served]:
    folder = tmp_path_factory.mktemp("screens")
    settings = Settings(data=folder / "data")
    app = create_app(settings)
    stations = Stations(lambda _: None)
    with closing(open_store(settings.data)) as store:
        app.state.parts = Parts(settings, store, None, None, stations, None, None, None)  # type: ignore[arg-type]
        with store.database() as db:
            accounts.add(db, "anna", ["clinician", "administrator"])
            patient = patients.create(db, CODE_OF_PATIENT)
            db.add(PatientSession(patient=patient, hand="left"))
            db.commit()
        made = stations._stations["test"] = station(folder)
        therapist, tablet = (TestClient(app, BASE, follow_redirects=False) for _ in range(2))
        therapist.post("/api/login", json={"token": new_token(settings.data, "anna")})
        yield Served(therapist, tablet, made, app.state.parts)
        stations._stations.clear()


@pytest.fixture
def served(running: Served, monkeypatch: pytest.MonkeyPatch) -> Iterator[Served]:
    monkeypatch.setattr(screen_access, "LOOK", 0.01)
    monkeypatch.setattr(screen_access, "HANDING_OVER", 0.0)
    yield running
    running.parts.screens.withdraw("test")
    running.tablet.cookies.clear()


def test_a_code_shows_the_session_without_a_login_and_without_anything_of_the_record(
    served: Served,
) -> None:
    assert served.refused() == screen_routes.REFUSED
    invited = served.invite()
    assert invited["path"] == f"/patient-view?language=de#{invited['code']}"
    answer = served.open(invited["code"])
    assert (answer.status_code, answer.json()) == (200, {"language": "de"})
    cookie = answer.headers["set-cookie"]
    assert "HttpOnly" in cookie and "SameSite=strict" in cookie and COOKIE in cookie
    task = load_all()["tapping"]
    served.station._wizard = replace(
        served.station._wizard, state=State.TASK_READY, task="tapping", calibrated=True
    )
    served.station._take_pose(poses(1.0))
    state = served.state()
    assert set(state) == SHOWN
    assert (state["stage"], state["hand"]) == ("watch", "left")
    assert state["title"] == "Fingertippen" and state["instruction"] != task.instruction
    assert CODE_OF_PATIENT not in json.dumps(state) and "session" not in json.dumps(state)
    assert served.tablet.get("/patient-view/scene/").status_code == 200


def test_the_cookie_of_a_screen_opens_nothing_else(served: Served) -> None:
    served.open(served.invite()["code"])
    paths = ["/api/patients", "/api/stations", "/api/sessions/1", "/scene/test/", "/api/me"]
    assert [served.tablet.get(path).status_code for path in paths] == [401] * len(paths)
    acted = served.tablet.post("/api/stations/test/actions", json={"action": "start"})
    assert acted.status_code == 401
    listed = served.therapist.get("/api/stations/test/screens").json()
    assert [(s["open"], s["by"], s["language"]) for s in listed] == [(True, "anna", "de")]
    assert "code" not in listed[0]


def test_a_code_is_worth_nothing_a_second_time_and_guesses_are_delayed(served: Served) -> None:
    code = served.invite()["code"]
    assert served.open(code).status_code == 200
    again = served.open(code)
    assert again.status_code == 422 and again.json()["code"] == "api.screen_code_refused"
    answers = [served.open("AAAA-AAAA").status_code for _ in range(screen_routes.MOST_TRIES + 1)]
    assert answers[0] == 422 and answers[-1] == 429
    assert served.open(served.invite()["code"]).status_code == 429, "a right guess waits, too"
    with served.parts.store.database() as db:
        from handscope.sessions.db.tables import Attempt

        db.query(Attempt).delete()
        db.commit()


def test_ending_a_screen_ends_what_it_shows_and_all_of_it_is_audited(served: Served) -> None:
    before = len(served.trail())
    invited = served.invite()
    served.open(invited["code"])
    with served.tablet.websocket_connect(
        f"{SOCKETS}/api/patient-view/live", headers=ORIGIN
    ) as socket:
        socket.receive_json()
        ended = served.therapist.delete(f"/api/stations/test/screens/{invited['screen']}")
        assert ended.status_code == 204
        with pytest.raises(WebSocketDisconnect) as closed:
            all(socket.receive_json() for _ in range(1000))
    assert closed.value.code == screen_routes.GONE
    assert served.refused() == screen_routes.REFUSED
    assert served.refused("/patient-view/scene") in (1008, screen_routes.REFUSED)
    assert served.tablet.get("/patient-view/scene/").status_code == 401
    assert served.trail()[before:] == [("anna", "created"), ("", "viewed"), ("anna", "changed")]


def test_a_screen_whose_page_went_before_it_ended_is_no_error(
    served: Served, monkeypatch: pytest.MonkeyPatch
) -> None:
    async def unheard(*_: object) -> None:
        raise WebSocketDisconnect(1006)

    invited = served.invite()
    served.open(invited["code"])
    with served.tablet.websocket_connect(
        f"{SOCKETS}/api/patient-view/live", headers=ORIGIN
    ) as socket:
        socket.receive_json()
        monkeypatch.setattr(screen_routes.WebSocket, "close", unheard)
        served.therapist.delete(f"/api/stations/test/screens/{invited['screen']}")


def test_a_screen_ends_with_what_its_account_may_see(served: Served) -> None:
    served.open(served.invite()["code"])
    with served.parts.store.database() as db:
        account = accounts.find_by_name(db, "anna")
        screen = served.parts.screens.list_of("test")[0]
        assert screen_access.is_granted(served.parts, screen)
        accounts.change(db, account, disabled=True)
        assert not screen_access.is_granted(served.parts, screen)
        assert served.refused() == screen_routes.REFUSED
        accounts.change(db, account, disabled=False)


def test_a_screen_passes_on_its_camera_and_nothing_else() -> None:
    pack = msgspec.msgpack.encode
    assert is_camera(pack({"type": CAMERA, "fov": 1.0}))
    others = [pack({"type": "SceneNodeClickMessage"}), pack([CAMERA]), pack(CAMERA), b"", b"\xc1"]
    assert [is_camera(data) for data in others] == [False] * len(others)


def test_where_the_therapist_moves_the_hand_the_patient_is_not_told_to(served: Served) -> None:
    w = served.station._wizard
    served.station._wizard = replace(w, state=State.TASK_READY, task="prom_fist", calibrated=True)
    state = screen_state(served.station.snapshot(), [])
    assert (state["passive"], state["instruction"]) == (True, "")


def test_at_the_second_hand_the_patient_is_told_that_it_is_the_other_one(served: Served) -> None:
    snapshot = {**served.station.snapshot(), "continues": 1}
    snapshot["wizard"] = {**snapshot["wizard"], "state": State.CONNECT}
    assert screen_state(snapshot, [])["stage"] == "change"
    assert screen_state({**snapshot, "continues": None}, [])["stage"] == "wait"
    snapshot["wizard"]["state"] = State.TASKS
    assert screen_state(snapshot, [])["stage"] == "wait"


def test_registries_of_two_servers_share_nothing() -> None:
    code = Invitations().invite("test", "en", "anna")[1]
    assert Invitations().open(code, "") is None
