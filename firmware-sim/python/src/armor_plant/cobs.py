"""Consistent overhead byte stuffing (Cheshire and Baker, 1999): bytes without a zero."""

_LONGEST = 254


def encode(content: bytes) -> bytes:
    """Stuff ``content``, so that no byte of it is zero."""
    stuffed = bytearray()
    for run in content.split(b"\0"):
        while len(run) >= _LONGEST:
            stuffed.append(_LONGEST + 1)
            stuffed += run[:_LONGEST]
            run = run[_LONGEST:]
        stuffed.append(len(run) + 1)
        stuffed += run
    return bytes(stuffed)


def decode(stuffed: bytes) -> bytes:
    """Undo :func:`encode`.

    Raises ``ValueError`` where the bytes are no stuffed content.
    """
    content = bytearray()
    at = 0
    while at < len(stuffed):
        code = stuffed[at]
        if code == 0 or at + code > len(stuffed):
            raise ValueError("a run of stuffed bytes is cut short")
        content += stuffed[at + 1 : at + code]
        at += code
        if code != _LONGEST + 1 and at < len(stuffed):
            content.append(0)
    return bytes(content)
