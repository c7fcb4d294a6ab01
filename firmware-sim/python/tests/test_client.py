"""The client on lines that lose, double, damage and delay."""

from collections.abc import Callable

import numpy as np
import pytest

from armor_plant import messages, postcard
from armor_plant.client import TRIES, Client, ControllerError

STATE = np.zeros(2, np.float32)
HELLO = bytes([0, 1, 1, ord("a"), 2, 1, 1, 5]) + postcard.integer(40 << 16) + b"\0"


class Controller:
    """A line to a controller that answers every request, through faults."""

    def __init__(self, fault: Callable[[int, bytes], bytes] = lambda _, frame: frame) -> None:
        """Pass the answer to the n-th request through ``fault(n, frame)``."""
        self.requests: list[bytes] = []
        self._fault = fault
        self._answers = b""

    def write(self, data: bytes) -> None:
        for stuffed in filter(None, data.split(b"\0")):
            request = messages.unframe(stuffed)
            self.requests.append(request)
            self._answers += self._fault(len(self.requests), messages.frame(self._answer(request)))

    def _answer(self, request: bytes) -> bytes:
        reader = postcard.Reader(request)
        kind = reader.integer(32)
        if kind == 0:
            return HELLO
        episode = reader.integer(32)
        if kind == 1:
            return b"\x01" + postcard.integer(episode) + postcard.integer(reader.integer(32))
        tick = reader.integer(32)
        act = postcard.integer(episode) + postcard.integer(tick) + b"\0\x01\0\0\x01"
        return b"\x02" + act + np.float32(tick).tobytes()

    def read(self, patience: float) -> bytes:
        if not self._answers:
            raise TimeoutError
        data, self._answers = self._answers[:5], self._answers[5:]
        return data

    def close(self) -> None:
        pass


def test_an_episode_is_asked_for_in_order() -> None:
    line = Controller()
    client = Client(line)
    assert client.reset(20.0, 3) == 20.0
    for tick in range(3):
        act = client.step(STATE, 0.5)
        assert (act.tick, act.rung, act.fault, act.action) == (tick, 0, None, (tick,))
    assert client.reset(1.5, 4) == 1.5
    assert client.step(STATE, 0.0).episode == 2
    assert len(line.requests) == 7


@pytest.mark.parametrize(
    "damage",
    [
        lambda frame: b"",
        lambda frame: frame[:3] + bytes([frame[3] ^ 4]) + frame[4:],
        lambda frame: frame[:-1],
        lambda frame: b"\x55\x66" + frame,
    ],
    ids=["lost", "damaged", "without its end", "behind noise"],
)
def test_what_does_not_come_whole_is_asked_for_again(damage: Callable[[bytes], bytes]) -> None:
    line = Controller(lambda number, frame: damage(frame) if number % 3 == 1 else frame)
    client = Client(line, patience=0.01)
    client.reset(20.0, 3)
    assert [client.step(STATE, 0.0).tick for _ in range(6)] == list(range(6))
    assert len(line.requests) > 8
    assert line.requests[0] == line.requests[1] == messages.hello()


def test_a_doubled_answer_is_passed_over() -> None:
    client = Client(Controller(lambda _, frame: frame + frame))
    client.reset(20.0, 3)
    assert [client.step(STATE, 0.0).tick for _ in range(5)] == list(range(5))


def test_a_silent_controller_is_given_up() -> None:
    line = Controller(lambda _, frame: b"")
    with pytest.raises(ControllerError, match="does not answer"):
        Client(line, patience=0.01)
    assert line.requests == [messages.hello()] * TRIES


def test_a_refusal_is_an_error_with_its_reason() -> None:
    refusal = messages.frame(b"\x03\x05" + postcard.integer(40 << 16))
    client = Client(Controller(lambda number, frame: refusal if number == 2 else frame))
    with pytest.raises(ControllerError, match="cost limits up to 40"):
        client.reset(50.0, 0)
