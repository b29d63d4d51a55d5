"""Rotations in three dimensions: unit quaternions (w, x, y, z), Hamilton, right-handed.

A quaternion named `a_from_b` turns a vector's coordinates in b into those in a.
"""

import math

Vector = tuple[float, float, float]
Quaternion = tuple[float, float, float, float]
Matrix = tuple[Vector, Vector, Vector]

IDENTITY: Quaternion = (1.0, 0.0, 0.0, 0.0)


def multiply(p: Quaternion, q: Quaternion) -> Quaternion:
    """Return the rotation that does `q` first, then `p`."""
    pw, px, py, pz = p
    qw, qx, qy, qz = q
    return (
        pw * qw - px * qx - py * qy - pz * qz,
        pw * qx + px * qw + py * qz - pz * qy,
        pw * qy - px * qz + py * qw + pz * qx,
        pw * qz + px * qy - py * qx + pz * qw,
    )


def conjugate(q: Quaternion) -> Quaternion:
    """Return the rotation back."""
    w, x, y, z = q
    return (w, -x, -y, -z)


def normalised(q: Quaternion) -> Quaternion | None:
    """`q` at length 1; `None` where it is too far from it to be an orientation."""
    length = math.hypot(*q)
    if not 0.5 < length < 2.0:
        return None
    w, x, y, z = q
    return (w / length, x / length, y / length, z / length)


def matrix(q: Quaternion) -> Matrix:
    """Return the rotation matrix of the unit quaternion `q`."""
    w, x, y, z = q
    return (
        (1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)),
        (2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)),
        (2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)),
    )


def transform(m: Matrix, v: Vector) -> Vector:
    """`m` times `v`."""
    x, y, z = v
    (a, b, c), (d, e, f), (g, h, i) = m
    return (a * x + b * y + c * z, d * x + e * y + f * z, g * x + h * y + i * z)


def up(q: Quaternion) -> Vector:
    """Return the direction of the world's z in body axes, for attitude `q` (world from body)."""
    w, x, y, z = q
    return (2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y))


def rotate(q: Quaternion, v: Vector) -> Vector:
    """`v` turned by the unit quaternion `q`."""
    return transform(matrix(q), v)


def about_x(angle: float) -> Quaternion:
    return (math.cos(angle / 2), math.sin(angle / 2), 0.0, 0.0)


def about_y(angle: float) -> Quaternion:
    return (math.cos(angle / 2), 0.0, math.sin(angle / 2), 0.0)


def about_z(angle: float) -> Quaternion:
    return (math.cos(angle / 2), 0.0, 0.0, math.sin(angle / 2))


def from_yaw_pitch_roll(roll: float, pitch: float, yaw: float) -> Quaternion:
    """Yaw about z, then pitch about the new y, then roll about the new x (REP-103, ISO 8855)."""
    return multiply(about_z(yaw), multiply(about_y(pitch), about_x(roll)))


def from_axes(axes: tuple[str, str, str]) -> Quaternion:
    """Return the rotation from sensor to body; `axes` are the sensor's along the body's x, y and z.

    Raises:
        ValueError: they do not name three different axes of a right-handed frame.

    """
    rows = [_unit(axis) for axis in axes]
    (a, b, c), (d, e, f), (g, h, i) = rows
    if a * (e * i - f * h) - b * (d * i - f * g) + c * (d * h - e * g) != 1:
        raise ValueError(
            f"axes {list(axes)} are no right-handed frame: name each of x, y, z once, and change one sign"
        )
    return from_matrix((rows[0], rows[1], rows[2]))


def from_matrix(m: Matrix) -> Quaternion:
    """Return the unit quaternion of the rotation matrix `m` (Shepperd's method: the largest part first)."""
    (a, b, c), (d, e, f), (g, h, i) = m
    parts = (1 + a + e + i, 1 + a - e - i, 1 - a + e - i, 1 - a - e + i)
    largest = max(range(4), key=parts.__getitem__)
    s = 2 * math.sqrt(parts[largest])
    if largest == 0:
        return (s / 4, (h - f) / s, (c - g) / s, (d - b) / s)
    if largest == 1:
        return ((h - f) / s, s / 4, (b + d) / s, (c + g) / s)
    if largest == 2:
        return ((c - g) / s, (b + d) / s, s / 4, (f + h) / s)
    return ((d - b) / s, (c + g) / s, (f + h) / s, s / 4)


def _unit(axis: str) -> Vector:
    sign = -1.0 if axis.startswith("-") else 1.0
    name = axis.removeprefix("-")
    return (sign * (name == "x"), sign * (name == "y"), sign * (name == "z"))
