import numpy as np
import pytest
import torch

from troupe_training.models.unimogen.config import PRESETS, ROW_CHANNELS
from troupe_training.models.unimogen.diffusion import body_noise, cosine_signal, ddim, row_noise, sampler_steps
from troupe_training.models.unimogen.network import UniMoGen, slot_matrix
from troupe_training.models.unimogen.sampler import INPUTS, Arrays, Batch, Character, sample
from troupe_training.models.unimogen.state import BodyKinematics, Path2D, Range, decode, encode
from unimogen_support import biped, small_rotations

LIMITS = Range(torch.tensor([-0.2, -0.9, -0.2]), torch.tensor([0.2, 0.5, 0.3]))
WORDS = 5


def network() -> UniMoGen:
    torch.manual_seed(0)
    model = UniMoGen(PRESETS["tiny"], WORDS)
    for parameter in model.parameters():  # layers that begin at zero would hide what they read
        parameter.data += 0.1 * torch.randn_like(parameter)
    return model.eval().requires_grad_(False)


def denoiser(model: UniMoGen):
    def run(arrays: Arrays) -> np.ndarray:
        return model(*(torch.from_numpy(np.ascontiguousarray(arrays[name])) for name in INPUTS)).numpy()

    return run


def character(seed: int, frames: int = 20, guidance: float = 1.0, body_seed: int | None = None, **more) -> Character:
    rng = np.random.default_rng(seed)
    path, style = rng.standard_normal((frames, 3)).astype(np.float32), rng.random(WORDS).astype(np.float32)
    return Character(biped(body_seed), path, style, seed, guidance=guidance, **more)


def windows(frames: int = 12):
    rng = np.random.default_rng(5)
    local = torch.from_numpy(small_rotations(rng, 0.3, 2, frames, 8)).float()
    six = torch.cat([local[..., 0], local[..., 1]], -1)
    root = torch.from_numpy(rng.standard_normal((2, frames, 3))).float()
    path = Path2D(root[..., [0, 2]] + 0.1, torch.linspace(0, 2, frames).repeat(2, 1))
    return root, six, path


def test_rows_come_back_as_motion():
    root, six, path = windows()
    again, bends = decode(biped(), encode(biped(), root, six, path, LIMITS), path, LIMITS)
    torch.testing.assert_close(again, root, atol=1e-5, rtol=0)
    torch.testing.assert_close(torch.cat([bends[..., 0], bends[..., 1]], -1), six, atol=1e-5, rtol=0)


def test_a_motion_elsewhere_is_the_same_to_the_network():
    from troupe_training.data.rotations import matrix_to_six_d, six_d_to_matrix, yaw_matrix

    root, six, path = windows()
    turn = torch.tensor(1.1)
    there = (yaw_matrix(turn) @ root[..., None])[..., 0] + torch.tensor([3.0, 0.0, -2.0])
    turned = six.clone()
    turned[:, :, 0] = matrix_to_six_d(yaw_matrix(turn) @ six_d_to_matrix(six[:, :, 0]))
    points = torch.stack([path.points[..., 0], torch.zeros_like(path.heading), path.points[..., 1]], -1)
    moved = (yaw_matrix(turn) @ points[..., None])[..., 0] + torch.tensor([3.0, 0.0, -2.0])
    other = Path2D(moved[..., [0, 2]], path.heading + turn)
    torch.testing.assert_close(other.features(0.9), path.features(0.9), atol=1e-3, rtol=1e-4)
    here = encode(biped(), root, six, path, LIMITS)
    torch.testing.assert_close(encode(biped(), there, turned, other, LIMITS), here, atol=1e-4, rtol=1e-4)


def test_kinematics_are_those_of_the_skeleton():
    root, six, _ = windows()
    body, kinematics = biped(3), BodyKinematics(biped(3))
    from troupe_training.data.rotations import six_d_to_matrix

    turned = kinematics.turned(six_d_to_matrix(six))
    expected = body.skeleton.forward_kinematics(root[0].numpy(), kinematics.rotations(turned)[0].numpy())
    np.testing.assert_allclose(kinematics.positions(root, turned)[0].numpy(), expected, atol=1e-5)


