"""Words in Python: sampling, parts of a motion, the answers of both servers, and what clients note."""

import json
import threading
from collections.abc import Iterator
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path

import numpy as np
import pytest

from troupe_bench.body import PART, read_frames, read_frames_header, write_frames
from troupe_bench.machine import ROOT
from troupe_bench.programs import Failed
from troupe_bench.settings import Settings, python_settings
from troupe_bench.store import Store
from troupe_bench.vermo import Asked, Sampling, VerMo, choose, step64
from troupe_bench.words import Skeleton, best_options, gap, matrices
from troupe_bench.words_load import LENGTHS, SENTENCES, Target, Troupe, Words, load, words

PACK = ROOT / "models" / "vermo"
GREEDY = Sampling(0.0, 0, 1.0, 1.1)
NONE = np.array([], np.int64)


@pytest.fixture(scope="module")
def model() -> VerMo:
    return VerMo(PACK)


def drawn(logits: np.ndarray, sampling: Sampling, count: int) -> np.ndarray:
    rng = np.random.default_rng(3)
    chosen = [choose(logits, NONE, sampling, rng.random()) for _ in range(count)]
    return np.bincount(chosen, minlength=len(logits)) / count


def test_draws_follow_the_shares_of_what_top_p_and_top_k_leave():
    logits = np.log(np.array([0.1, 0.5, 0.15, 0.25], np.float32))
    np.testing.assert_allclose(drawn(logits, Sampling(1.0, 0, 1.0, 1.0), 20_000), [0.1, 0.5, 0.15, 0.25], atol=0.02)
    np.testing.assert_allclose(drawn(logits, Sampling(1.0, 0, 0.6, 1.0), 20_000), [0, 2 / 3, 0, 1 / 3], atol=0.02)
    np.testing.assert_allclose(drawn(logits, Sampling(1.0, 3, 1.0, 1.0), 20_000), [0, 5 / 9, 1 / 6, 5 / 18], atol=0.02)
    np.testing.assert_allclose(drawn(logits, Sampling(0.5, 2, 1.0, 1.0), 20_000), [0, 0.8, 0, 0.2], atol=0.02)


def test_a_flat_nucleus_is_not_cut_where_it_is_first_looked_at():
    shares = drawn(np.zeros(1000, np.float32), Sampling(1.0, 0, 0.9, 1.0), 20_000)
    assert 890 <= int((shares > 0).sum()) <= 901


def test_repeated_codes_are_weakened():
    logits = np.array([1.0, 1.2, -1.0], np.float32)
    assert choose(logits, NONE, GREEDY, 0.5) == 1
    assert choose(logits, np.array([1]), Sampling(0.0, 0, 1.0, 1.5), 0.5) == 0
    below = np.array([-1.0, -1.2], np.float32)
    assert choose(below, np.array([0]), Sampling(0.0, 0, 1.0, 1.5), 0.5) == 1
    assert logits.tolist() == np.float32([1.0, 1.2, -1.0]).tolist()


def test_the_cache_gives_what_reading_the_whole_message_gives(model: VerMo):
    asked = Asked("an angry person kicks", 40, 1, model.sampling)
    with_cache = list(model.tokens(asked))
    message, codes = model.prompt(asked.text, 10), []
    for place in range(10):
        logits = model._read(np.zeros(model.shape, np.float32), message, 0)[model.codes]
        unit = (step64(step64(1, 0), place) >> 11) / 2**53
        codes.append(choose(logits, np.array(codes[-8:], np.int64), model.sampling, unit))
        message = [*message, model.codes.start + codes[-1]]
    assert with_cache == codes and len(set(codes)) > 3
    whole_cache = VerMo(PACK, cache_unit=model.positions)
    assert list(whole_cache.tokens(asked)) == with_cache


def test_parts_are_the_whole_motion_cut_where_it_was_asked_to_end(model: VerMo):
    asked = Asked("someone dances", 130, 5, model.sampling)
    parts, whole = list(model.parts(asked)), model.whole(asked)
    assert [len(part) for part in parts] == [16, 32, 32, 32, 18]
    np.testing.assert_allclose(np.concatenate([part.root for part in parts]), whole.root, atol=1e-5)
    np.testing.assert_allclose(np.concatenate([part.rotations for part in parts]), whole.rotations, atol=1e-5)
    again = np.concatenate([part.root for part in model.parts(asked)])
    np.testing.assert_array_equal(again, np.concatenate([part.root for part in parts]))
    other = model.whole(Asked(asked.text, 130, 6, model.sampling))
    assert np.abs(other.root - whole.root).max() > 0.01


def test_what_the_pack_does_not_take_is_refused(model: VerMo):
    with pytest.raises(ValueError, match="text: is 0 pieces"):
        model.prompt("", 10)
    with pytest.raises(ValueError, match="text: is"):
        model.prompt("xyz " * 40, 10)
    with pytest.raises(ValueError, match="frames: make 65 tokens"):
        model.prompt("someone walks", 65)


def test_frames_are_read_as_they_were_written():
    root, rotations = np.arange(10, dtype="<f4").reshape(2, 5), np.arange(24, dtype="<f4").reshape(2, 12)
    body = write_frames(root, rotations)
    frames, size = read_frames_header(body[: PART.size])
    assert (frames, size) == (2, len(body) - PART.size)
    again = read_frames(body[PART.size :], frames)
    np.testing.assert_array_equal(again[0], root)
    np.testing.assert_array_equal(again[1], rotations)
    assert read_frames_header(write_frames(None, None)) == (0, 0)
    for broken in (b"", b"TBW1", b"XXXX" + body[4 : PART.size]):
        with pytest.raises(ValueError, match="answer"):
            read_frames_header(broken)


