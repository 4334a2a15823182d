"""A figure of progress in words: its stored name holds the fingers or the joint that it is of before what it is."""

from itertools import takewhile

from handscope.app.language import Language
from handscope.app.report.words import figure_words, named
from handscope.estimators.hand.anatomy import FINGERS, JOINTS
from handscope.estimators.measures.figure import Figure


def label(name: str, language: Language) -> str:
    """ "Index: total active motion (TAM)" of index_tam."""
    words = name.split("_")
    joints = (joint.name for joint in JOINTS if name.startswith(f"{joint.name}_"))
    part = next(joints, "_".join(takewhile(lambda word: word in FINGERS, words)))
    what = name.removeprefix(f"{part}_") if part else name
    if not part or not language.known(f"figure.{what}", ""):
        return figure_words(name, language)
    return named(Figure(name, 0.0, "", "", part=part, what=what), language)
