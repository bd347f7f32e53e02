"""A message arrives whole or not at all: within its time and size limits, and from a writer that is still alive."""

import os
import threading
import time
from collections.abc import Iterator

import pytest
from proxbench.bench.isolation.pipe import NoMessageError, is_readable, read_message, read_object, write_message


class Pipe:
    """Both ends of a pipe. The reading one never blocks, so that reading without waiting first is an error."""

    def __init__(self) -> None:
        self.out, self.into = os.pipe()
        os.set_blocking(self.out, False)
        self._open = {self.out, self.into}

    def close(self, *ends: int) -> None:
        for end in self._open.intersection(ends or self._open):
            os.close(end)
            self._open.remove(end)


@pytest.fixture
def pipe() -> Iterator[Pipe]:
    made = Pipe()
    yield made
    made.close()


@pytest.fixture
def exit_pipe() -> Iterator[Pipe]:
    made = Pipe()
    yield made
    made.close()


def soon() -> float:
    return time.monotonic() + 0.05


@pytest.mark.parametrize("size", [0, 1, 3 * 2**20 + 7])
def test_a_message_of_any_size_is_read_as_it_was_written(pipe: Pipe, size: int) -> None:
    content = os.urandom(size)
    writer = threading.Thread(target=write_message, args=(pipe.into, content))
    writer.start()
    assert read_message(pipe.out, size, time.monotonic() + 30.0) == content
    writer.join()


def test_messages_are_read_one_by_one(pipe: Pipe) -> None:
    for content in (b"first", b"", b"third"):
        write_message(pipe.into, content)
    assert [read_message(pipe.out) for _ in range(3)] == [b"first", b"", b"third"]
    assert not is_readable(pipe.out, 0.0)


@pytest.mark.parametrize("part", [b"", b"\0\0\0", b"\0\0\0\0\0\0\0\x05", b"\0\0\0\0\0\0\0\x05four"])
def test_a_message_that_is_incomplete_at_the_deadline_is_a_timeout(pipe: Pipe, part: bytes) -> None:
    os.write(pipe.into, part)
    with pytest.raises(TimeoutError):
        read_message(pipe.out, deadline=soon())


@pytest.mark.parametrize("part", [b"", b"\0\0\0", b"\0\0\0\0\0\0\0\x05four"])
def test_message_of_a_closed_writer_is_incomplete(pipe: Pipe, part: bytes) -> None:
    os.write(pipe.into, part)
    pipe.close(pipe.into)
    with pytest.raises(EOFError):
        read_message(pipe.out, deadline=time.monotonic() + 30.0)


def test_reading_ends_when_the_writer_exits_even_if_the_pipe_stays_open(pipe: Pipe, exit_pipe: Pipe) -> None:
    os.write(pipe.into, b"\0\0\0\0\0\0\0\x05four")
    exit_pipe.close(exit_pipe.into)
    with pytest.raises(EOFError):
        read_message(pipe.out, deadline=time.monotonic() + 30.0, exit_descriptor=exit_pipe.out)


def test_data_written_before_the_writer_exits_are_read(pipe: Pipe, exit_pipe: Pipe) -> None:
    write_message(pipe.into, b"last words")
    exit_pipe.close(exit_pipe.into)
    assert read_message(pipe.out, exit_descriptor=exit_pipe.out) == b"last words"


def test_a_message_is_no_larger_than_allowed(pipe: Pipe) -> None:
    for _ in range(2):
        write_message(pipe.into, b"seven..")
    assert read_message(pipe.out, 7) == b"seven.."
    with pytest.raises(NoMessageError, match="a message of 7 bytes exceeds the limit of 6"):
        read_message(pipe.out, 6)


@pytest.mark.parametrize("content", [b"", b"{", b"[1]", b"null", b"\xff", b"[" * 100_000])
def test_only_json_objects_are_messages(pipe: Pipe, content: bytes) -> None:
    writer = threading.Thread(target=write_message, args=(pipe.into, content))
    writer.start()
    with pytest.raises(NoMessageError, match=r"not (a )?JSON"):
        read_object(pipe.out, 2**20, time.monotonic() + 30.0)
    writer.join()


def test_a_json_object_is_read_within_its_size(pipe: Pipe) -> None:
    for _ in range(2):
        write_message(pipe.into, b'{"a": 1}')
    assert read_object(pipe.out, 8, soon()) == {"a": 1}
    with pytest.raises(NoMessageError):
        read_object(pipe.out, 7, soon())


def test_pipe_is_readable_after_data_or_end_of_file(pipe: Pipe) -> None:
    assert not is_readable(pipe.out, 0.01)
    assert not is_readable(pipe.out, -1.0)
    os.write(pipe.into, b"x")
    assert is_readable(pipe.out, float("inf"))
    os.read(pipe.out, 1)
    pipe.close(pipe.into)
    assert not is_readable(pipe.out, 0.0) or os.read(pipe.out, 1) == b""


@pytest.mark.parametrize("seconds", [0.0, -1.0, -1e9])
def test_expired_deadline_does_not_wait(pipe: Pipe, seconds: float) -> None:
    began = time.monotonic()
    assert not is_readable(pipe.out, seconds)
    assert time.monotonic() - began < 0.9
