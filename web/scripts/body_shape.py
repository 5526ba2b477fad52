"""The shape of a person around a skeleton: tapered capsules whose distances blend into one smooth surface."""

from dataclasses import dataclass

import numpy as np

# Radii and places below are for a person whose thigh and shank measure this together, metres.
LEG_M = 0.8007
# How far neighbouring parts run into each other, metres.
BLEND_M = 0.014
# Brightness of what is worn, as a factor of the character's colour.
SHIRT, TROUSERS, SHOES, SKIN = 1.0, 0.78, 0.5, 1.08


@dataclass(frozen=True)
class Part:
    """A tapered capsule, stretched along the axes of the world."""

    start: np.ndarray
    end: np.ndarray
    radii: tuple[float, float]
    shade: float
    stretch: tuple[float, float, float] = (1.0, 1.0, 1.0)

    def distance(self, places: np.ndarray) -> np.ndarray:
        """Distance of places (n, 3) from the surface, metres; negative inside."""
        stretch = np.array(self.stretch)
        middle = (self.start + self.end) / 2
        places = (places - middle) / stretch + middle
        start, end = ((end - middle) / stretch + middle for end in (self.start, self.end))
        along = end - start
        share = np.clip((places - start) @ along / max(along @ along, 1e-12), 0, 1)
        nearest = start + share[:, None] * along
        radius = self.radii[0] + share * (self.radii[1] - self.radii[0])
        return (np.linalg.norm(places - nearest, axis=1) - radius) * stretch.min()


