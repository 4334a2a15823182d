"""The tables of methods: a new one is a file beside this and a name here. Those of METHODS step
through blocks, live or not; those of BATCH need the whole recording (`solve`) and are offered for
recordings alone; those of EXPERIMENTS step as well and are offered nowhere: who wants one names
it.

A method is imported when it is taken from its table: who runs one does not wait for the others.
"""

from collections.abc import Iterator, Mapping, Sequence
from importlib import import_module
from typing import TYPE_CHECKING, Any, TypeVar, cast

from handscope.estimators.data.samples import Stream
from handscope.estimators.pipeline.method import AnyMethod, BatchMethod, Method

AMethod = TypeVar("AMethod", covariant=True)


class MethodTable(Mapping[str, AMethod]):
    """Methods by name."""

    def __init__(self, *names: str) -> None:
        self._names = names

    def __getitem__(self, name: str) -> AMethod:
        if name not in self._names:
            raise KeyError(name)
        return cast(AMethod, import_module(f"{__name__}.{name.replace('-', '_')}"))

    def __contains__(self, name: object) -> bool:
        return name in self._names

    def __iter__(self) -> Iterator[str]:
        return iter(self._names)

    def __len__(self) -> int:
        return len(self._names)


METHODS = MethodTable[Method[Any, Any]]("b", "m1", "m2", "ekf")
BATCH = MethodTable[BatchMethod[Any]]("map")
EXPERIMENTS = MethodTable[Method[Any, Any]]("map-live")
DEFAULT = "ekf"  # of a session, a recording and a call that name none: docs/decisions/0013
DEFAULT_OF_ORIENTATIONS = "m2"  # where a device gives orientations in place of angular rates
OFFERED = MethodTable[AnyMethod[Any]](*METHODS, *BATCH)  # on pages, for recordings
ALL_METHODS = MethodTable[AnyMethod[Any]](*OFFERED, *EXPERIMENTS)  # for recordings


def default_for(streams: Sequence[Stream]) -> str:
    """The method of a recording with these streams for which nobody named one."""
    rates = any(s.inertial for s in streams)
    return DEFAULT if rates or not any(s.oriented for s in streams) else DEFAULT_OF_ORIENTATIONS


if TYPE_CHECKING:  # each method has what its table promises
    from handscope.estimators.methods import b, ekf, m1, m2, map_live
    from handscope.estimators.methods import map as self_calibrated

    _stepping: tuple[Method[Any, Any], ...] = (b, m1, m2, ekf, map_live)
    _batch: tuple[BatchMethod[Any], ...] = (self_calibrated,)
