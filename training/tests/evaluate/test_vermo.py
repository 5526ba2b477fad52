"""VerMo's evaluation: motions are placed, joined and compared as the tables say, and every part of the command runs."""

import json
import tomllib
from pathlib import Path

import pytest
import torch

from troupe_training.cli.main import main
from troupe_training.data.captions import plain_captions
from troupe_training.data.motion import Motion
from troupe_training.data.skeleton import Skeleton
from troupe_training.data.store import ClipStore, Segments
from troupe_training.evaluate.bench import Sampling
from troupe_training.evaluate.vermo.answers import Clip, world
from troupe_training.evaluate.vermo.continuation import Window, interpolated, joined, last_velocity, moved, on_way
from troupe_training.evaluate.vermo.continuation import windows_of as gaps_of
from troupe_training.evaluate.vermo.motionbricks import filled, of_pack
from troupe_training.evaluate.vermo.nearest import WINDOW, nearest, windows_of
from troupe_training.evaluate.vermo.text import named_by
from troupe_training.models.vermo.frames import Body
from troupe_training.train.vermo.corpus import Crop, Motions

BODY = Body(
    Skeleton(
        names=["Hips", "Head", "Foot"],
        parents=[-1, 0, 0],
        offsets=[[0.0, 0, 0], [0.0, 0.6, 0.1], [0.1, -0.9, 0]],
        left_axis=[1.0, 0, 0],
    )
)


def walk(frames: int, speed: float, turn: float) -> Clip:
    """A stiff body that walks along an arc."""
    state = torch.cat([torch.tensor([1.0, 0, 0, 0, 1, 0]).repeat(3), torch.tensor([0.0, speed, turn, 0.9])])
    pose, root = BODY.frames(state.expand(1, frames, -1))
    return Clip(pose[0], root[0])


def test_a_motion_is_moved_as_a_whole():
    clip, to = walk(20, 1.2, 0.5), torch.tensor([3.0, 7.0, -2.0, 0.0, 1.0])  # heading +X
    there = moved(clip, 5, to)
    assert torch.allclose(there.root[5, [0, 2, 3, 4]], to[[0, 2, 3, 4]], atol=1e-5)
    assert torch.allclose(there.root[:, 1], clip.root[:, 1])
    a, b = (world(c).flatten(0, 1) for c in (clip, there))
    exact = "donot_use_mm_for_euclid_dist"
    assert torch.allclose(torch.cdist(a, a, compute_mode=exact), torch.cdist(b, b, compute_mode=exact), atol=1e-3)
    assert torch.allclose(there.joints, clip.joints, atol=1e-5)
    step = there.root[6, [0, 2]] - there.root[5, [0, 2]]
    assert step[0] == pytest.approx(1.2 / 30, abs=1e-4) and step[1] == pytest.approx(0.0, abs=1e-3)


def test_the_last_velocity_follows_an_arc_exactly():
    clip = walk(40, 1.2, 0.8)
    window = Window(Crop(0, 0, 10), clip, 16, 0)
    went_on = last_velocity(BODY)(window, 0)
    assert torch.allclose(world(went_on), world(clip), atol=1e-3)


def test_interpolation_ends_where_the_gap_does_and_a_joined_motion_too():
    clip = walk(40, 1.2, 0.8)
    window = Window(Crop(0, 0, 10), clip, 8, 8)
    made = interpolated(BODY)(window, 0)
    assert made.pose.shape == clip.pose.shape
    assert torch.allclose(made.root[[7, 32]], clip.root[[7, 32]], atol=1e-5)
    slow = walk(40, 0.6, 0.8)
    closed = joined(slow, window)
    assert torch.allclose(closed.root[32, [0, 2]], clip.root[32, [0, 2]], atol=1e-5)
    assert torch.equal(closed.root[:7], slow.root[:7])
    steps = (closed.root[8:32] - slow.root[8:32] - closed.root[7:31] + slow.root[7:31])[:, [0, 2]]
    assert torch.allclose(steps, steps[:1].expand_as(steps), atol=1e-5)


def test_poses_on_another_way_turn_with_it_and_take_its_height():
    clip, slow = walk(40, 1.2, 0.8), walk(40, 0.6, -0.3)
    way = Clip(clip.pose, clip.root + torch.tensor([0.0, 0.1, 0.0, 0.0, 0.0]))
    placed = on_way(slow, way)
    assert torch.allclose(world(placed), world(clip) + torch.tensor([0.0, 0.1, 0.0]), atol=1e-4)
    assert torch.equal(placed.root, way.root)


def test_a_gap_that_is_filled_with_the_captured_segment_is_the_captured_clip(cache: Path):
    store = ClipStore(cache, "train")
    motions = Motions(store, None, store.clips)
    windows = gaps_of(motions, "inbetween", 3)
    shapes: list[tuple[int, ...]] = []

    def captured_again(segments: Segments, frames: int, _: Sampling) -> Motion:
        shapes.append((frames, *segments.pose.shape[:2]))
        return Motion.of(segments)

    clips = filled(captured_again, motions, windows, Sampling())
    assert shapes == [(4 + 48 + 1, 3, 53)]
    for clip, window in zip(clips, windows, strict=True):
        assert clip.pose.shape == window.truth.pose.shape
        assert torch.allclose(world(clip), world(window.truth), atol=1e-4)
        assert torch.allclose(clip.root, window.truth.root, atol=1e-4)


