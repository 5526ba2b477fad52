"""The pack, and the reference that the server's sampler is tested against.

``engine/tests/unimogen`` holds a tiny pack with random weights and ``reference.json``: requests in metres and world rotations,
noise, schedule, and the motion that they give. `TROUPE_WRITE_FIGURES=1` writes both again.
"""

import json
import os
import shutil
import tomllib
from dataclasses import asdict, replace
from pathlib import Path

import numpy as np
import pytest
import torch

from robot_support import biped as biped_urdf
from troupe_training.cli.main import main
from troupe_training.data.bodies import Body, bends, body_of
from troupe_training.data.neutral import robot_neutral
from troupe_training.data.rotations import matrix_to_quat, matrix_to_six_d, quat_to_matrix
from troupe_training.data.skeleton import Skeleton
from troupe_training.evaluate.unimogen.networks import of_pack
from troupe_training.export.manifest import About
from troupe_training.export.unimogen.adopt import adopt
from troupe_training.export.unimogen.pack import denoiser_of, example, export_pack
from troupe_training.models.unimogen.config import PRESETS
from troupe_training.models.unimogen.diffusion import cosine_signal, row_noise, sampler_steps
from troupe_training.models.unimogen.network import UniMoGen
from troupe_training.models.unimogen.sampler import Character, Denoiser, sample
from troupe_training.models.unimogen.state import BodyKinematics, Path2D, Range, decode, encode
from troupe_training.robots.build import build_robot, describe
from troupe_training.train.unimogen.stage import Trained, load
from unimogen_support import biped, small_rotations

FOLDER = Path(__file__).parents[3] / "engine" / "tests" / "unimogen"
LIMITS = Range(torch.tensor([-0.2, -0.9, -0.2]), torch.tensor([0.2, 0.5, 0.3]))
WORDS = ["old", "run", "walk"]
FRAMES = 20


def robot(folder: Path) -> Body:
    (folder / "toy.urdf").write_text(biped_urdf())
    built = build_robot(describe(folder / "toy.urdf"))
    skeleton = Skeleton(
        built.names, built.parents, built.offsets.round(9).tolist(), [1.0, 0.0, 0.0], robot=built.table()
    )
    skeleton.contact_joints = [built.names.index(name) for name in built.contacts]
    skeleton.contact_clearance_m, skeleton.contact_max_height_m = [0.05] * 4, [0.1] * 4
    return body_of("toy", skeleton, robot_neutral(skeleton))


@pytest.fixture(scope="module")
def bodies(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Body]:
    folder = tmp_path_factory.mktemp("urdf")
    return {body.name: body for body in (biped(3), robot(folder))}


@pytest.fixture(scope="module")
def pack(bodies: dict[str, Body], tmp_path_factory: pytest.TempPathFactory) -> Path:
    torch.manual_seed(0)
    model = UniMoGen(PRESETS["tiny"], len(WORDS))
    for parameter in model.parameters():  # layers that begin at zero would hide what they read
        parameter.data += 0.05 * torch.randn_like(parameter)
    state = {"step": 0, "seconds": 0.0, "history": []}
    trained = Trained(model.eval().requires_grad_(False), WORDS, list(bodies), LIMITS, state)
    out = tmp_path_factory.mktemp("pack") / "tiny"
    about = About("tiny", "0.0.0", "Apache-2.0", ["random weights, for tests"])
    export_pack(out, about, trained, bodies, {"turned": ["walk"], "toy": ["run"]})
    if os.environ.get("TROUPE_WRITE_FIGURES"):
        shutil.rmtree(FOLDER, ignore_errors=True)
        shutil.copytree(out, FOLDER)
        stored = reference(FOLDER, bodies)
        (FOLDER / "reference.json").write_text(json.dumps(stored) + "\n")
    return out


def numbers(values: np.ndarray, digits: int = 6) -> list:
    return np.asarray(values, np.float64).round(digits).tolist()


