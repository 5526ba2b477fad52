"""Servers die, Redis stands still or forgets, a cable is cut: characters walk on, and no session is written by two servers.

Twelve characters walk through all of it. `make cluster-figure` does the same with 300, for three minutes.
"""

import signal
import time

import pytest
from processes import until
from replicas import Cluster, lacking
from routers import NAMES

RESUMED_S = 2.0
SEAM = 1.25
"""A seam is no larger than the largest step without one, and a quarter."""
pytestmark = pytest.mark.skipif(lacking() is not None, reason=str(lacking()))


@pytest.fixture(scope="module")
def cluster(tmp_path_factory):
    """Three servers."""
    of = Cluster(tmp_path_factory.mktemp("cluster"))
    yield of
    of.stop()


@pytest.fixture
def crowd(cluster):
    """Twelve characters on six streams, which walk."""
    from crowd import Crowd  # It needs the client.

    of = Crowd(cluster.address, 12, 6)
    try:
        until(lambda: of.all_walk(0), "all walk")
        time.sleep(2)
        yield of
    finally:
        of.end()


def check(cluster: Cluster, crowd, breaks: bool = True):
    """What holds after every failure. Without `breaks` no one waited for half a second."""
    since = time.monotonic()
    until(lambda: crowd.all_walk(since), "all still walk", 30)
    report = crowd.end()
    print(f"breaks {sorted(report.breaks_s)[-5:]}, usual {report.usual}, seams {report.seams}")
    assert report.lost == []
    assert report.backwards == 0
    assert breaks or not report.breaks_s, report.breaks_s
    assert max(report.breaks_s, default=0) <= RESUMED_S, sorted(report.breaks_s)
    for seam, usual in zip(report.seams, report.usual, strict=True):
        assert seam <= usual * SEAM
    assert cluster.witness.faults == []
    assert cluster.witness.looks > 0


def kill(cluster: Cluster, crowd, name: str):
    """Kills a server, waits until its characters walk elsewhere, and starts it again."""
    cluster.replicas[name].kill()
    died = time.monotonic()
    until(lambda: crowd.all_walk(died), "all walk again", 30)
    cluster.replicas[name].start()
    cluster.replicas[name].wait_ready()


def test_servers_that_are_killed(cluster, crowd):
    for name in NAMES:
        kill(cluster, crowd, name)
        # HAProxy sees it again.
        time.sleep(1.5)
    assert crowd.report.breaks_s, "no one noticed anything"
    check(cluster, crowd)
    assert {owner for one in cluster.witness.owners.values() for owner in one.values()} == set(NAMES)


def test_redis_stands_still(cluster, crowd):
    cluster.redis.pause(5)
    time.sleep(2)
    check(cluster, crowd, breaks=False)


def test_redis_forgets_everything_and_then_a_server_dies(cluster, crowd):
    cluster.redis.restart_empty()
    time.sleep(3)
    kill(cluster, crowd, cluster.witness.owner(crowd.names[0][0]))
    check(cluster, crowd)


def test_a_server_that_is_cut_off_from_redis_goes_on(cluster, crowd):
    for name in NAMES:
        cluster.spots[name].cut()
    time.sleep(4)
    for name in NAMES:
        cluster.spots[name].heal()
    time.sleep(3)
    check(cluster, crowd, breaks=False)


def test_a_session_that_another_server_took_over_meanwhile_follows_it(cluster, crowd):
    import troupe

    session = crowd.names[0][0]
    old = cluster.witness.owner(session)
    others = [name for name in NAMES if name != old]
    stream = next(names for names in crowd.names if session in names)
    lost = cluster.replicas[old].leases("lost")
    cluster.spots[old].cut()
    # After its lease another server may have it.
    with troupe.Client(cluster.replicas[others[0]].address) as other:
        until(lambda: takes(other, stream), "another server takes them", 10)
        assert cluster.witness.owner(session) == others[0]
    cluster.spots[old].heal()
    until(lambda: cluster.replicas[old].leases("lost") >= lost + len(stream), "the old one learns of it", 10)
    healed = time.monotonic()
    until(lambda: crowd.all_walk(healed), "all walk again", 30)
    assert cluster.witness.owner(session) in others
    check(cluster, crowd)


def takes(client, names: list[str]) -> bool:
    """Whether a server has these sessions. A command takes those that no server has a lease of."""
    from troupe import errors, io
    from troupe.v1 import session_pb2

    commands = [session_pb2.Command(session_id=name, sequence=1, priority=0.5) for name in names]
    answer = client._connection.run(io.ask(io.COMMAND, session_pb2.CommandRequest(commands=commands)))
    return not any(result.problem.reason in errors.PASSING for result in answer.results)


def test_a_server_that_stops_gives_its_sessions_away(cluster, crowd):
    name = cluster.witness.owner(crowd.names[0][0])
    cluster.replicas[name].send(signal.SIGTERM)
    stopped = time.monotonic()
    until(lambda: crowd.all_walk(stopped + 0.5), "all walk again", 20)
    cluster.replicas[name].process.wait(30)
    cluster.replicas[name].start()
    cluster.replicas[name].wait_ready()
    check(cluster, crowd)
