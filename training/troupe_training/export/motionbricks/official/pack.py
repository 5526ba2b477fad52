"""``import-motionbricks``: the public release -> a model pack. Weights stay in 32 bits, as they were published."""

import shutil
from pathlib import Path

import onnx

from troupe_training.data.skeleton import Skeleton
from troupe_training.export.manifest import About, read_manifest, write_manifest
from troupe_training.export.motionbricks.examples import example_inputs
from troupe_training.export.motionbricks.official.checkpoints import ReleaseError
from troupe_training.export.motionbricks.official.release import NAMES, Release
from troupe_training.export.motionbricks.official.styles import CLIPS, write_styles
from troupe_training.export.motionbricks.pack import FAMILY, OPSET, digest_of, largest_difference, open_axes, settle
from troupe_training.export.motionbricks.random_pack import RandomStore
from troupe_training.export.onnx import graph_of
from troupe_training.models.motionbricks.config import FRAMES_PER_TOKEN, MAX_TOKENS
from troupe_training.models.motionbricks.official.served import Joints, OfficialNetworks
from troupe_training.models.motionbricks.official.sizes import Sizes
from troupe_training.models.motionbricks.served import OUTPUTS

LICENCE = "NVIDIA Open Model License"
CREDITS = ["NVIDIA (MotionBricks, Wang et al. 2026) for the networks and their training"]
EXPORTED = (3, 8, 1)  # batch size, tokens, seed
CHECKED = ((1, 6, 2), (5, 9, 3), (4, 16, 4))
TOLERANCE = 1e-4  # between ONNX Runtime and PyTorch
SAME_BONE_M = 1e-3  # bones of one robot differ by less


def skeleton_of(release: Release, like: Path) -> tuple[Skeleton, Joints]:
    """The pack's skeleton: joints and hinges in the order of the robot's own pack, bones of the release.

    Hinges, their limits and speeds are the robot's, so they come from a pack of the same robot.
    """
    skeleton = Skeleton.of_manifest(read_manifest(like))
    if sorted(skeleton.names) != sorted(NAMES) or skeleton.robot is None:
        raise ReleaseError(f"{like} is no pack of the G1: its joints are not the release's")
    theirs = [NAMES.index(name) for name in skeleton.names]
    hinged = {hinge["joint"] for hinge in skeleton.robot["hinges"]}
    for joint, name in enumerate(skeleton.names):
        parent = release.parents[theirs[joint]]
        if (NAMES[parent] if parent >= 0 else "") != (skeleton.names[skeleton.parents[joint]] if joint else ""):
            raise ReleaseError(f"{name} has another parent in {like} than in the release")
        offset = release.offsets[theirs[joint]]
        apart = max(abs(a - b) for a, b in zip(offset, skeleton.offsets[joint], strict=True))
        if name in hinged and apart > SAME_BONE_M:
            raise ReleaseError(f"{name} is {apart:.3f} m elsewhere in {like} than in the release: another robot")
        skeleton.offsets[joint] = offset
    fixed = [joint for joint, name in enumerate(NAMES) if joint > 0 and name not in hinged]
    return skeleton, Joints(theirs, fixed, release.parents)


def check_sizes(sizes: Sizes) -> None:
    """The server's constants: it reads four frames a token, and plans of up to 64."""
    if sizes.frames_per_token != FRAMES_PER_TOKEN or sizes.max_tokens != MAX_TOKENS:
        raise ReleaseError(
            f"{sizes.max_tokens} tokens of {sizes.frames_per_token} frames; only {MAX_TOKENS} of {FRAMES_PER_TOKEN} are supported"
        )


def import_release(folder: Path, out: Path, like: Path, version: str) -> dict[str, int]:
    """Writes the pack folder and returns the parameters of its networks."""
    release = Release.read(folder)
    check_sizes(release.sizes)
    skeleton, joints = skeleton_of(release, like)
    networks = release.networks()
    about = About(out.resolve().name, version, LICENCE, CREDITS, {"release": "motionbricks, g1skel34"})
    parameters = write_pack(out, about, networks, skeleton, joints)
    if (release.out / CLIPS).exists():
        styles = write_styles(release.out, out, skeleton, joints, release.sizes)
        print(f"{out / 'styles'}: {', '.join(styles)}")
    else:
        print(
            f"{release.out / CLIPS} is missing: live characters need styles, `troupe style build` makes some from motion"
        )
    print(
        f"skills and objects need sets of at least {least_set(release.sizes)} frames; "
        "commands for others are refused (TOO_SHORT), and pack g1 can do them"
    )
    return parameters


def least_set(sizes: Sizes) -> int:
    """Fewest frames of a set of a skill or an object: those of the shortest segment after its context."""
    return (sizes.min_tokens - 1) * sizes.frames_per_token


def write_pack(
    out: Path, about: About, networks: OfficialNetworks, skeleton: Skeleton, joints: Joints
) -> dict[str, int]:
    """Exports every stage, compares it with PyTorch, and writes the manifest last."""
    sizes, parameters = networks.sizes, networks.parameters()
    fresh = out.with_name(out.name + ".new")
    shutil.rmtree(fresh, ignore_errors=True)
    fresh.mkdir(parents=True)
    store = RandomStore(skeleton)
    example, *checked = (
        example_inputs(store, sizes, *size, min_tokens=sizes.min_tokens) for size in (EXPORTED, *CHECKED)
    )
    checks = {}
    for name, stage in networks.stages(joints).items():
        stage.eval().requires_grad_(False)
        path = fresh / f"{name}.onnx"
        model = graph_of(stage, example[name], OUTPUTS[name], open_axes(example[name], sizes.min_tokens), OPSET)
        model.doc_string = f"MotionBricks {name} stage"
        onnx.checker.check_model(model)
        onnx.save(model, path)
        del model
        checks[name] = 0.0
        for inputs in checked:
            lengths = stage(*inputs[name].values())[0] if name == "root" else inputs[name]["num_tokens"]
            checks[name] = max(checks[name], largest_difference(path, stage, inputs[name], lengths))
        print(f"{name}.onnx: {path.stat().st_size / 1e6:.0f} MB, differs from PyTorch by at most {checks[name]:.1e}")
        if not checks[name] <= TOLERANCE:
            raise SystemExit(f"{name}.onnx differs from PyTorch by {checks[name]:.1e}, at most {TOLERANCE} is allowed")
    table = {
        "frames_per_token": sizes.frames_per_token,
        "min_tokens": sizes.min_tokens,
        "max_tokens": sizes.max_tokens,
        "heads": sizes.heads,
        "codes": sizes.codes,
        "context_frames": sizes.frames_per_token,
        "max_targets": sizes.frames_per_token,
        "parameters": sum(parameters.values()),
    }
    write_manifest(fresh, FAMILY, about, table, digest_of(fresh, list(checks)), skeleton, checks)
    settle(fresh, out)
    return parameters
