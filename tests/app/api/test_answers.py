"""What routes say that they answer with is what they answer with, and what the pages' types say."""

from pathlib import Path

import pytest
from pydantic import TypeAdapter
from starlette.testclient import TestClient

import handscope.static
from handscope.app.api import answers
from handscope.app.api.typescript import declarations

TYPES = Path(str(handscope.static.__file__)).parent / "types" / "api.d.ts"


def test_the_pages_types_are_those_of_the_api(server: TestClient) -> None:
    description = server.app.openapi()  # type: ignore[attr-defined]
    assert TYPES.read_text("utf-8") == declarations(description), "run make types"


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
