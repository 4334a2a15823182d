"""The body of an answer that refuses: `{"error": sentence}` in the reader's language, with code and values where there is one message."""

from typing import Any

from handscope.app.language import Language
from handscope.estimators.messages.sentence import PLAIN, Sentence, plain_number


def error_body(text: object, language: Language) -> dict[str, Any]:
    """Of an error, or of its words."""
    sentence = str(text)
    body: dict[str, Any] = {"error": language.translate(sentence)}
    if isinstance(sentence, Sentence) and len(sentence.messages) == 1:
        (message,) = sentence.messages
        if message.code != PLAIN:
            values = {
                n: v if isinstance(v, str) else plain_number(v) for n, v in message.values.items()
            }
            body |= {"code": message.code, "values": values}
    return body
