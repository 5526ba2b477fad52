"""Makes poses.json: known poses in Troupe's frame of reference and in those of three engines.

Each rotation becomes a matrix, which is carried over by the change of axes, and a quaternion again. The clients use
shorter formulas; their tests compare those with this table. `make.py --check` fails if the table is not up to date.
"""

import json
import math
import sys
from pathlib import Path

Matrix = list[list[float]]

# The axes of each engine in Troupe's (X left, Y up, Z ahead), and its units in a metre.
ENGINES: dict[str, tuple[Matrix, float]] = {
    "unity": ([[-1, 0, 0], [0, 1, 0], [0, 0, 1]], 1),  # X right, Y up, Z ahead
    "unreal": ([[0, 0, 1], [-1, 0, 0], [0, 1, 0]], 100),  # X ahead, Y right, Z up
    "godot": ([[-1, 0, 0], [0, 1, 0], [0, 0, -1]], 1),  # X right, Y up, Z back
}

# Position of the first joint in metres, axis of a turn, and its angle in degrees.
POSES: list[tuple[str, list[float], list[float], float]] = [
    ("at the origin, not turned", [0, 0, 0], [0, 1, 0], 0),
    ("a metre to the left", [1, 0, 0], [0, 1, 0], 0),
    ("a metre up", [0, 1, 0], [0, 1, 0], 0),
    ("a metre ahead", [0, 0, 1], [0, 1, 0], 0),
    ("a quarter turn to the left", [0, 0.9, 0], [0, 1, 0], 90),
    ("a quarter turn to the right", [0, 0.9, 0], [0, 1, 0], -90),
    ("a bow of 30 degrees", [0, 0.9, 0.1], [1, 0, 0], 30),
    ("a lean of 20 degrees to the right", [-0.1, 0.9, 0], [0, 0, 1], 20),
    ("turned about all axes", [0.5, 1.25, -2], [0.6, 0.48, 0.64], 100),
]


def product(a: Matrix, b: Matrix) -> Matrix:
    """The product of two matrices."""
    return [[sum(a[r][k] * b[k][c] for k in range(3)) for c in range(3)] for r in range(3)]


def transposed(a: Matrix) -> Matrix:
    """The transpose, which is the inverse of a change of axes."""
    return [list(column) for column in zip(*a, strict=True)]


def turn(axis: list[float], degrees: float) -> Matrix:
    """The matrix of a turn (Rodrigues)."""
    x, y, z = axis
    cross = [[0, -z, y], [z, 0, -x], [-y, x, 0]]
    twice = product(cross, cross)
    sin, cos = math.sin(math.radians(degrees)), math.cos(math.radians(degrees))
    return [[(r == c) + sin * cross[r][c] + (1 - cos) * twice[r][c] for c in range(3)] for r in range(3)]


def quaternion(m: Matrix) -> list[float]:
    """The quaternion (x, y, z, w) of a matrix, with w above zero. Turns of 180 degrees are not known."""
    w = math.sqrt(1 + m[0][0] + m[1][1] + m[2][2]) / 2
    x, y, z = ((m[2][1] - m[1][2]), (m[0][2] - m[2][0]), (m[1][0] - m[0][1]))
    return [x / (4 * w), y / (4 * w), z / (4 * w), w]


def rounded(numbers: list[float]) -> list[float]:
    """Numbers as the table has them, without minus zeros."""
    return [round(n, 7) + 0.0 for n in numbers]


def pose(axes: Matrix, scale: float, position: list[float], rotation: Matrix) -> dict[str, list[float]]:
    """A pose on other axes."""
    moved = [scale * sum(axes[r][k] * position[k] for k in range(3)) for r in range(3)]
    turned = quaternion(product(product(axes, rotation), transposed(axes)))
    return {"position": rounded(moved), "rotation": rounded(turned)}


def table() -> str:
    """The table as JSON, a row a line."""
    same: Matrix = [[1, 0, 0], [0, 1, 0], [0, 0, 1]]
    rows = []
    for name, position, axis, degrees in POSES:
        rotation = turn(axis, degrees)
        row: dict[str, object] = {"name": name, "troupe": pose(same, 1, position, rotation)}
        row |= {engine: pose(axes, scale, position, rotation) for engine, (axes, scale) in ENGINES.items()}
        rows.append(json.dumps(row))
    return "[\n" + ",\n".join(rows) + "\n]\n"


def main() -> int:
    """Writes or checks the table."""
    path = Path(__file__).parent / "poses.json"
    if "--check" in sys.argv:
        if path.read_text() == table():
            return 0
        print(f"{path} is not up to date: python3 {sys.argv[0]}", file=sys.stderr)
        return 1
    path.write_text(table())
    return 0


sys.exit(main())
