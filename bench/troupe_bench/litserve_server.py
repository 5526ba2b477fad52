"""LitServe with dynamic batching: worker processes own the networks and cut batches of the waiting requests.

Bodies are raw bytes both ways: a dependency reads the request's, and the answer is made in the worker.
"""

import argparse
from collections.abc import Sequence
from typing import Annotated, Any

import litserve
from fastapi import Depends, Request, Response

from troupe_bench.cli import add_server_options, read_bodies


async def raw_body(request: Request) -> bytes:
    """The request's bytes, instead of LitServe's JSON."""
    return await request.body()


class MotionApi(litserve.LitAPI):
    """The networks of one pack."""

    def __init__(self, settings: argparse.Namespace, **options: Any):
        super().__init__(**options)
        self.settings = settings

    def setup(self, device: str) -> None:
        """Loads and warms up the networks, in a worker process."""
        from troupe_bench.stages import Stages

        s = self.settings
        self.stages = Stages(s.pack, s.engine, s.threads, group=s.group, spin=s.spin)
        self.stages.warm_up(read_bodies(s.requests), s.max_batch)

    def decode_request(self, request: Annotated[bytes, Depends(raw_body)]) -> bytes:
        """Bytes as they came; the batch is read as a whole."""
        return request

    def batch(self, inputs: Sequence[bytes]) -> list[bytes]:
        """No stacking: rows have lengths of their own."""
        return list(inputs)

    def predict(self, inputs: bytes | list[bytes]) -> list[bytes]:
        """Answers a batch; without batching LitServe gives a single request."""
        return self.stages.run(inputs if isinstance(inputs, list) else [inputs])

    def unbatch(self, output: list[bytes]) -> list[bytes]:
        """One answer for each request."""
        return output

    def encode_response(self, output: bytes) -> Response:
        """The answer's bytes."""
        return Response(output, media_type="application/octet-stream")


def main() -> None:
    """Runs the server until it is stopped."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    add_server_options(parser)
    parser.add_argument("--workers", type=int, default=1, help="worker processes, each with its own networks")
    parser.add_argument("--api-servers", type=int, default=1, help="processes that speak HTTP")
    parser.add_argument("--max-batch", type=int, default=64, help="most requests in a batch")
    parser.add_argument("--batch-timeout", type=float, default=0.002, help="seconds to wait for a fuller batch")
    parser.add_argument("--fast-queue", action="store_true", help="answers over ZeroMQ")
    parser.add_argument("--no-group", dest="group", action="store_false", help="pad a batch to its longest row")
    args = parser.parse_args()
    api = MotionApi(args, max_batch_size=args.max_batch, batch_timeout=args.batch_timeout, api_path="/inbetween")
    server = litserve.LitServer(
        api,
        accelerator="cpu",
        workers_per_device=args.workers,
        fast_queue=args.fast_queue,
        timeout=60,
        disable_openapi_url=True,
    )
    server.run(
        host="127.0.0.1",
        port=args.port,
        num_api_servers=args.api_servers,
        log_level="warning",
        access_log=False,
        generate_client_file=False,
    )


if __name__ == "__main__":
    main()