def test_a_hundred_requests_are_all_different():
    asked = [words(index) for index in range(100)]
    assert len({(one.text, one.frames) for one in asked}) == len(SENTENCES) * len(LENGTHS) == 100
    assert words(100).text == words(0).text and words(100).seed != words(0).seed
    assert {words(index).frames for index in range(4)} == set(LENGTHS)


def test_joints_of_both_kinds_of_answer_are_the_same():
    skeleton = Skeleton(PACK)
    joints = len(skeleton.parents)
    rng = np.random.default_rng(1)
    quats = rng.normal(size=(3, joints, 4))
    quats /= np.linalg.norm(quats, axis=-1, keepdims=True)
    root = rng.normal(size=(3, 3))
    frames = {"root_positions": root.ravel().tolist(), "rotations": quats.ravel().tolist()}
    theirs = skeleton.of_troupe([(3, json.dumps({"frames": frames}).encode())])
    world = matrices(quats)
    for joint, parent in enumerate(skeleton.parents):
        if parent >= 0:
            world[:, joint] = world[:, parent] @ world[:, joint]
    columns = np.concatenate([world[..., 0], world[..., 1]], -1).reshape(3, -1)
    body = write_frames(np.pad(root, ((0, 0), (0, 2))).astype("<f4"), columns.astype("<f4"))
    ours = skeleton.of_python([(3, body[PART.size :])])
    assert gap(theirs, ours, Words("", 3, 1)) < 1e-5
    bone = np.linalg.norm(theirs[:, 1] - theirs[:, 0], axis=-1)
    np.testing.assert_allclose(bone, np.linalg.norm(skeleton.offsets[1]), atol=1e-6)
    with pytest.raises(Failed, match="joints came"):
        gap(theirs, ours[:2], Words("", 3, 1))
    ours[1, 2, 0] = np.nan
    with pytest.raises(Failed, match="not finite"):
        gap(theirs, ours, Words("", 3, 1))


class Answering(BaseHTTPRequestHandler):
    """Answers as both servers do: half of the frames, then the other half, with `short` one less where the seed is odd."""

    protocol_version = "HTTP/1.1"
    short = False
    asked: list[dict] = []  # noqa: RUF012 - shared on purpose

    def do_POST(self) -> None:
        body = json.loads(self.rfile.read(int(self.headers["content-length"])))
        self.asked.append(body)
        is_troupe = self.path == "/v1/generate"
        count = body["prompt"]["frame_count"] if is_troupe else body["frame_count"]
        if count == 0:
            self.send_response(400)
            self.send_header("content-length", "7")
            self.end_headers()
            self.wfile.write(b"refused")
            return
        self.send_response(200)
        self.send_header("transfer-encoding", "chunked")
        self.end_headers()
        for frames in (count // 2, count - count // 2 - (self.short and body["seed"] % 2)):
            if is_troupe:
                part = json.dumps({"is_last": False, "frames": {"frame_count": frames}}, separators=(",", ":"))
                self.chunk(part.encode() + b"\n")
            else:
                self.chunk(write_frames(np.zeros((frames, 5), "<f4"), np.zeros((frames, 126), "<f4")))
        self.chunk(b'{"is_last":true}\n' if is_troupe else write_frames(None, None))
        self.chunk(b"")

    def chunk(self, body: bytes) -> None:
        self.wfile.write(b"%x\r\n%s\r\n" % (len(body), body))

    def log_message(self, *_: object) -> None:
        pass


@pytest.fixture
def url() -> Iterator[str]:
    Answering.asked, Answering.short = [], False
    server = ThreadingHTTPServer(("127.0.0.1", 0), Answering)
    thread = threading.Thread(target=server.serve_forever)
    thread.start()
    yield f"http://127.0.0.1:{server.server_port}"
    server.shutdown()
    thread.join()
    server.server_close()


@pytest.mark.parametrize("kind", ["troupe", "fastapi"])
def test_clients_count_frames_and_time_answers(url: str, kind: str):
    target = Troupe(url, "vermo") if kind == "troupe" else Target(url)
    assert [frames for frames, _ in target.ask(Words("someone walks", 61, 7), 0.0)] == [30, 31]
    sent = Answering.asked[0]
    assert sent["seed"] == 7 and sent.get("sampling", sent)["temperature"] == 0.0
    with pytest.raises(ValueError, match="400 refused"):
        list(target.ask(Words("", 0, 1)))
    run = load(target, 3, 0.1, 0.4)
    assert run["failed"] == 0 and run["requests"] > 3
    assert run["frames"] >= 0.4 * run["frames_per_s"] > 0
    assert 0.0 < run["first_frames_ms"]["p50"] <= run["answer_ms"]["p50"] <= run["answer_ms"]["p99"] < 1000
    Answering.short = True
    run = load(target, 2, 0.0, 0.4)
    assert run["failed"] > 0 and "came" in run["examples"][0]


def test_the_fastest_settings_of_fastapi_are_measured(tmp_path: Path):
    store = Store(tmp_path, "words")
    with pytest.raises(Failed, match="no settings"):
        best_options(store)
    tried = python_settings("words", False)
    for index, options in enumerate(tried):
        store.add({"target": "fastapi", "options": options}, {"frames_per_s": 100.0 + index % 3})
    store.add({"target": "fastapi", "clients": 32, "repeat": 0}, {"frames_per_s": 900.0})
    assert best_options(store) == tried[2]
    assert Settings().words_clients == (1, 8, 32)
