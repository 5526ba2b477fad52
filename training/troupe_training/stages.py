"""The four training stages: tokenizer, root, pose, and the refinement of the decoder on what the modules predict."""

from pathlib import Path

import torch
from torch import nn
from torch.nn import functional as F

from troupe_training.config import (
    BALANCE,
    CONTEXT_FRAMES,
    COUNTS,
    FRAMES_PER_TOKEN,
    MAX_TARGETS,
    MIN_TOKENS,
    PRESETS,
    ModelConfig,
)
from troupe_training.delta import DeltaInterpolator, delta_loss
from troupe_training.features import ClipStore, Segments, random_keyframe_mask, random_slot_masks, slot_frames
from troupe_training.live import live_conditions
from troupe_training.losses import Kinematics, reconstruction_losses
from troupe_training.pose_module import PoseModule, cosine_token_mask
from troupe_training.root_module import RootModule, baseline_trajectory
from troupe_training.teacher import (
    POSE_SHARE,
    ROOT_SHARE,
    Teacher,
    load_teacher,
    soft_target,
    taught_entropy,
)
from troupe_training.tokenizer import Tokenizer
from troupe_training.trainer import Budget, Trainer

STAGES = ("tokenizer", "root", "pose", "refine")
BASELINES = ("delta",)  # trained as stages are, but no part of a pack
STATISTIC_BATCHES = 40
# Noise on the decoder's root input, the size of r_g3's error, so that the decoder learns to clean it (r_g4).
ROOT_NOISE_M = 0.006
ROOT_NOISE_RAD = 0.015
# The pelvis height decides whether feet meet the ground, so it weighs more than the way.
HEIGHT_WEIGHT = 3.0
# Shares of predicted, not true, root trajectories that the pose module and the refined decoder are trained on. What is
# served is always predicted; a decoder that sees many true ones learns to copy the root's speed instead of taking it
# from the feet, and then they skate.
PREDICTED_ROOTS_POSE = 0.5
PREDICTED_ROOTS_REFINE = 0.9
# Share of the refinement's samples that are decoded from true tokens, so that tokens keep their meaning.
GUIDED_REFINE = 0.25
# Share of the refinement's updates under the conditions of live control.
LIVE_SHARE = 0.4


def statistics(
    store: ClipStore, batches: int, frames_budget: int
) -> dict[str, tuple[torch.Tensor, torch.Tensor]]:
    """Mean and deviation of every feature over random training segments; deviations have a floor."""
    generator = torch.Generator().manual_seed(1234)
    samples = [store.batch(frames_budget, generator) for _ in range(batches)]
    features = {
        "pose": (torch.cat([s.pose.flatten(0, 1) for s in samples]), 0.03),
        "velocity": (torch.cat([s.velocities.flatten(2).flatten(0, 1) for s in samples]), 0.1),
        "local_root": (torch.cat([s.local_root.flatten(0, 1) for s in samples]), 0.05),
        "global_root": (torch.cat([s.global_root.flatten(0, 1) for s in samples]), 0.1),
    }
    return {name: (x.mean(0), x.std(0).clamp_min(floor)) for name, (x, floor) in features.items()}


def build(stage: str, config: ModelConfig, store: ClipStore) -> nn.Module:
    """A new model of a stage with its standardisation constants set."""
    joints, contacts = store.skeleton.joint_count, len(store.skeleton.contact_joints)
    stats = statistics(store, STATISTIC_BATCHES, 4096)
    if stage in ("tokenizer", "refine"):
        model = Tokenizer(config, joints, contacts)
        model.decoder.pose_scale.set(*stats["pose"])
        model.decoder.root_scale.set(*stats["local_root"])
        model.decoder.velocity_scale.set(*stats["velocity"])
        return model
    if stage == "delta":
        model = DeltaInterpolator(config, joints)
        model.pose_scale.set(*stats["pose"])
        model.global_scale.set(*stats["global_root"])
        return model
    model = RootModule(config, joints) if stage == "root" else PoseModule(config, joints)
    model.pose_scale.set(*stats["pose"])
    model.local_scale.set(*stats["local_root"])
    model.global_scale.set(*stats["global_root"])
    return model


def load(run: Path, stage: str, store: ClipStore) -> nn.Module:
    """The averaged weights of a trained stage, ready for use."""
    path = Path(run) / f"{stage}.pt"
    if not path.exists():
        raise SystemExit(f"{path} is missing: train the stage '{stage}' first")
    state = torch.load(path, map_location=store.device, weights_only=False)
    model = build(stage, ModelConfig(**state["meta"]["model"]), store)
    try:
        model.load_state_dict(state["average"])
    except RuntimeError as error:
        raise SystemExit(f"{path} does not fit the networks of this version: {error}") from error
    return model.to(store.device).eval().requires_grad_(False)


