"""/api/methods: what recordings can be processed with; /api/protocols: what patients can be asked to do"""

from dataclasses import asdict
from typing import Any

from fastapi import APIRouter

from handscope.app.auth.roles import EVERY_ACCOUNT, requires_role
from handscope.app.protocols import offered
from handscope.app.state import LanguageDep, PartsDep
from handscope.estimators.data.options import Description, describe
from handscope.estimators.messages.sentence import with_code
from handscope.estimators.methods import DEFAULT, OFFERED
from handscope.estimators.pipeline.method import capability_words

PROTOCOL_TEXTS = frozenset({"title", "instruction", "source", "say", "hint"})
router = APIRouter(tags=["methods"], dependencies=[requires_role(*EVERY_ACCOUNT)])


@router.get("/methods")
def list_methods(language: LanguageDep) -> list[dict[str, Any]]:
    """Methods with what each needs and can do, and their options: default, unit, meaning, source; one of them is what is taken unless another is asked for."""
    return [
        {
            "name": name,
            "title": language.translate(m.TITLE),
            "default": name == DEFAULT,
            "capabilities": asdict(m.CAPABILITIES),
            "abilities": [language.translate(words) for words in capability_words(m.CAPABILITIES)],
            "options": [
                asdict(d)
                | {
                    "meaning": language.translate(meaning_of(name, d)),
                    "source": language.translate(source_of(name, d)),
                    "choice_words": [language.known(f"choice.{c}", c) for c in d.choices],
                }
                for d in describe(m.Params)
            ],
        }
        for name, m in OFFERED.items()
    ]


def meaning_of(method: str, option: Description) -> str:
    """What an option means, with its code where it has one; else its own words."""
    shared = with_code(f"method_option.{option.name}", option.meaning)
    return with_code(f"method_option.{method}_{option.name}", shared)


def source_of(method: str, option: Description) -> str:
    """Where an option's value comes from, as `meaning_of`."""
    shared = with_code(f"option_source.{option.name}", option.source)
    return with_code(f"option_source.{method}_{option.name}", shared)


@router.get("/protocols")
def list_protocols(parts: PartsDep, language: LanguageDep) -> list[dict[str, Any]]:
    """Tasks that patients can be asked to do, in the language of the page."""
    return [
        language.translate_keys(asdict(p), PROTOCOL_TEXTS)
        for p in offered(parts.store.folder)[0].values()
    ]
