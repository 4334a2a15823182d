"""Roles that a route requires: `dependencies=[requires_role(CLINICIAN)]` on its router, or on the route itself.

The innermost declaration counts. The gate (app/auth/gate.py) refuses a route without one to everybody.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Annotated, Any

from fastapi import Depends
from fastapi.routing import RouteContext, iter_route_contexts
from starlette.requests import HTTPConnection
from starlette.routing import BaseRoute, Match
from starlette.types import Scope

from handscope.sessions.db.roles import ADMINISTRATOR, CLINICIAN, ROLES, SCIENTIST
from handscope.sessions.db.visible_rows import Visibility

__all__ = [
    "ADMINISTRATOR",
    "ANYBODY",
    "CLINICIAN",
    "EVERY_ACCOUNT",
    "SCIENTIST",
    "Requester",
    "RequesterDep",
    "RoleRequirement",
    "RouteAccess",
    "RouteTable",
    "address_of",
    "on_behalf_of",
    "requires_role",
]
EVERY_ACCOUNT = ROLES
ANYBODY = "anybody"  # without a login


@dataclass(frozen=True)
class Requester:
    """The account that a request comes from."""

    account: int
    name: str
    roles: frozenset[str]
    login: int
    lacks_second_factor: bool = False  # that its role requires
    visibility: Visibility | None = None  # whose patients it sees; None: all
    heads: frozenset[int] = frozenset()  # wards that it heads

    @property
    def is_of_house(self) -> bool:
        """Whether the account belongs to the whole house."""
        return self.visibility is None

    def is_of_ward(self, ward: int) -> bool:
        """Whether patients of this ward are seen without an emergency access."""
        return self.visibility is None or self.visibility.covers(ward, 0)

    @property
    def sees_all(self) -> bool:
        """Whether the account sees what may identify a patient (app/api/pseudonymisation.py)."""
        return CLINICIAN in self.roles


@dataclass(frozen=True)
class RoleRequirement:
    """A declaration; as a dependency it does nothing: the gate has decided before."""

    roles: frozenset[str]
    does: str = "viewed"  # the action in the audit trail

    async def __call__(self) -> None:
        pass

    def admits(self, requester: Requester) -> bool:
        return ANYBODY in self.roles or not self.roles.isdisjoint(requester.roles)


def requires_role(*roles: str, does: str = "viewed") -> Any:
    """A declaration for `dependencies=[...]`."""
    assert roles and set(roles) <= {*ROLES, ANYBODY}
    return Depends(RoleRequirement(frozenset(roles), does))


def requester(connection: HTTPConnection) -> Requester:
    """The account that this request comes from."""
    value: Requester = connection.state.requester
    return value


def on_behalf_of(connection: HTTPConnection) -> tuple[str, str]:
    """Account name and address for the audit trail; no name before the login."""
    value: Requester | None = getattr(connection.state, "requester", None)
    return value.name if value else "", address_of(connection)


def address_of(connection: HTTPConnection) -> str:
    """Address of the client, from a trusted proxy or the socket."""
    return connection.client.host[:64] if connection.client else ""


RequesterDep = Annotated[Requester, Depends(requester)]


@dataclass(frozen=True)
class RouteAccess:
    """A matched route: the roles that it requires, and the values in its address."""

    requirement: RoleRequirement | None
    named: Mapping[str, Any]  # values in the address: patient_id, ...


class RouteTable:
    """All routes of an application with their declarations, in matching order."""

    def __init__(self, routes: Sequence[BaseRoute]) -> None:
        self.all: list[tuple[RouteContext, RoleRequirement | None]] = [
            (route, declared_requirement(route)) for route in iter_route_contexts(routes)
        ]

    def of(self, scope: Scope) -> "RouteAccess | None":
        """The route that answers; else one with this address but another method; else None."""
        partly = None
        for route, declaration in self.all:
            match, more = route.matches(scope)
            if match is Match.FULL:
                return RouteAccess(declaration, more.get("path_params", {}))
            if match is Match.PARTIAL and partly is None:
                partly = RouteAccess(declaration, more.get("path_params", {}))
        return partly


def declared_requirement(route: RouteContext) -> RoleRequirement | None:
    """The innermost declaration of a route; a mounted application has the attribute `requires_role`."""
    requirements = [
        d.dependency
        for d in getattr(route, "dependencies", ())
        if isinstance(d.dependency, RoleRequirement)
    ]
    mounted: RoleRequirement | None = getattr(getattr(route, "app", None), "requires_role", None)
    return requirements[-1] if requirements else mounted