def is_adopted(run: Path) -> bool:
    """Whether a run's tokenizer came out of a pack, and so has no trained encoder."""
    state = torch.load(Path(run) / "tokenizer.pt", map_location="cpu", weights_only=False)
    return state["meta"].get("adopted", False)


def noisy_root(segments: Segments, mask: torch.Tensor, generator: torch.Generator) -> torch.Tensor:
    """The true global root, for half of the samples shaken by what r_g3 typically gets wrong; keyframes stay exact."""
    root = segments.global_root
    batch, frames, _ = root.shape
    used = (torch.rand(batch, 1, 1, generator=generator) < 0.5).float()
    amount = torch.rand(batch, 1, 1, generator=generator) * used * (1.0 - mask.cpu()[..., None])
    shift = (torch.randn(batch, frames, 3, generator=generator) * amount * ROOT_NOISE_M).to(root.device)
    turn = (torch.randn(batch, frames, generator=generator) * amount[..., 0] * ROOT_NOISE_RAD).to(root.device)
    c, s = root[..., 3], root[..., 4]
    turned = torch.stack(
        [c * torch.cos(turn) - s * torch.sin(turn), s * torch.cos(turn) + c * torch.sin(turn)], -1
    )
    return torch.cat([root[..., :3] + shift, turned], -1)


def tokenizer_loss(store: ClipStore, frames_budget: int, taught: bool = False):
    """Loss of the tokenizer: encode, quantise (with some tokens spoilt), decode with root and keyframes.

    ``taught``: its tokens are a teacher's, and only the decoder learns.
    """
    kinematics = Kinematics(store.skeleton, store.device)

    def loss(model: Tokenizer, generator: torch.Generator, progress: float) -> dict[str, torch.Tensor]:
        if taught:
            model.quantizer.eval()
        segments = store.batch(frames_budget, generator)
        batch, frames = segments.pose.shape[:2]
        mask = random_keyframe_mask(batch, frames, generator).to(store.device)
        embedded, tokens, commitment = model.quantizer(model.encode(segments.pose))
        embedded = spoil_tokens(model, embedded, tokens, generator, 0.2 if progress > 0.15 else 0.0)
        out = model.decoder(embedded, noisy_root(segments, mask, generator), segments.pose, mask)
        terms = reconstruction_losses(out, segments, mask, model.decoder, kinematics)
        used = torch.stack(
            [torch.bincount(t, minlength=model.config.codes) for t in tokens.flatten(0, 1).T]
        ).float()
        share = used / used.sum(-1, keepdim=True)
        perplexity = torch.exp(-(share * torch.log(share + 1e-9)).sum(-1)).mean()
        return terms | {"commitment": 0.25 * commitment, "_perplexity": perplexity}

    return loss


def spoil_tokens(model: Tokenizer, embedded, tokens, generator: torch.Generator, most: float) -> torch.Tensor:
    """Replaces up to ``most`` of the tokens of half of the samples at random, so that a mispredicted head does little."""
    if most == 0.0:
        return embedded
    batch = len(tokens)
    share = (
        torch.rand(batch, 1, 1, generator=generator)
        * most
        * (torch.rand(batch, 1, 1, generator=generator) < 0.5)
    )
    wrong = (torch.rand(tokens.shape, generator=generator) < share).to(tokens.device)
    other = torch.randint(model.config.codes, tokens.shape, generator=generator).to(tokens.device)
    replaced = model.quantizer.embed(torch.where(wrong, other, tokens))
    keep = (~wrong).float().repeat_interleave(model.config.code_dim, -1)
    return embedded * keep + replaced * (1.0 - keep)


def root_inputs(segments: Segments, masks: dict[str, torch.Tensor]) -> dict[str, torch.Tensor]:
    """Slot values of the root module, zero where not given."""
    index = slot_frames(segments.frames)
    values = {
        "local_root": segments.local_root[:, index],
        "global_root": segments.global_root[:, index],
        "pose": segments.pose[:, index],
    }
    return {name: value * masks[name][..., None] for name, value in values.items()}


def run_root(
    model: RootModule, segments: Segments, masks: dict[str, torch.Tensor], timing_known: torch.Tensor
):
    """Count logits ``[B, 14]`` and r_g3 ``[B, T, 5]`` for segments of known length."""
    batch, tokens = len(segments.pose), segments.frames // FRAMES_PER_TOKEN
    device = segments.pose.device
    masks = {name: mask.to(device) for name, mask in masks.items()}
    values = root_inputs(segments, masks)
    f = model.constraints(
        values["local_root"],
        values["global_root"],
        values["pose"],
        masks["local_root"],
        masks["global_root"],
        masks["pose"],
    )
    count = torch.full((batch,), tokens - MIN_TOKENS, device=device)
    one_hot = F.one_hot(count, COUNTS).float()
    known = timing_known.to(device)[:, None]
    hidden, logits = model.count_logits(f, one_hot * known, known)
    num_tokens = count + MIN_TOKENS
    base = baseline_trajectory(values["local_root"], values["global_root"], masks["global_root"], num_tokens)
    root = model.trajectory(hidden, f, one_hot, num_tokens, base)
    return logits, root[:, : segments.frames]


