"""A program without numpy that answers with Λ = 0, or has the fault that its first argument names."""

import os
import signal
import struct
import sys

fault = sys.argv[1] if len(sys.argv) > 1 else ""


def send(kind: int, code: int, body: bytes) -> None:
    sys.stdout.buffer.write(struct.pack("=QIi", len(body), kind, code) + body)
    sys.stdout.buffer.flush()


if fault == "unlicensed":
    sys.exit("there is no license")
while fault == "sleep":
    signal.pause()
if fault == "print":
    print("Welcome to my solver!", flush=True)
while head := sys.stdin.buffer.read(16):
    length, kind, _ = struct.unpack("=QIi", head)
    body = sys.stdin.buffer.read(length)
    if kind == 1:
        send(1, 0, struct.pack("=6i", 2 if fault == "version" else 1, 0, 0, 0, 127, 0) + b"zeros\n0.1")
    elif kind == 2:
        (n_rows,) = struct.unpack_from("=q", body, 8)
        send(2, 7 if fault == "refuse" else 0, struct.pack("=d", 0.0) + b"no")
    else:
        if fault == "exit":
            sys.exit(3)
        if fault == "license":
            sys.exit("checking\nlicense \x1bexpired\n")  # on standard error, with exit code 1
        if fault == "crash":
            os.kill(os.getpid(), signal.SIGSEGV)
        while fault == "hang":
            signal.pause()
        if fault == "garbage":
            print("iteration 1: fine", flush=True)
        count = n_rows + {"short": -1, "long": 1}.get(fault, 0)
        send(3, 0, struct.pack("=qqd", 0, count, 1e-3) + bytes(8 * count))
