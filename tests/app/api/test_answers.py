"""What routes say that they answer with is what they answer with, and what the pages' types say."""

import re
from pathlib import Path

import pytest
from pydantic import TypeAdapter
from starlette.testclient import TestClient

import handscope.static
from handscope.app.api import answers
from handscope.app.api.typescript import declarations
from handscope.app.live.wizard.transition_table import Action

ROOT = Path(__file__).parents[3]
# what no person does: the wizard finds it
BY_ITSELF = (Action.HELD, Action.POSED, Action.SEEN, Action.STARTED, Action.ENDED, Action.SOLVED)
TYPES = Path(str(handscope.static.__file__)).parent / "types" / "api.d.ts"


def test_the_pages_types_are_those_of_the_api(server: TestClient) -> None:
    description = server.app.openapi()  # type: ignore[attr-defined]
    assert TYPES.read_text("utf-8") == declarations(description), "run make types"


def test_the_documentation_names_every_route_and_every_action(server: TestClient) -> None:
    page = (ROOT / "docs" / "http-api.md").read_text("utf-8")
    routes = server.app.openapi()["paths"]  # type: ignore[attr-defined]
    named = [[w for w in path.split("/") if w and w[0] != "{"][-1] for path in routes]
    ends = {word.split("{")[0] for word in named}
    assert {word for word in ends if not re.search(rf"/{re.escape(word)}", page)} == set()
    actions = {action.value for action in Action if action not in BY_ITSELF}
    assert {word for word in actions if f"`{word}`" not in page} == set()


@pytest.mark.parametrize(
    ("address", "model"),
    [
        ("/api/patients", list[answers.PatientListed]),
        ("/api/patients/{patient}", answers.PatientAnswer),
        ("/api/notes/{note}", answers.NoteRow),
        ("/api/accounts", list[answers.AccountRow]),
        ("/api/me", answers.AccountRow),
        ("/api/stations", list[answers.StationRow]),
    ],
)
def test_an_answer_has_the_fields_of_its_type(
    client: TestClient, patient: int, address: str, model: type
) -> None:
    note = client.post(f"/api/patients/{patient}/notes", json={"text": "walks"}).json()["id"]
    answer = client.get(address.format(patient=patient, note=note)).json()
    TypeAdapter(model).validate_python(answer)
    row = model.__args__[0] if isinstance(answer, list) else model  # type: ignore[attr-defined]
    for one in answer if isinstance(answer, list) else [answer]:
        assert row.__required_keys__ <= set(one) <= row.__required_keys__ | row.__optional_keys__