class Shape:
    """A smooth union of parts."""

    def __init__(self, parts: list[Part]):
        self.parts = parts

    def _terms(self, places: np.ndarray) -> np.ndarray:
        distances = np.stack([part.distance(places) for part in self.parts])
        return np.exp(np.clip(-distances / BLEND_M, -60, 60))

    def distance(self, places: np.ndarray) -> np.ndarray:
        """Distance of places (n, 3) from the surface, metres; in pieces, so that memory stays small."""
        pieces = np.array_split(places, max(len(places) // 100_000, 1))
        return np.concatenate([-BLEND_M * np.log(self._terms(piece).sum(axis=0)) for piece in pieces])

    def shade(self, places: np.ndarray) -> np.ndarray:
        """Brightness at places: that of the parts, by their nearness."""
        terms = self._terms(places) ** 1.5
        return (terms * np.array([part.shade for part in self.parts])[:, None]).sum(axis=0) / terms.sum(axis=0)

    def gradient(self, places: np.ndarray, step_m: float = 1e-3) -> np.ndarray:
        """Unit vectors out of the surface (n, 3)."""
        steps = np.eye(3) * step_m
        slopes = [self.distance(places + step) - self.distance(places - step) for step in steps]
        gradient = np.stack(slopes, axis=1)
        return gradient / np.linalg.norm(gradient, axis=1, keepdims=True)


def person(at: dict[str, np.ndarray], sole_m: float) -> Shape:
    """A person around joints that stand with arms and legs spread, facing +Z; `sole_m` is the height of the soles."""
    size = (
        np.linalg.norm(at["UpperLeg_L"] - at["LowerLeg_L"]) + np.linalg.norm(at["LowerLeg_L"] - at["Foot_L"])
    ) / LEG_M
    parts: list[Part] = []

    def add(start, end, radii, shade, stretch=(1.0, 1.0, 1.0)) -> None:
        parts.append(Part(np.asarray(start), np.asarray(end), (radii[0] * size, radii[1] * size), shade, stretch))

    def off(joint: str, x: float, y: float, z: float) -> np.ndarray:
        return at[joint] + size * np.array([x, y, z])

    deep = (1.0, 1.0, 0.86)
    # Trunk: pelvis, waist, ribs. Wider than deep.
    add(off("Hips", -0.058, -0.015, -0.004), off("Hips", 0.058, -0.015, -0.004), (0.092, 0.092), TROUSERS)
    for side in (-1, 1):
        add(off("Hips", side * 0.052, -0.05, -0.035), off("Hips", side * 0.055, -0.03, -0.03), (0.076, 0.07), TROUSERS)
        add(off("Hips", side * 0.046, 0.06, 0), off("Spine", side * 0.045, 0.0, 0.002), (0.078, 0.08), SHIRT, deep)
        add(off("Spine", side * 0.045, 0, 0.002), off("Chest", side * 0.066, 0.035, 0), (0.08, 0.086), SHIRT, deep)
        add(
            off("Chest", side * 0.066, 0.035, 0), off("Chest", side * 0.078, 0.095, -0.006), (0.088, 0.072), SHIRT, deep
        )
        add(off("Chest", side * 0.05, 0.075, 0.032), off("Chest", side * 0.075, 0.08, 0.022), (0.055, 0.05), SHIRT)
    add(off("Hips", 0, 0.03, 0), off("Chest", 0, 0.08, -0.004), (0.088, 0.088), SHIRT, deep)

    # Neck and head: a skull, a jaw, and a nose that shows the way ahead.
    add(off("Neck", 0, -0.02, -0.012), off("Head", 0, 0.03, 0.004), (0.05, 0.046), SKIN)
    add(off("Head", 0, 0.112, -0.006), off("Head", 0, 0.1, 0.004), (0.088, 0.086), SKIN, (0.88, 1.08, 1.06))
    add(off("Head", 0, 0.065, 0.034), off("Head", 0, 0.03, 0.052), (0.056, 0.03), SKIN, (0.92, 1.0, 1.0))
    add(off("Head", 0, 0.092, 0.092), off("Head", 0, 0.07, 0.102), (0.008, 0.012), SKIN)
    for side in (-1, 1):
        add(off("Head", side * 0.079, 0.1, -0.008), off("Head", side * 0.077, 0.072, -0.004), (0.013, 0.009), SKIN)

    for side, mark in ((1, "L"), (-1, "R")):
        arm, elbow, wrist = (at[f"{name}_{mark}"] for name in ("UpperArm", "LowerArm", "Hand"))
        hip, knee, ankle = (at[f"{name}_{mark}"] for name in ("UpperLeg", "LowerLeg", "Foot"))
        # Shoulder: from the neck's foot over the joint; the flesh reaches farther out than the
        # joint.
        add(
            off("Neck", side * 0.02, -0.035, -0.014),
            arm + size * np.array([side * 0.012, 0.0, 0.0]),
            (0.05, 0.052),
            SHIRT,
        )
        add(arm + size * np.array([side * 0.018, -0.004, 0]), mix(arm, elbow, 0.35), (0.055, 0.046), SHIRT)
        add(mix(arm, elbow, 0.3), elbow, (0.046, 0.036), SHIRT)
        add(elbow, mix(elbow, wrist, 0.35), (0.036, 0.038), SKIN)
        add(mix(elbow, wrist, 0.3), wrist, (0.038, 0.024), SKIN)
        hand(add, wrist, (wrist - elbow) / np.linalg.norm(wrist - elbow), size)
        # Leg: thigh, knee, calf.
        add(hip + size * np.array([side * 0.012, 0, 0]), mix(hip, knee, 0.4), (0.084, 0.072), TROUSERS)
        add(mix(hip, knee, 0.35), knee, (0.074, 0.05), TROUSERS)
        add(knee, mix(knee, ankle, 0.32) + size * np.array([0, 0, -0.012]), (0.05, 0.05), TROUSERS)
        add(mix(knee, ankle, 0.28) + size * np.array([0, 0, -0.01]), ankle, (0.052, 0.037), TROUSERS)
        foot(add, ankle, at[f"Toes_{mark}"], sole_m, size)
    return Shape(parts)


def hand(add, wrist: np.ndarray, along: np.ndarray, size: float) -> None:
    """A mitten with a thumb: its flat sides face the body, the thumb is ahead."""
    ahead = np.array([0.0, 0.0, 1.0]) * size
    along = along * size
    for across in (-0.018, 0.0, 0.018):
        knuckle = wrist + along * 0.085 + ahead * across * 1.1
        add(wrist + along * 0.012 + ahead * across * 0.7, knuckle, (0.019, 0.017), SKIN)
        add(knuckle, knuckle + along * (0.078 - abs(across) * 0.5), (0.0155, 0.0105), SKIN)
    add(wrist + along * 0.025 + ahead * 0.018, wrist + along * 0.085 + ahead * 0.048, (0.016, 0.011), SKIN)


def foot(add, ankle: np.ndarray, toes: np.ndarray, sole_m: float, size: float) -> None:
    """A shoe that stands on the sole's height, from behind the ankle to beyond the toes."""
    ahead = (toes - ankle) * np.array([1, 0, 1])
    ahead = ahead / np.linalg.norm(ahead) * size
    aside = np.array([ahead[2], 0, -ahead[0]])

    def on(place: np.ndarray, radius: float) -> np.ndarray:
        return np.array([place[0], sole_m + radius * size, place[2]])

    heel = on(ankle - ahead * 0.035, 0.038)
    ball = on(toes + ahead * 0.005, 0.03)
    add(ankle, heel, (0.04, 0.04), SHOES)
    add(ankle, ball + np.array([0, 0.012, 0]) * size, (0.041, 0.032), SHOES)
    add(heel, ball, (0.036, 0.03), SHOES)
    for across in (-0.017, 0.017):
        tip = on(toes + ahead * (0.06 + 0.004 * np.sign(across)) + aside * across * 0.9, 0.022)
        add(ball + aside * across, tip, (0.029, 0.022), SHOES)


def mix(a: np.ndarray, b: np.ndarray, share: float) -> np.ndarray:
    """The point between two."""
    return a + share * (b - a)
