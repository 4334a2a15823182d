"""Who may use a route is said where the route is: `dependencies=[may(CLINICIAN)]` on its router, or on the route where it differs.

The innermost declaration counts. A route without one is refused to everybody (app/auth/gate.py): forgetting it locks out, it never lets in.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Annotated, Any

from fastapi import Depends
from fastapi.routing import RouteContext, iter_route_contexts
from starlette.requests import HTTPConnection
from starlette.routing import BaseRoute, Match
from starlette.types import Scope

from handscope.sessions.clinic.accounts import ADMINISTRATOR, CLINICIAN, ROLES, SCIENTIST

__all__ = [
    "ADMINISTRATOR",
    "ANYBODY",
    "CLINICIAN",
    "EVERY_ACCOUNT",
    "SCIENTIST",
    "Door",
    "Doors",
    "May",
    "Who",
    "WhoDep",
    "address_of",
    "may",
    "on_behalf_of",
]
EVERY_ACCOUNT = ROLES
ANYBODY = "anybody"  # without a login


@dataclass(frozen=True)
class Who:
    """The account that a request comes from."""

    account: int
    name: str
    roles: frozenset[str]
    login: int

    @property
    def sees_all(self) -> bool:
        """Whether free text and what else may tell who a patient is are shown (app/api/pseudonymisation.py)."""
        return CLINICIAN in self.roles


@dataclass(frozen=True)
class May:
    """A declaration; as a dependency it does nothing, the gate has decided before."""

    roles: frozenset[str]
    does: str = "viewed"  # what the audit trail says of somebody who asks for it

    async def __call__(self) -> None:
        pass

    def admits(self, who: Who) -> bool:
        return ANYBODY in self.roles or not self.roles.isdisjoint(who.roles)


def may(*roles: str, does: str = "viewed") -> Any:
    """A declaration for `dependencies=[...]`."""
    assert roles and set(roles) <= {*ROLES, ANYBODY}
    return Depends(May(frozenset(roles), does))


def who(connection: HTTPConnection) -> Who:
    """The account that this request comes from."""
    found: Who = connection.state.who
    return found


def on_behalf_of(connection: HTTPConnection) -> tuple[str, str]:
    """Account and address, for the audit trail; nobody's name before the login."""
    found: Who | None = getattr(connection.state, "who", None)
    return found.name if found else "", address_of(connection)


def address_of(connection: HTTPConnection) -> str:
    """Where a request comes from, as a trusted proxy says or as the socket does."""
    return connection.client.host[:64] if connection.client else ""


WhoDep = Annotated[Who, Depends(who)]


@dataclass(frozen=True)
class Door:
    """A route as a request meets it."""

    may: May | None
    named: Mapping[str, Any]  # what the address names: patient_id, ...


class Doors:
    """All routes of an application with their declarations, in the order in which they are tried."""

    def __init__(self, routes: Sequence[BaseRoute]) -> None:
        self.all: list[tuple[RouteContext, May | None]] = [
            (route, declared(route)) for route in iter_route_contexts(routes)
        ]

    def of(self, scope: Scope) -> "Door | None":
        """The route that would answer; one that lacks the method where no other has it, None where there is none."""
        partly = None
        for route, declaration in self.all:
            match, more = route.matches(scope)
            if match is Match.FULL:
                return Door(declaration, more.get("path_params", {}))
            if match is Match.PARTIAL and partly is None:
                partly = Door(declaration, more.get("path_params", {}))
        return partly


def declared(route: RouteContext) -> May | None:
    """The innermost declaration of a route; a mounted application says it as its attribute `may`."""
    found = [
        d.dependency for d in getattr(route, "dependencies", ()) if isinstance(d.dependency, May)
    ]
    mounted: May | None = getattr(getattr(route, "app", None), "may", None)
    return found[-1] if found else mounted