def test_gathered_and_dense_joint_attention_agree():
    model, batch = network(), Batch([character(1), character(2)])
    arrays = batch.constant | {"x": np.concatenate(batch.state), "step": np.array([3.0, 40.0], np.float32)}
    inputs = [torch.from_numpy(np.ascontiguousarray(arrays[name])) for name in INPUTS]
    rows, reads = (torch.from_numpy(part) for part in biped().slots())
    torch.testing.assert_close(model(*inputs), model(*inputs, slot_of=slot_matrix(rows, reads)), atol=1e-5, rtol=1e-4)


def test_company_changes_no_more_than_rounding():
    run = denoiser(network())
    wanted = [character(1), character(2, guidance=2.5, body_seed=4), character(3)]
    together = sample(run, wanted, 2)
    for one, rows in zip([character(1), character(2, guidance=2.5, body_seed=4), character(3)], together, strict=True):
        np.testing.assert_allclose(sample(run, [one], 2)[0], rows, atol=1e-5)


def test_guidance_of_one_needs_no_second_rows():
    assert len(Batch([character(1), character(2)]).order) == 2
    assert Batch([character(1), character(2, guidance=2.0)]).order == [0, 1, 1]


def test_guidance_extrapolates_from_no_style():
    run, rows = denoiser(network()), {}
    for weight in (0.0, 1.0, 3.0):
        rows[weight] = sample(run, [character(1, guidance=weight)], 1)[0]
    none = character(1)
    none.style = np.zeros(WORDS, np.float32)
    np.testing.assert_allclose(sample(run, [none], 1)[0], rows[0.0], atol=1e-5)
    np.testing.assert_allclose(rows[3.0], rows[0.0] + 3 * (rows[1.0] - rows[0.0]), atol=1e-4)


def test_given_frames_come_out_as_they_went_in():
    known = np.random.default_rng(0).standard_normal((9, 20, ROW_CHANNELS)).astype(np.float32)
    given = (np.arange(20) < 4).astype(np.float32)
    made = sample(denoiser(network()), [character(1, given=given, known=known)])[0]
    np.testing.assert_array_equal(made[:, :4], known[:, :4])
    assert not np.allclose(made[:, 4:], known[:, 4:])


def test_a_last_frame_is_carried_from_the_first_update_on():
    torch.manual_seed(0)
    model = UniMoGen(PRESETS["tiny"], WORDS).eval()
    known = np.full((9, 20, ROW_CHANNELS), 0.7, np.float32)
    given = (np.arange(20) < 4).astype(np.float32)
    torch.nn.init.zeros_(model.joint_out.weight)
    plain, carried = (
        sample(denoiser(model.requires_grad_(False)), [character(1, given=g, known=known)], 1)[0][1:, 4]
        for g in (None, given)
    )
    assert np.abs(carried - 0.7).mean() < 0.5 * np.abs(plain - 0.7).mean()


def test_noise_depends_on_seed_row_frame_and_channel_alone():
    np.testing.assert_array_equal(row_noise(7, 3, 64)[:20], row_noise(7, 3, 20))
    assert not np.allclose(row_noise(7, 3, 8), row_noise(8, 3, 8))
    assert not np.allclose(row_noise(7, 3, 8), row_noise(7, 4, 8))
    noise = body_noise(1, 40, 64)[1:]
    assert abs(noise.mean()) < 0.02 and abs(noise.std() - 1) < 0.02
    assert (row_noise(2**64 - 1, 0, 8)[:, 3:] == 0).all()


def test_schedule_and_steps():
    signal = cosine_signal()
    assert len(signal) == 50 and (np.diff(signal) < 0).all() and signal[0] > 0.99 and signal[-1] < 1e-3
    assert sampler_steps(4) == [49, 36, 24, 11] and sampler_steps(1) == [49]
    assert sampler_steps(50) == list(range(49, -1, -1))
    with pytest.raises(ValueError, match="0 sampler steps"):
        sampler_steps(0)


def test_ddim_keeps_the_noise():
    signal, rng = cosine_signal(), np.random.default_rng(0)
    clean, noise = rng.standard_normal((2, 5)).astype(np.float32)
    noisy = np.sqrt(signal[30]) * clean + np.sqrt(1 - signal[30]) * noise
    then = ddim(noisy.astype(np.float32), clean, 30, 10, signal)
    np.testing.assert_allclose(then, np.sqrt(signal[10]) * clean + np.sqrt(1 - signal[10]) * noise, atol=1e-5)
    assert ddim(noisy, clean, 30, None, signal) is clean
