"""The parts of postcard, version 1, that the link uses.

Integers of more than a byte take 7 bits a byte, lowest first, with the top bit
set on all bytes but the last; floats are little-endian IEEE-754; lists and text
start with their length; an enum starts with the number of its variant.
"""

import struct


def integer(value: int) -> bytes:
    """Encode an unsigned integer."""
    encoded = bytearray()
    while value > 0x7F:
        encoded.append(value & 0x7F | 0x80)
        value >>= 7
    encoded.append(value)
    return bytes(encoded)


class Reader:
    """Reads values off the front of bytes; ``ValueError`` where there are none."""

    def __init__(self, content: bytes) -> None:
        """Read from the first byte on."""
        self._content = content
        self._at = 0

    def _take(self, count: int) -> bytes:
        taken = self._content[self._at : self._at + count]
        if len(taken) < count:
            raise ValueError("a message is cut short")
        self._at += count
        return taken

    def byte(self) -> int:
        """Read one byte."""
        return self._take(1)[0]

    def integer(self, bits: int) -> int:
        """Read an unsigned integer below ``2**bits``."""
        value = 0
        for shift in range(0, bits, 7):
            byte = self.byte()
            value |= (byte & 0x7F) << shift
            if byte < 0x80:
                if value >> bits:
                    break
                return value
        raise ValueError("an integer is out of range")

    def text(self) -> str:
        """Read text."""
        return self._take(self.integer(32)).decode()

    def floats(self) -> tuple[float, ...]:
        """Read a list of single-precision numbers."""
        count = self.integer(32)
        return struct.unpack(f"<{count}f", self._take(4 * count))

    def optional(self) -> bool:
        """Read whether an optional value follows."""
        byte = self.byte()
        if byte > 1:
            raise ValueError("an option is neither there nor not")
        return byte == 1

    def end(self) -> None:
        """Check that nothing is left."""
        if self._at != len(self._content):
            raise ValueError("a message is longer than it says")
