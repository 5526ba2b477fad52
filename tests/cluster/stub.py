"""A server that says its name, for tests of routers: `python stub.py NAME PORT`. SIGUSR1 has it say that it stops."""

import asyncio
import json
import os
import signal
import sys

from hypercorn.asyncio import serve
from hypercorn.config import Config

NAME, PORT = sys.argv[1], int(sys.argv[2])
state = {"is_ready": True, "requests": 0}


async def answer(scope, receive, send):
    """Its name, to requests and WebSockets."""
    if scope["type"] == "lifespan":
        return
    if scope["type"] == "websocket":
        await talk(receive, send)
        return
    while (await receive()).get("more_body"):
        pass
    is_check = scope["path"] == "/readyz"
    state["requests"] += not is_check
    status = 503 if is_check and not state["is_ready"] else 200
    body = {"server": NAME, "protocol": scope["http_version"], "requests": state["requests"]}
    await send({"type": "http.response.start", "status": status, "headers": [(b"content-type", b"application/json")]})
    await send({"type": "http.response.body", "body": json.dumps(body).encode()})


async def talk(receive, send):
    """Says its name, and says it again to each message."""
    await receive()
    await send({"type": "websocket.accept"})
    await send({"type": "websocket.send", "text": NAME})
    while (await receive())["type"] == "websocket.receive":
        await send({"type": "websocket.send", "text": NAME})


async def main():
    """Serves HTTP/1.1, WebSockets and HTTP/2 with prior knowledge, as the real server does."""
    asyncio.get_running_loop().add_signal_handler(signal.SIGUSR1, lambda: state.update(is_ready=False))
    config = Config()
    config.bind = [f"127.0.0.1:{PORT}"]
    config.loglevel = "ERROR"
    await serve(answer, config, shutdown_trigger=asyncio.Event().wait)


if __name__ == "__main__":
    os.environ.pop("PYTHONPATH", None)
    asyncio.run(main())
