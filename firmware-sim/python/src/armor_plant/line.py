"""Lines to a controller: bytes out, bytes in, and never a wait for ever."""

import os
import select
import shlex
import socket
import subprocess
from typing import Protocol

_CHUNK = 4096


class Line(Protocol):
    """A stream of bytes each way."""

    def write(self, data: bytes) -> None:
        """Send bytes; ``OSError`` where the other side does not take them."""

    def read(self, patience: float) -> bytes:
        """Wait for bytes; ``TimeoutError`` after ``patience`` seconds, ``EOFError`` at the end."""

    def close(self) -> None:
        """Hang up."""


class Socket:
    """A TCP connection to ``firmware-sim serve --listen``."""

    def __init__(self, address: str, patience: float) -> None:
        """Connect to ``HOST:PORT``."""
        host, _, port = address.rpartition(":")
        if not port.isdecimal():
            raise ValueError(f"{address} is no address; write it as HOST:PORT")
        try:
            self._socket = socket.create_connection((host.strip("[]"), int(port)), timeout=patience)
        except OSError as error:
            reason = error.strerror or error
            raise OSError(
                f"cannot connect to {address}: {reason}; start firmware-sim serve --listen there"
            ) from error
        self._socket.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)

    def write(self, data: bytes) -> None:
        """Send bytes at once."""
        self._socket.sendall(data)

    def read(self, patience: float) -> bytes:
        """Wait for bytes."""
        self._socket.settimeout(patience)
        return _or_end(self._socket.recv(_CHUNK))

    def close(self) -> None:
        """Hang up."""
        self._socket.close()


class Process:
    """The standard streams of a command such as ``firmware-sim serve IMAGE --stdio``."""

    def __init__(self, command: str) -> None:
        """Start the command."""
        self._child = subprocess.Popen(
            shlex.split(command), stdin=subprocess.PIPE, stdout=subprocess.PIPE, bufsize=0
        )
        assert self._child.stdin is not None and self._child.stdout is not None
        self._input, self._output = self._child.stdin, self._child.stdout

    def write(self, data: bytes) -> None:
        """Send bytes at once."""
        self._input.write(data)

    def read(self, patience: float) -> bytes:
        """Wait for bytes."""
        ready, _, _ = select.select([self._output], [], [], patience)
        if not ready:
            raise TimeoutError
        return _or_end(os.read(self._output.fileno(), _CHUNK))

    def close(self) -> None:
        """Hang up, and wait for the command to end; one that does not is killed."""
        self._input.close()
        self._output.close()
        try:
            self._child.wait(timeout=10)
        except subprocess.TimeoutExpired:
            self._child.kill()
            self._child.wait()


def _or_end(data: bytes) -> bytes:
    if not data:
        raise EOFError
    return data
