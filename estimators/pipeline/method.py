"""What a method is: a module with these names, and what it says of itself as typed fields.

A method that steps serves live streams and recordings alike; one that solves needs the whole
recording. The tables of methods are in estimators/methods/__init__.py.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Protocol, TypeGuard, TypeVar

from handscope.estimators.data.calibration import Calibration
from handscope.estimators.data.held_contact import ContactOutcome
from handscope.estimators.data.mounting_change import MountingChange
from handscope.estimators.data.samples import Block, Recording, Stream
from handscope.estimators.data.trajectory import Trajectory
from handscope.estimators.messages.sentence import phrase


@dataclass(frozen=True, kw_only=True)
class Capabilities:
    """What a method needs and what it can do."""

    needs_pose: bool  # it starts from an initial pose
    needs_magnetometers: bool = False  # headings come from them; recordings without are refused
    takes_orientations: bool = False  # a stream may bring orientations in place of rates
    batch_only: bool = False  # it solves whole recordings and does not step through blocks
    gives_covariance: bool = False  # angles and tips come with standard deviations
    notices_mounting_changes: bool = False  # it finds sensors that turn on their segments
    # contacts of fingertips that are held for calibration tell it something
    uses_contacts: bool = False
    # accelerometers' biases that a calibration has are taken off the samples
    subtracts_acc_bias: bool = False
    # its filter estimates the sensors of a finger together: a fault of one is in the angles of all
    couples_chains: bool = False


WORDS: Mapping[str, str] = {  # of each capability, for lists of methods
    "needs_pose": phrase("method_capability.needs_pose"),
    "needs_magnetometers": phrase("method_capability.needs_magnetometers"),
    "takes_orientations": phrase("method_capability.takes_orientations"),
    "batch_only": phrase("method_capability.batch_only"),
    "gives_covariance": phrase("method_capability.gives_covariance"),
}


def capability_words(capabilities: Capabilities) -> list[str]:
    """What a method needs and can do, in words."""
    return [words for name, words in WORDS.items() if vars(capabilities)[name]]


P = TypeVar("P")
S = TypeVar("S")
P_co = TypeVar("P_co", covariant=True)


class AnyMethod(Protocol[P_co]):
    """What every method says of itself."""

    @property
    def TITLE(self) -> str: ...

    @property
    def CAPABILITIES(self) -> Capabilities: ...

    @property
    def Params(self) -> type[P_co]: ...


class Method(AnyMethod[P], Protocol[P, S]):
    """A method that steps through blocks; nothing depends on where a block ends, nor on whether
    those of several streams come one after the other or together, which costs less."""

    def start(self, params: P, calibration: Calibration, streams: tuple[Stream, ...], /) -> S: ...

    def step(self, params: P, state: S, /, *blocks: Block) -> tuple[S, Trajectory]: ...

    def release(self, params: P, state: S, patience: float, /) -> tuple[S, Trajectory]: ...

    def finish(self, params: P, state: S, /) -> tuple[S, Trajectory]: ...


class UsesContacts(Protocol):
    """A method that measures with contacts of fingertips."""

    def contact_outcomes(self, state: object, /) -> tuple[ContactOutcome, ...]: ...


class NoticesMountingChanges(Protocol):
    """A method that finds sensors which turn on their segments."""

    def mounting_changes(self, state: object, /) -> tuple[MountingChange, ...]: ...


class BatchMethod(AnyMethod[P], Protocol[P]):
    """A method that needs the whole recording, calibrations included."""

    def solve(
        self, params: P, recording: Recording, progress: Callable[[float], None], /
    ) -> tuple[Trajectory, list[Calibration], list[str]]: ...


def solves_whole(method: AnyMethod[P]) -> TypeGuard[BatchMethod[P]]:
    """Whether the method takes the whole recording at once."""
    return method.CAPABILITIES.batch_only


def steps_through(method: AnyMethod[P]) -> TypeGuard[Method[P, object]]:
    """Whether the method steps through blocks, live or not."""
    return not method.CAPABILITIES.batch_only


def notices_mounting_changes(method: AnyMethod[P]) -> TypeGuard[NoticesMountingChanges]:
    """Whether the method finds sensors which turn on their segments."""
    return method.CAPABILITIES.notices_mounting_changes


def uses_contacts(method: AnyMethod[P]) -> TypeGuard[UsesContacts]:
    """Whether contacts of fingertips tell the method something."""
    return method.CAPABILITIES.uses_contacts