def request(body: Body, seed: int, guidance: float, past: bool) -> dict:
    """A request as a server gets it: a path, words, and four frames of past in world rotations."""
    rng = np.random.default_rng(seed)
    time = np.arange(FRAMES) / 30.0
    points = np.stack([0.3 * np.sin(time) + 0.2 * seed, 1.2 * time - 0.4], -1)
    stored = {
        "body": body.name,
        "seed": seed * 1_000_000_007,
        "guidance": guidance,
        "style": numbers(rng.random(len(WORDS))),
        "path_m": numbers(points),
        "heading_rad": numbers(0.25 * time + 0.1 * seed),
    }
    if past:
        rotations = torch.from_numpy(small_rotations(rng, 0.2, 4, body.joint_count) @ body.rotations)
        root = np.concatenate([points[:4, :1], np.full((4, 1), body.height_m - 0.02), points[:4, 1:]], -1)
        stored |= {"past_root_m": numbers(root), "past_rotations_wxyz": numbers(matrix_to_quat(rotations).numpy())}
    return stored


def answer(stored: list[dict], denoiser: Denoiser, bodies: dict[str, Body], steps: int) -> list[dict]:
    """The reference sampler's answers to requests in one batch: rows that go in, and the motion that comes out."""
    characters, paths = [], []
    for one in stored:
        body = bodies[one["body"]]
        path = Path2D(torch.tensor([one["path_m"]]), torch.tensor([one["heading_rad"]]))
        given = known = None
        if "past_root_m" in one:
            given = (np.arange(FRAMES) < 4).astype(np.float32)
            world = quat_to_matrix(torch.tensor(one["past_rotations_wxyz"], dtype=torch.float64)).numpy()
            local = matrix_to_six_d(torch.from_numpy(bends(body, world)).float())
            six = torch.cat([local, local[-1:].expand(FRAMES - 4, -1, -1)])[None]
            root = torch.tensor(one["past_root_m"])
            root = torch.cat([root, root[-1:].expand(FRAMES - 4, -1)])[None]
            known = encode(body, root, six, path, LIMITS)[0].numpy()
        style = np.array(one["style"], np.float32)
        features = path.features(body.size_m)[0].numpy()
        characters.append(Character(body, features, style, one["seed"], given, known, one["guidance"]))
        paths.append(path)
    answers = []
    for character, path, rows in zip(characters, paths, sample(denoiser, characters, steps), strict=True):
        kinematics = BodyKinematics(character.body)
        root, local = decode(character.body, torch.from_numpy(rows)[None], path, LIMITS)
        turned = kinematics.turned(local)
        answers.append(
            {
                "path_features": numbers(character.path, 5),
                "known_rows": None if character.known is None else numbers(character.known[:, :4], 5),
                "rows": numbers(rows[:3], 5),  # of the root's place and the first two joints
                "root_m": numbers(root[0], 5),
                "positions_m": numbers(kinematics.positions(root, turned)[0, ::5], 5),
                "rotations_wxyz": numbers(matrix_to_quat(kinematics.rotations(turned))[0, -1], 5),
            }
        )
    return answers


def reference(folder: Path, bodies: dict[str, Body]) -> dict:
    """All of ``reference.json``."""
    stored = [
        request(bodies["turned"], 1, 1.0, True),
        request(bodies["toy"], 2, 2.5, False),
        request(bodies["toy"], 3, 1.0, True),
    ]
    descriptions = {
        name: {"rows": numbers(b.description()), "slots": b.slots()[0].tolist()} for name, b in bodies.items()
    }
    reads = {name: b.slots()[1].astype(int).tolist() for name, b in bodies.items()}
    return {
        "about": "Written by training/tests/export/test_unimogen.py; what is computed: training/troupe_training/models/unimogen.",
        "frames": FRAMES,
        "sampler_steps": 4,
        "steps": {str(n): sampler_steps(n) for n in (1, 2, 4, 8)},
        "signal": cosine_signal().tolist(),
        "noise": [
            {"seed": seed, "row": row, "values": row_noise(seed, row, 4).astype(float).tolist()}
            for seed, row in ((0, 0), (1, 5), (3_000_000_021, 2), (2**64 - 1, 7))
        ],
        "bodies": {name: one | {"reads": reads[name]} for name, one in descriptions.items()},
        "requests": stored,
        "answers": answer(stored, denoiser_of(folder / "denoiser.onnx"), bodies, 4),
    }


