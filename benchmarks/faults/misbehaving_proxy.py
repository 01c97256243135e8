"""HTTP proxy in front of an object store that fails, delays and repeats requests by chance.

    python benchmarks/faults/misbehaving_proxy.py --store-port 10000 --rate 0.2

prints its port, and at the end (SIGTERM) the bytes of all requests, and how often it did what:

- error: the request is not passed on; the answer is 503.
- lost: the request is passed on; the connection is closed without an answer.
- late: the connection is closed at once; the request is passed on up to 2 s later.
- delayed: the request is passed on up to 0.5 s later.
- doubled: the request is passed on twice; the answer is that to the second one.
"""

from __future__ import annotations

import argparse
import asyncio
import json
import random
import signal
from collections import Counter
from typing import Any

FAULTS = ("error", "lost", "late", "delayed", "doubled")
"""Names of what the proxy does besides passing on."""
MAX_DELAY_S, MAX_LATE_S = 0.5, 2.0
"""Maximum delay of a request, and of one whose connection was closed, s."""
MAX_HEAD_BYTES = 1 << 16
"""Maximum size of the head of a request."""
UNAVAILABLE = b"HTTP/1.1 503 Service Unavailable\r\nContent-Length: 0\r\nConnection: close\r\n\r\n"
"""Answer of a store that is overloaded."""


class Proxy:
    """Passes on requests, but for some of them.

    Args:
        port: Of the store, on this machine.
        rate: Share of the requests with a fault.
        seed: Of the choice.
    """

    def __init__(self, port: int, rate: float, seed: int) -> None:
        self._port, self._rate, self._rng = port, rate, random.Random(seed)
        self.counts: Counter[str] = Counter()
        self._pending: set[asyncio.Task[Any]] = set()  # The event loop does not keep them.

    async def serve(self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        """Answer one request, and close the connection.

        Args:
            reader: Of the connection.
            writer: Of the connection.
        """
        self._keep(asyncio.current_task())
        try:
            request = await _read_request(reader)
            self.counts["bytes"] += len(request)
            answer = await self._answer(request) if request else b""
            writer.write(answer)
            await writer.drain()
        except (OSError, asyncio.IncompleteReadError):
            pass  # The client was killed.
        finally:
            writer.close()

    async def _answer(self, request: bytes) -> bytes:
        fault = self._rng.choice(FAULTS) if self._rng.random() < self._rate else "passed"
        self.counts[fault] += 1
        if fault == "error":
            return UNAVAILABLE
        if fault == "late":
            self._pass_later(request, self._rng.uniform(0, MAX_LATE_S))
            return b""
        if fault == "delayed":
            await asyncio.sleep(self._rng.uniform(0, MAX_DELAY_S))
        if fault == "doubled":
            await self._pass(request)
        answer = await self._pass(request)
        return b"" if fault == "lost" else answer

    def _pass_later(self, request: bytes, delay_s: float) -> None:
        async def wait_and_pass() -> bytes:
            await asyncio.sleep(delay_s)
            return await self._pass(request)

        self._keep(asyncio.create_task(wait_and_pass()))

    def _keep(self, task: asyncio.Task[Any] | None) -> None:
        assert task is not None
        self._pending.add(task)
        task.add_done_callback(self._pending.discard)

    async def _pass(self, request: bytes) -> bytes:
        reader, writer = await asyncio.open_connection("127.0.0.1", self._port)
        writer.write(request)
        await writer.drain()
        answer = await reader.read()
        writer.close()
        return answer


async def _read_request(reader: asyncio.StreamReader) -> bytes:
    """Read one request, which asks the store to close the connection after its answer."""
    head = await reader.readuntil(b"\r\n\r\n")
    lines = head[:-4].split(b"\r\n")
    fields = [line.split(b":", 1) for line in lines[1:]]
    length = next((int(v) for k, v in fields if k.strip().lower() == b"content-length"), 0)
    kept = [line for line in lines if not line.lower().startswith(b"connection:")]
    body = await reader.readexactly(length)
    return b"\r\n".join([*kept, b"Connection: close", b"", body])


async def _run(arguments: argparse.Namespace) -> None:
    proxy, stopped = Proxy(arguments.store_port, arguments.rate, arguments.seed), asyncio.Event()
    asyncio.get_running_loop().add_signal_handler(signal.SIGTERM, stopped.set)
    server = await asyncio.start_server(proxy.serve, "127.0.0.1", 0, limit=MAX_HEAD_BYTES)
    print(server.sockets[0].getsockname()[1], flush=True)
    await stopped.wait()
    server.close()
    print(json.dumps(proxy.counts), flush=True)


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--store-port", type=int, required=True)
    parser.add_argument("--rate", type=float, default=0.2, help="share of requests with a fault")
    parser.add_argument("--seed", type=int, default=0)
    asyncio.run(_run(parser.parse_args()))


if __name__ == "__main__":
    main()
