"""The plant's side of the link: ask, and ask again where no answer comes."""

import time
from collections.abc import Callable
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

from armor_plant import messages
from armor_plant.line import Line
from armor_plant.messages import Act, Answer, Identity, Ready, Refused

TRIES = 4
"""Times that a request is sent before the controller is given up."""

_Wanted = TypeVar("_Wanted", Identity, Ready, Act)


class ControllerError(Exception):
    """The controller cannot be asked, or refused; the message says why."""


class Client:
    """A controller at the other end of a line.

    ``patience`` is the time in seconds to wait for an answer before the
    request is sent again.
    """

    def __init__(self, line: Line, patience: float = 10.0) -> None:
        """Say hello."""
        self._line = line
        self._patience = patience
        self._received = bytearray()
        self.identity = self._ask(messages.hello(), Identity, lambda _: True)
        self._episode = self.identity.episode
        self._tick = 0

    def reset(self, limit: float, seed: int) -> float:
        """Start an episode that may incur ``limit``; return its budget."""
        episode = self._episode + 1
        request = messages.reset(episode, limit, seed)
        ready = self._ask(request, Ready, lambda ready: ready.episode == episode)
        self._episode, self._tick = episode, 0
        return ready.kappa

    def step(self, state: NDArray[np.float32], incurred: float) -> Act:
        """Tell the state and the cost of the step before; return what to do."""
        step = (self._episode, self._tick)
        request = messages.observe(*step, incurred, state)
        act = self._ask(request, Act, lambda act: (act.episode, act.tick) == step)
        self._tick += 1
        return act

    def close(self) -> None:
        """Hang up."""
        self._line.close()

    def _ask(
        self, request: bytes, kind: type[_Wanted], expected: Callable[[_Wanted], bool]
    ) -> _Wanted:
        """Send a request until its answer comes; answers to older ones are passed over."""
        frame = messages.frame(request)
        try:
            for attempt in range(TRIES):
                # A zero ends what may have come of the last try, so that this one stands alone.
                self._line.write(b"\0" + frame if attempt else frame)
                deadline = time.monotonic() + self._patience
                while (answer := self._next_answer(deadline)) is not None:
                    if isinstance(answer, Refused):
                        raise ControllerError(answer.reason)
                    if isinstance(answer, kind) and expected(answer):
                        return answer
        except EOFError:
            raise ControllerError("the controller hung up") from None
        except OSError as error:
            raise ControllerError(f"the line to the controller broke: {error}") from error
        raise ControllerError(f"the controller does not answer; {TRIES} requests were sent")

    def _next_answer(self, deadline: float) -> Answer | None:
        """The next whole answer; none where the deadline passes before one comes."""
        while True:
            while b"\0" in self._received:
                stuffed, _, rest = self._received.partition(b"\0")
                self._received = rest
                if stuffed:
                    try:
                        return messages.answer(messages.unframe(bytes(stuffed)))
                    except ValueError:
                        # Damaged on the way: the answer will be asked for again.
                        continue
            left = deadline - time.monotonic()
            if left <= 0:
                return None
            try:
                self._received += self._line.read(left)
            except TimeoutError:
                return None
