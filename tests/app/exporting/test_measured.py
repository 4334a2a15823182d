"""What an export leaves out for accounts that do not see what people typed."""

from handscope.app.exporting.measured import gather, without_text
from handscope.estimators.data.samples import Event
from handscope.sessions.exports import export
from tests.sessions.exports.conftest import processed  # a simulated recording and its movement
from tests.simulated import INSTANT


def test_words_typed_at_an_event_are_in_no_file_of_a_scientists_export() -> None:
    recording, made = processed("left")
    typed = Event(
        1.0, 1.0, "annotation", {"note": "Mrs Example said", "index_mcp_deviation_deg": "4"}
    )
    noted = recording.with_events((*recording.events, typed))
    whole = gather(noted, made, "m2", INSTANT)
    assert any(b"Mrs Example" in data for data in export(whole, "bids").files.values())
    files = export(without_text(whole), "bids").files
    assert not any(b"Mrs Example" in data for data in files.values())
    (events,) = [data for name, data in files.items() if name.endswith("_events.tsv")]
    assert b"index_mcp_deviation_deg" in events and b"rom_mcp" in events
