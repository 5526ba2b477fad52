"""The client for asyncio. All but the calls themselves is as in `troupe`.

async with troupe.aio.Client() as client, await client.crowd(50) as crowd:
step = await crowd.step(30)
"""

from troupe.aio.client import Client
from troupe.aio.live import Crowd, Drive, Session

__all__ = ["Client", "Crowd", "Drive", "Session"]