def assert_near(found, expected, where: str = "") -> None:
    if isinstance(expected, dict):
        assert found.keys() == expected.keys(), where
        for key, value in expected.items():
            assert_near(found[key], value, f"{where}.{key}")
    elif isinstance(expected, list) and expected and isinstance(expected[0], dict):
        for i, (a, b) in enumerate(zip(found, expected, strict=True)):
            assert_near(a, b, f"{where}[{i}]")
    elif isinstance(expected, (list, float)):
        np.testing.assert_allclose(found, expected, atol=2e-4, err_msg=where)
    else:
        assert found == expected, where


def test_the_reference_is_what_the_sampler_computes(bodies: dict[str, Body], pack: Path):
    stored = json.loads((FOLDER / "reference.json").read_text())
    assert_near(json.loads(json.dumps(reference(FOLDER, bodies))), stored)


def test_the_manifest_tells_bodies_words_and_capabilities(pack: Path):
    manifest = tomllib.loads((pack / "pack.toml").read_text())
    assert (manifest["format"], manifest["family"]) == (2, "unimogen")
    assert manifest["capabilities"] == {"live": True, "path": True}
    stored = manifest["unimogen"]
    assert stored["bodies"] == ["turned", "toy"] and stored["words"] == WORDS and len(stored["signal"]) == 50
    toy = tomllib.loads((pack / "bodies" / "toy.toml").read_text())
    assert toy["words"] == ["run"] and len(toy["neutral"]["rotations"]) == len(toy["skeleton"]["joints"])
    assert toy["robot"]["hinges"][0]["joint"] == "left_hip"


def test_characters_of_any_bodies_get_the_same_bits_alone(bodies: dict[str, Body], pack: Path):
    denoiser, rng = denoiser_of(pack / "denoiser.onnx"), np.random.default_rng(0)

    def character(i: int) -> Character:
        own = np.random.default_rng(i)
        body = list(bodies.values())[i % 2]
        style = own.random(len(WORDS)).astype(np.float32)
        return Character(
            body, own.standard_normal((36, 3)).astype(np.float32), style, i, guidance=2.0 if i == 3 else 1.0
        )

    alone = [sample(denoiser, [character(i)], 2)[0] for i in range(6)]
    for _ in range(5):
        picked = [int(i) for i in rng.permutation(6)[: rng.integers(2, 7)]]
        for i, rows in zip(picked, sample(denoiser, [character(i) for i in picked], 2), strict=True):
            np.testing.assert_array_equal(rows, alone[i])


def test_lengths_that_differ_cannot_share_a_call(bodies: dict[str, Body]):
    body, style = bodies["turned"], np.zeros(len(WORDS), np.float32)
    short, long = (Character(body, np.zeros((frames, 3), np.float32), style) for frames in (20, 24))
    with pytest.raises(ValueError, match="20, 24"):
        sample(lambda arrays: arrays["x"], [short, long])
    with pytest.raises(ValueError, match="multiple of 4"):
        Character(body, np.zeros((21, 3), np.float32), style)


