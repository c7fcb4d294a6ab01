"""Messages of the link, version 1, and the frames that carry them."""

import struct
import zlib
from dataclasses import dataclass
from enum import IntEnum

import numpy as np
from numpy.typing import NDArray

from armor_plant import cobs, postcard

VERSION = 1
"""The version of the protocol that this package speaks."""

COST_STEPS = 1 << 16
"""Steps of a unit of cost on the wire."""

_CHECKSUM = struct.Struct("<I")


class Fault(IntEnum):
    """Why a control step was not an ordinary one."""

    STATE_LENGTH = 0
    STATE_NOT_FINITE = 1
    INVALID_COST = 2
    NO_RUNG = 3
    ACTION_NOT_FINITE = 4


@dataclass(frozen=True)
class Identity:
    """Who answers: the task and sizes of its policy."""

    version: int
    task: str
    state: int
    action: int
    rungs: tuple[int, ...]
    """Calls of the denoiser of each chain, longest first."""
    trained_max: float
    """The largest cost limit that an episode may be given."""
    episode: int
    """Number of the last episode; 0 before the first."""


@dataclass(frozen=True)
class Ready:
    """An episode has started."""

    episode: int
    kappa: float


@dataclass(frozen=True)
class Act:
    """What to do."""

    episode: int
    tick: int
    kappa: float
    """The budget after the incurred cost was charged."""
    rung: int | None
    """Which chain flew; none where the action is the fallback."""
    fault: int | None
    """A :class:`Fault`, or a number that a newer controller has given one."""
    action: tuple[float, ...]


@dataclass(frozen=True)
class Refused:
    """The request cannot be met; ``reason`` says what to do."""

    reason: str


Answer = Identity | Ready | Act | Refused


def hello(version: int = VERSION) -> bytes:
    """Ask who answers."""
    return bytes([0, version])


def reset(episode: int, limit: float, seed: int) -> bytes:
    """Ask for a new episode that may incur ``limit``, rounded down to a step of 2^-16."""
    raw = int(limit * COST_STEPS)
    return b"\x01" + postcard.integer(episode) + postcard.integer(raw) + postcard.integer(seed)


def observe(episode: int, tick: int, incurred: float, state: NDArray[np.float32]) -> bytes:
    """Ask for an action; ``incurred`` is the cost of the step before."""
    head = b"\x02" + postcard.integer(episode) + postcard.integer(tick)
    cost = struct.pack("<f", incurred)
    return head + cost + postcard.integer(len(state)) + state.astype("<f4").tobytes()


def frame(message: bytes) -> bytes:
    """Put a message into a frame: its CRC-32 behind it, stuffed, and a zero at the end."""
    return cobs.encode(message + _CHECKSUM.pack(zlib.crc32(message))) + b"\0"


def unframe(stuffed: bytes) -> bytes:
    """Take the message out of a frame without its end; ``ValueError`` if it is damaged."""
    content = cobs.decode(stuffed)
    message, checksum = content[:-4], content[-4:]
    if len(checksum) < 4 or _CHECKSUM.unpack(checksum)[0] != zlib.crc32(message):
        raise ValueError("a frame is damaged")
    return message


def answer(message: bytes) -> Answer:
    """Read an answer; ``ValueError`` where it is none of this version."""
    reader = postcard.Reader(message)
    read = (_identity, _ready, _act, _refused)
    variant = reader.integer(32)
    if variant >= len(read):
        raise ValueError("an answer is of no kind that version 1 has")
    result = read[variant](reader)
    reader.end()
    return result


def _cost(reader: postcard.Reader) -> float:
    return reader.integer(32) / COST_STEPS


def _identity(reader: postcard.Reader) -> Identity:
    return Identity(
        version=reader.byte(),
        task=reader.text(),
        state=reader.integer(16),
        action=reader.integer(16),
        rungs=tuple(reader.integer(16) for _ in range(reader.integer(32))),
        trained_max=_cost(reader),
        episode=reader.integer(32),
    )


def _ready(reader: postcard.Reader) -> Ready:
    return Ready(episode=reader.integer(32), kappa=_cost(reader))


def _act(reader: postcard.Reader) -> Act:
    return Act(
        episode=reader.integer(32),
        tick=reader.integer(32),
        kappa=_cost(reader),
        rung=reader.byte() if reader.optional() else None,
        fault=reader.integer(32) if reader.optional() else None,
        action=reader.floats(),
    )


def _refused(reader: postcard.Reader) -> Refused:
    variant = reader.integer(32)
    if variant == 0:
        return Refused(f"the controller speaks version {reader.byte()} of the link")
    if variant == 1:
        return Refused("the controller was not greeted")
    if variant == 2:
        return Refused("the controller cannot read the request; does it hold so long a state?")
    if variant == 3:
        return Refused(f"no such episode; the next one is {reader.integer(32)}")
    if variant == 4:
        return Refused(f"a control step was left out; the next one is {reader.integer(32)}")
    if variant == 5:
        most = _cost(reader)
        return Refused(f"the policy was trained for cost limits up to {most:g}; ask for no more")
    raise ValueError("a refusal is of no kind that version 1 has")
