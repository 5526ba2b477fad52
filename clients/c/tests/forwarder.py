"""Forwards TCP connections to a server, and breaks all of them at SIGUSR1: forwarder.py HOST:PORT.

It prints the port that it listens on.
"""

import asyncio
import signal
import sys

OPEN: set[asyncio.StreamWriter] = set()


async def copy(reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
    """Copies one direction until it ends."""
    try:
        while data := await reader.read(1 << 16):
            writer.write(data)
            await writer.drain()
    except ConnectionError:
        pass
    writer.close()


def cut() -> None:
    """Breaks all connections, without a word."""
    for writer in OPEN:
        writer.transport.abort()
    OPEN.clear()


async def main() -> None:
    """Listens until it is killed."""
    host, port = sys.argv[1].rsplit(":", 1)

    async def accept(reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        there, back = await asyncio.open_connection(host, int(port))
        OPEN.update((writer, back))
        await asyncio.gather(copy(reader, back), copy(there, writer))

    server = await asyncio.start_server(accept, "127.0.0.1", 0)
    asyncio.get_running_loop().add_signal_handler(signal.SIGUSR1, cut)
    print(server.sockets[0].getsockname()[1], flush=True)
    await server.serve_forever()


asyncio.run(main())
