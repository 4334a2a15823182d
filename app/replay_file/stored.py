"""The replay file of a stored result."""

from handscope.app.language import Language
from handscope.app.protocols import offered
from handscope.app.replay_file import chapters, replay_file
from handscope.app.results.make import load_replay
from handscope.estimators.data.samples import Event
from handscope.estimators.hand.geometry import measures_from, sized
from handscope.sessions.db.tables import Result
from handscope.sessions.store import records
from handscope.sessions.store.store import Store


def of_result(store: Store, result: Result, named: bool, language: Language) -> bytes:
    """With the patient's code in its title where `named`; no other fact about the patient is in it."""
    session = result.recording.session
    hand = records.hand_of(session.hand)
    measures = session.geometry or result.recording.summary.get("geometry") or {}
    events = [
        Event(e["onset"], e["duration"], e["trial_type"], e) for e in result.content["events"]
    ]
    title = (
        language.say("replay.title.of", pseudonym=session.patient.pseudonym)
        if named
        else language.say("replay.title")
    )
    geometry = sized(hand, measures_from(measures))
    return replay_file(
        hand,
        geometry,
        load_replay(store, result),
        chapters(events, offered(store.folder)[0], language),
        title,
        language,
    )