def test_a_run_is_exported_with_what_it_notes(corpus_cache: Path, tmp_path: Path):
    argv = [
        "unimogen",
        "train",
        "--cache",
        str(corpus_cache),
        "--run",
        str(tmp_path / "run"),
        "--unimogen-preset",
        "tiny",
    ]
    assert main([*argv, "--steps", "3", "--rows-per-step", "800", "--threads", "1"]) == 0
    argv = [
        "unimogen",
        "export",
        "--cache",
        str(corpus_cache),
        "--run",
        str(tmp_path / "run"),
        "--out",
        str(tmp_path / "pack"),
    ]
    assert main([*argv, "--licence", "CC BY 4.0"]) == 0
    manifest = tomllib.loads((tmp_path / "pack" / "pack.toml").read_text())
    assert manifest["training"]["unimogen_steps"] == 3 and manifest["licence"] == "CC BY 4.0"
    assert asdict(PRESETS["tiny"])["channels"] == 8
    assert manifest["training"]["onnx_check"]["denoiser"] < 1e-3


def test_a_kind_of_bodies_gets_a_network_of_its_own(bodies: dict[str, Body], pack: Path, tmp_path: Path):
    whole, run = tmp_path / "pack", tmp_path / "run"
    shutil.copytree(pack, whole)
    cache = tmp_path / "cache"
    for name, body in bodies.items():
        (cache / name).mkdir(parents=True)
        body.save(cache / name / "body.json")
    adopt(whole, run, None)
    checkpoint = torch.load(run / "unimogen.pt", weights_only=True)
    checkpoint["meta"]["bodies"], checkpoint["step"] = ["toy"], 40
    for value in checkpoint["average"].values():
        value.mul_(1.5)
    torch.save(checkpoint, run / "unimogen.pt")
    argv = ["unimogen", "add", "--pack", str(whole), "--run", str(run), "--cache", str(cache)]
    for more in ([], ["--version", "2.0.0"]):  # the second replaces the first
        assert main([*argv, "--kind", "robots", *more]) == 0
    manifest, network = tomllib.loads((whole / "pack.toml").read_text()), of_pack(whole, 1)
    assert manifest["unimogen"]["kinds"] == {"robots": ["toy"]} and manifest["training"]["robots_steps"] == 40
    assert manifest["version"] == "2.0.0"
    assert manifest["training"]["onnx_check"]["robots"] < 1e-3
    toy, turned = bodies["toy"], bodies["turned"]
    assert network.denoiser(turned) is network.general and network.denoiser(toy) is not network.general
    adopt(whole, tmp_path / "again", None, "robots")
    again = load(tmp_path / "again")
    inputs = example(again.model, [toy], (0, 0), 36, seed=3)
    arrays = {name: value.numpy() for name, value in inputs.items()}
    np.testing.assert_allclose(again.model(*inputs.values()).numpy(), network.denoiser(toy)(arrays), atol=1e-5)
    assert again.bodies == ["toy"]
    with pytest.raises(SystemExit, match="toy: robots of the pack already, so not people"):
        main([*argv, "--kind", "people"])
    with pytest.raises(SystemExit, match="has no network for animals"):
        adopt(whole, tmp_path / "none", None, "animals")


def test_a_pack_is_adopted_and_grown(bodies: dict[str, Body], pack: Path, corpus_cache: Path, tmp_path: Path):
    argv = ["unimogen", "adopt", "--pack", str(pack), "--run", str(tmp_path / "run")]
    assert main(argv) == 0
    adopted = load(tmp_path / "run")
    inputs = example(adopted.model, list(bodies.values()), (1, 0), 36, seed=3)
    arrays = {name: value.numpy() for name, value in inputs.items()}
    expected = denoiser_of(pack / "denoiser.onnx")(arrays)
    np.testing.assert_allclose(adopted.model(*inputs.values()).numpy(), expected, atol=1e-5)
    assert adopted.words == WORDS and adopted.bodies == ["turned", "toy"]
    torch.testing.assert_close(adopted.limits.low, LIMITS.low)
    with pytest.raises(SystemExit, match="exists"):
        main(argv)
    wider = replace(PRESETS["tiny"], channels=12)
    adopt(pack, tmp_path / "wide", wider)
    assert load(tmp_path / "wide").model.config == wider