def test_a_gap_is_pinned_to_what_is_given_on_either_side(cache: Path):
    store = ClipStore(cache, "train")
    motions = Motions(store, None, store.clips)
    windows = gaps_of(motions, "inbetween", 2)

    def astray(segments: Segments, _: int, __: Sampling) -> Motion:
        truth = Motion.of(segments)
        return Motion(truth.root + torch.tensor([0.5, 0.0, 0.2]), truth.rotations)

    for clip, window in zip(filled(astray, motions, windows, Sampling()), windows, strict=True):
        error = (world(clip) - world(window.truth)).norm(dim=-1).mean(-1)
        assert torch.equal(error[:16], torch.zeros(16)) and torch.equal(error[64:], torch.zeros(16))
        # The offset is the same at both ends, so pins take it out of every frame between.
        assert float(error.max()) < 1e-4


def test_a_training_clip_is_at_distance_zero_and_another_is_not():
    seen, other = windows_of(walk(80, 1.2, 0.1), 4), windows_of(walk(60, 2.4, 0.1), 8)
    assert seen.shape[1:] == (4, 3, 3) and len(seen) == (80 - WINDOW) // 4 + 1
    assert float(nearest(seen[:3], seen).max()) < 1e-3
    ahead = 1.2 / 30 * (0 + 10 + 21 + 31) / 4
    assert float(nearest(other, seen).mean()) == pytest.approx(ahead, rel=0.02)


def test_a_text_names_what_its_plain_captions_say():
    names = [("walk", "angry"), ("walk", "sad"), ("run", "angry")]
    for name in names:
        assert all(name in named_by(text, names) for text in plain_captions(*name))
    assert named_by("a person walks angrily", names) == {("walk", "angry")}
    assert named_by("a person walk angrily", names) == set()


def test_every_part_is_measured(vermo_run: Path, cache: Path, tmp_path: Path):
    out = tmp_path / "figures.json"
    pack = tmp_path / "pack"
    where = ["--run", str(vermo_run), "--cache", str(cache), "--out", str(pack)]
    assert main(["vermo", "export", *where, "--licence", "CC0-1.0", "--name", "tiny"]) == 0
    table = tomllib.loads((pack / "pack.toml").read_text())["vermo"]
    assert (table["content_guidance"], table["style_guidance"]) == (2.0, 3.0)
    assert "like an old person" in (pack / "styles.txt").read_text().splitlines()
    bricks = tmp_path / "bricks"
    assert main(["random-pack", "--preset", "test", "--out", str(bricks), "--like", str(pack)]) == 0
    sizes = ["--max-windows", "3", "--samples", "2", "--json", str(out), "--markdown", str(tmp_path / "figures.md")]
    sizes += ["--motionbricks", str(bricks)]
    assert main(["vermo", "evaluate", "--run", str(vermo_run), "--cache", str(cache), "--parts", "train", *sizes]) == 0
    figures = json.loads(out.read_text())["figures"]
    assert set(figures["reconstruction"]) == {"train, first stage", "train, flow of 4 steps", "train, flow of 28 steps"}
    gaps = figures["continuation"]
    assert gaps["prediction, train: vermo"]["diversity"] > 0.0
    assert "prediction, train: motionbricks" not in gaps
    assert gaps["inbetween, train: vermo, root of motionbricks"]["windows"] == 3
    assert {row["windows"] for row in gaps.values()} == {3}
    # Its gaps end at the frame that it is given; the last velocity does not lead there.
    assert gaps["inbetween, train: motionbricks"]["fde"] < gaps["inbetween, train: last velocity"]["fde"]
    assert gaps["inbetween, train: motionbricks, drawn"]["diversity"] > 0.0
    assert figures["text"]["train: captured"]["fid"] == pytest.approx(0.0, abs=1e-6)
    assert 0.0 <= figures["description"]["train"]["content"] <= 1.0
    assert figures["nearest"]["train: captured"]["mean"] >= 0.0
    assert "R@1, pool 32" in (tmp_path / "figures.md").read_text()

    again = tmp_path / "pack.json"
    packed = ["--run", str(vermo_run), "--cache", str(cache), "--parts", "train", "--max-windows", "3"]
    packed += ["--pack", str(pack), "--json", str(again)]
    assert main(["vermo", "evaluate", *packed, "--measured", "text"]) == 0
    report = json.loads(again.read_text())
    assert report["steps"] == json.loads(out.read_text())["steps"]
    texts = report["figures"]["text"]
    assert texts["train: captured"] == pytest.approx(figures["text"]["train: captured"])
    assert 0.0 <= texts["train: vermo"]["both"] <= min(texts["train: vermo"][key] for key in ("content", "style"))
    with pytest.raises(SystemExit, match="only the part text can be measured of a pack"):
        main(["vermo", "evaluate", *packed, "--measured", "description"])

    assert main(["vermo", "card", "--pack", str(pack), "--evaluations", str(out)]) == 0
    card = (pack / "README.md").read_text()
    assert "| train, flow of 4 steps |" in card and "### Distance to training clips" in card
    noted = tomllib.loads((pack / "pack.toml").read_text())["evaluation"]
    assert noted["nearest_train_captured"] == pytest.approx(figures["nearest"]["train: captured"], rel=1e-4)
    report = json.loads(out.read_text())
    assert "inbetween, train: motionbricks, drawn | 3 |" in card
    report["steps"]["tokenizer_steps"] += 1
    out.write_text(json.dumps(report))
    with pytest.raises(SystemExit, match="the figures are of tokenizer_steps"):
        main(["vermo", "card", "--pack", str(pack), "--evaluations", str(out)])


def test_a_pack_of_another_body_is_refused(cache: Path):
    with pytest.raises(SystemExit, match="moves another body"):
        of_pack(Path(__file__).parents[3] / "models" / "human", ClipStore(cache, "train").skeleton, 1)