def root_loss(store: ClipStore, frames_budget: int, teacher: RootModule | None = None):
    """Loss of the root module: cross-entropy of the count, and the trajectory in metres."""

    def loss(model: RootModule, generator: torch.Generator, progress: float) -> dict[str, torch.Tensor]:
        segments = store.batch(frames_budget, generator)
        batch, frames = segments.pose.shape[:2]
        masks = random_slot_masks(batch, generator)
        known = (torch.rand(batch, generator=generator) < 0.5).float()
        logits, root = run_root(model, segments, masks, known)
        unknown = (1.0 - known).to(store.device)
        target = torch.full((batch,), frames // FRAMES_PER_TOKEN - MIN_TOKENS, device=store.device)
        count = (
            F.cross_entropy(logits.float(), target, reduction="none") * unknown
        ).sum() / unknown.sum().clamp_min(1.0)
        weight = torch.ones(batch, frames, device=store.device)
        weight[:, :4] = 3.0
        weight[:, -4:] += 3.0 * masks["global_root"][:, 4:].to(store.device)
        aim = segments.global_root
        if teacher is not None:
            with torch.no_grad():
                taught = run_root(teacher, segments, masks, known)[1]
            aim = soft_target(aim, taught, ROOT_SHARE)
        error = (root - aim).abs() * (weight / weight.mean())[..., None]
        error[..., 1] = error[..., 1] * HEIGHT_WEIGHT
        step = ((root[:, 1:] - root[:, :-1]) - (aim[:, 1:] - aim[:, :-1])).abs() * 30.0
        return {
            "count": 0.05 * count,
            "position": 2.0 * error[..., :3].mean(),
            "heading": error[..., 3:].mean(),
            "speed": 0.5 * step.mean(),
        }

    return loss


def mixed_root(
    root: RootModule, segments: Segments, mask: torch.Tensor, share: float, generator: torch.Generator
) -> torch.Tensor:
    """For a ``share`` of the samples what the root module predicts from the keyframes in ``mask``, else the truth.

    As in most requests a target keyframe with a pose usually has a root too; the rest is drawn at random.
    """
    batch = len(segments.pose)
    masks = random_slot_masks(batch, generator)
    target_poses = mask[:, -MAX_TARGETS:].cpu()
    with_root = torch.rand(batch, 1, generator=generator) < 0.8
    masks["pose"][:, CONTEXT_FRAMES:] = target_poses
    masks["global_root"][:, CONTEXT_FRAMES:] = torch.where(
        with_root & (target_poses.sum(-1, keepdim=True) > 0),
        target_poses,
        masks["global_root"][:, CONTEXT_FRAMES:],
    )
    with torch.no_grad():
        predicted = run_root(root, segments, masks, torch.ones(batch))[1]
    use = (torch.rand(batch, 1, 1, generator=generator) < share).to(predicted.device)
    return torch.where(use, predicted, segments.global_root)


def pose_loss(
    store: ClipStore,
    frames_budget: int,
    tokenizer: Tokenizer,
    root: RootModule,
    teacher: PoseModule | None = None,
):
    """Loss of the pose module: cross-entropy of the masked tokens."""

    def loss(model: PoseModule, generator: torch.Generator, progress: float) -> dict[str, torch.Tensor]:
        segments = store.batch(frames_budget, generator)
        batch, frames = segments.pose.shape[:2]
        with torch.no_grad():
            truth = tokenizer.quantizer.tokens(tokenizer.encode(segments.pose))
        mask = random_keyframe_mask(batch, frames, generator).to(store.device)
        hidden = cosine_token_mask(*truth.shape, generator).to(store.device)
        tokens = torch.where(hidden, model.codes, truth)
        num_tokens = torch.full((batch,), truth.shape[1], device=store.device)
        trajectory = mixed_root(root, segments, mask, PREDICTED_ROOTS_POSE, generator)
        given = (tokens, num_tokens, trajectory, segments.pose * mask[..., None], mask)
        logits = model(*given)
        entropy = F.cross_entropy(logits.flatten(0, 2), truth.flatten(), reduction="none").reshape(
            truth.shape
        )
        if teacher is not None:
            with torch.no_grad():
                taught = teacher(*given)
            entropy = soft_target(entropy, taught_entropy(logits, taught), POSE_SHARE)
        hits = ((logits.argmax(-1) == truth) & hidden).sum() / hidden.sum().clamp_min(1)
        return {"entropy": (entropy * hidden).sum() / hidden.sum().clamp_min(1), "_accuracy": hits}

    return loss


def refine_loss(
    store: ClipStore, frames_budget: int, pose: PoseModule, root: RootModule, guided_share: float
):
    """Loss of the decoder on what it will be served: predicted roots and tokens, true motion as the aim.

    A ``guided_share`` of the samples has the tokens of the true motion.
    """
    kinematics = Kinematics(store.skeleton, store.device)

    def loss(model: Tokenizer, generator: torch.Generator, progress: float) -> dict[str, torch.Tensor]:
        model.quantizer.eval()  # the codebooks stay: the pose module speaks their language
        if float(torch.rand(1, generator=generator)) < LIVE_SHARE:
            live = live_conditions(store, frames_budget, root, run_root, generator)
            segments, trajectory = live.segments, live.trajectory
            given, mask, exact = live.keyframes, live.mask, live.exact
        else:
            segments = store.batch(frames_budget, generator)
            batch, frames = segments.pose.shape[:2]
            mask = random_keyframe_mask(batch, frames, generator).to(store.device)
            trajectory = mixed_root(root, segments, mask, PREDICTED_ROOTS_REFINE, generator)
            given, exact = segments.pose, mask
        with torch.no_grad():
            batch, slots = len(segments.pose), segments.frames // FRAMES_PER_TOKEN
            num_tokens = torch.full((batch,), slots, device=store.device)
            tokens = torch.full((batch, slots, pose.heads), pose.codes, device=store.device)
            tokens = pose(tokens, num_tokens, trajectory, given * mask[..., None], mask).argmax(-1)
            if guided_share > 0.0:
                truth = model.quantizer.tokens(model.encode(segments.pose))
                guided = torch.rand(batch, 1, 1, generator=generator) < guided_share
                tokens = torch.where(guided.to(store.device), truth, tokens)
            embedded = model.quantizer.embed(tokens)
        out = model.decoder(embedded, trajectory, given, mask)
        return reconstruction_losses(out, segments, exact, model.decoder, kinematics)

    return loss


def train_stage(
    stage: str,
    cache: Path,
    run: Path,
    preset: str | ModelConfig,
    budget: Budget,
    frames_budget: int,
    seed: int,
    device: str,
    balance: float = BALANCE,
    fresh_schedule: bool = False,
    teacher_run: Path | None = None,
) -> bool:
    """Trains one stage, resuming its checkpoint; true when its budget is spent.

    ``preset`` names network sizes, or holds those of a variant. ``fresh_schedule`` counts the budget from the checkpoint on
    instead of from the stage's first update. ``teacher_run`` is the run of a large pack to learn from; its root module
    then stands in where this run has none yet.
    """
    torch.manual_seed(seed)
    store = ClipStore(cache, "train", device, balance)
    sizes, config = ("variant", preset) if isinstance(preset, ModelConfig) else (preset, PRESETS[preset])
    teacher: Teacher | None = load_teacher(teacher_run, load, store) if teacher_run else None
    adopted = stage == "refine" and is_adopted(run)
    if stage == "refine":
        model = load(run, "tokenizer", store)
        for parameter in model.decoder.parameters():
            parameter.requires_grad_(True)
        config = model.config
    else:
        model = build(stage, config, store).to(device)
        if teacher and stage == "tokenizer":
            teacher.lend_tokens(model)
    meta = {"model": config.to_dict(), "preset": sizes, "seed": seed, "frames_budget": frames_budget}
    meta |= {"adopted": True} if adopted else {}
    trainer = Trainer(run, stage, model, budget, meta, seed, device)
    if trainer.resume():
        if fresh_schedule:
            trainer.start_schedule()
        print(f"{stage}: going on from step {trainer.step}")
    taught = {name: getattr(teacher, name, None) for name in ("tokenizer", "root", "pose")}

    def network(name: str):
        there = (Path(run) / f"{name}.pt").exists()
        return load(run, name, store) if there or not teacher else taught[name]

    losses = {
        "tokenizer": lambda: tokenizer_loss(store, frames_budget, teacher is not None),
        "root": lambda: root_loss(store, frames_budget, taught["root"]),
        "pose": lambda: pose_loss(
            store, frames_budget, network("tokenizer"), network("root"), taught["pose"]
        ),
        "refine": lambda: refine_loss(
            store, frames_budget, network("pose"), network("root"), 0.0 if adopted else GUIDED_REFINE
        ),
        "delta": lambda: delta_loss(store, frames_budget),
    }
    return trainer.fit(losses[stage]())
