"""Frames and messages, against bytes that the Rust side's tests and docs/link.md have too."""

import random
import struct

import numpy as np
import pytest

from armor_plant import cobs, messages, postcard
from armor_plant.messages import Act, Fault, Identity, Ready, Refused


def test_a_hello_has_these_bytes() -> None:
    assert messages.frame(messages.hello(1)) == bytes.fromhex("01 06 01 69 22 DE 36 00")


@pytest.mark.parametrize(
    ("content", "stuffed"),
    [  # The examples of the COBS paper.
        (b"\0", b"\x01\x01"),
        (b"\0\0", b"\x01\x01\x01"),
        (b"\x11\x22\0\x33", b"\x03\x11\x22\x02\x33"),
        (b"\x11\0\0\0", b"\x02\x11\x01\x01\x01"),
        (bytes(range(1, 255)) + b"\0", b"\xff" + bytes(range(1, 255)) + b"\x01\x01"),
        (bytes(range(1, 256)), b"\xff" + bytes(range(1, 255)) + b"\x02\xff"),
    ],
)
def test_bytes_are_stuffed_as_in_the_paper(content: bytes, stuffed: bytes) -> None:
    assert cobs.encode(content) == stuffed
    assert cobs.decode(stuffed) == content


def test_any_content_is_stuffed_without_a_zero_and_found() -> None:
    source = random.Random(1)
    for length in range(0, 1100, 7):
        content = bytes(source.choices([0, 1, 255], weights=[1, 200, 200], k=length))
        stuffed = cobs.encode(content)
        assert 0 not in stuffed
        assert cobs.decode(stuffed) == content


def test_no_flipped_bit_and_no_cut_passes_for_a_message() -> None:
    frame = messages.frame(messages.observe(3, 70_000, 1.0, np.array([0.5, -1], np.float32)))
    stuffed = frame[:-1]
    damaged = [stuffed[:cut] for cut in range(len(stuffed))]
    for bit in range(8 * len(stuffed)):
        flipped = bytearray(stuffed)
        flipped[bit // 8] ^= 1 << bit % 8
        damaged += flipped.split(b"\0")
    for frame in damaged:
        with pytest.raises(ValueError):
            messages.unframe(bytes(frame))


def test_requests_have_the_bytes_of_the_protocol() -> None:
    assert messages.reset(300, 20.0, 1 << 63) == bytes.fromhex(
        "01 AC02 808050 80808080808080808001"
    )
    observed = messages.observe(1, 128, 1.0, np.array([0.0, -2.0], np.float32))
    assert observed == bytes.fromhex("02 01 8001 0000803F 02 00000000 000000C0")


def test_answers_are_read_from_the_bytes_of_the_protocol() -> None:
    def read(text: str) -> messages.Answer:
        return messages.answer(bytes.fromhex(text))

    assert read("00 01 02 6162 07 02 02 1405 808050 00") == Identity(
        version=1, task="ab", state=7, action=2, rungs=(20, 5), trained_max=20.0, episode=0
    )
    assert read("01 AC02 8080A001") == Ready(episode=300, kappa=40.0)
    assert read("02 01 05 808004 0100 00 01 0000803F") == Act(
        episode=1, tick=5, kappa=1.0, rung=0, fault=None, action=(1.0,)
    )
    assert read("02 01 05 00 00 0102 00") == Act(
        episode=1, tick=5, kappa=0.0, rung=None, fault=Fault.INVALID_COST, action=()
    )
    assert read("03 05 808050") == Refused(
        "the policy was trained for cost limits up to 20; ask for no more"
    )
    for refusal in ("0002", "01", "02", "0309", "0404"):
        assert isinstance(read("03" + refusal), Refused)


@pytest.mark.parametrize(
    "text", ["", "04", "01 AC", "01 01 00 00", "01 8080808010 00", "02 01 05 00 02", "03 06"]
)
def test_what_is_no_answer_is_refused(text: str) -> None:
    with pytest.raises(ValueError):
        messages.answer(bytes.fromhex(text))


def test_integers_come_back() -> None:
    for value in (0, 1, 127, 128, 16383, 16384, (1 << 32) - 1):
        reader = postcard.Reader(postcard.integer(value))
        assert reader.integer(32) == value
        reader.end()


def test_a_state_is_sent_in_single_precision() -> None:
    state = np.array([0.1, 1e30], np.float32)
    assert messages.observe(0, 0, 0.0, state)[-8:] == struct.pack("<2f", *state)
