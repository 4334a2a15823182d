"""The one exception for a user's mistake."""

from dataclasses import replace

from handscope.estimators.messages import Message, Value, english_texts
from handscope.estimators.messages.sentence import Sentence


class InputError(Exception):
    """A mistake in what the user gave us: says what happened, to which data, and what to do.

    `InputError("motion_bids.not_utf8", name=file)` has the words of its code in every language. A finished
    sentence is accepted too, such as another program's; `message` is None then.
    """

    message: Message | None

    def __init__(self, what: str | Message, /, **values: Value) -> None:
        super().__init__(what)
        match what:
            case Message():
                self.message = what
            case Sentence(messages=[one]):
                self.message = replace(one, severity="fault")
            case Sentence():
                self.message = None
            case _:
                coded = what in english_texts()
                self.message = Message(what, values, "fault") if coded else None

    def __str__(self) -> str:
        return super().__str__() if self.message is None else Sentence(self.message)
