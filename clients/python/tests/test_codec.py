import numpy as np
import pytest

from conftest import any_rotations
from troupe import codec, rotation


def encode(quaternions: np.ndarray) -> bytes:
    """As the contract describes it, one by one and in double precision."""
    words = []
    for q in quaternions.astype(np.float64):
        largest = int(np.argmax(np.abs(q)))
        others = [q[i] * np.sign(q[largest]) for i in range(4) if i != largest]
        three = [round((value * np.sqrt(2) + 1) / 2 * 32767) for value in others]
        three[0] |= (largest & 1) << 15
        three[1] |= (largest >> 1) << 15
        words += three
    return np.array(words, "<u2").tobytes()


def test_rotations_come_back_within_the_documented_error() -> None:
    q = any_rotations(1, 20_000)
    back = codec.decode_rotations(encode(q))
    assert rotation.angle_between(q, back).max() <= codec.MAX_ROTATION_ERROR_RAD
    assert np.abs(np.linalg.norm(back, axis=1) - 1).max() < 1e-6


@pytest.mark.parametrize("axis", range(4))
def test_each_component_may_be_left_out(axis: int) -> None:
    q = np.full((1, 4), 0.1, np.float32)
    q[0, axis] = np.sqrt(1 - 0.03)
    assert np.abs(codec.decode_rotations(encode(q)) - q).max() < 5e-5


def test_the_worst_corner_is_within_the_error() -> None:
    q = 0.5 + np.random.default_rng(2).uniform(-2e-4, 2e-4, (5000, 4))
    q *= np.random.default_rng(3).choice([-1, 1], (5000, 4))
    q = rotation.normalise64(q)
    assert rotation.angle_between(q, codec.decode_rotations(encode(q))).max() <= codec.MAX_ROTATION_ERROR_RAD


def test_any_words_give_unit_quaternions() -> None:
    words = np.random.default_rng(4).integers(0, 1 << 16, (1000, 3)).astype("<u2")
    assert np.abs(np.linalg.norm(codec.decode_rotations(words.tobytes()), axis=1) - 1).max() < 1e-5


def test_roots_are_tenths_of_a_millimetre() -> None:
    data = np.array([[10_000, -1, 2_560_000]], "<i4").tobytes()
    assert np.allclose(codec.decode_roots(data), [[1.0, -0.0001, 256.0]], atol=codec.MAX_ROOT_ERROR_M)


def test_contacts_are_bits() -> None:
    assert codec.decode_contacts(bytes([0b101, 0b010]), 3).tolist() == [[True, False, True], [False, True, False]]
