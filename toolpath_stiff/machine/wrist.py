"""Six joints with a spherical wrist in closed form, all eight solutions: shoulder, elbow, wrist.

Brandstötter, Angerer, Hofbaur, An Analytical Solution of the Inverse Kinematics Problem of Industrial Serial
Manipulators with an Ortho-parallel Basis and a Spherical Wrist, Austrian Robotics Workshop 2014; here by the joints'
axes as they stand at values of 0, so that offsets, signs and conventions of a description need no translation.

The arm's frame G has z along axis 1 and y along axis 2; a turn about y by q multiplies the complex number z + ix of a
point of its plane by e^iq. The wrist's frame F has z along axis 4 and y along axis 5.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from toolpath_stiff.arrays import FloatArray
from toolpath_stiff.machine.chain import STILL, ChainJoint, FixedFrame, applied, turned, turned_from_left

# Of the arm's reach, and of 1: deviation by rounding and a file's digits of axes that should meet or be square.
SQUARE = 1e-6
CONFIGURATIONS = tuple(
    f"shoulder {shoulder}, elbow {elbow}, wrist {wrist}"
    for shoulder in ("front", "back")
    for elbow in ("up", "down")
    for wrist in ("plain", "turned")
)
SINGULARITIES = ("shoulder", "elbow", "wrist")


@dataclass(frozen=True)
class SphericalWrist:
    """Six rotary joints: the last three meet at a point, 2 and 3 are parallel, all other neighbours perpendicular.

    Attributes
    ----------
    base
        G in the frame before joint 1, its origin on axis 1.
    shoulder
        (z, x) m of axis 2 in the arm's plane.
    upper, lower
        Upper arm and forearm at joint values of 0, complex, m.
    lateral
        m, of the wrist's centre from the arm's plane through axis 1.
    sign
        1 or -1: axis 3 along or against axis 2.
    centre
        (3,) m, the wrist's centre in the tip's frame.
    before, after
        (3, 3) F^T G and R0^T F Ry(bend).
    bend
        rad, from axis 4 to axis 6 about axis 5 at joint values of 0.
    """

    base: FixedFrame
    shoulder: complex
    upper: complex
    lower: complex
    lateral: float
    sign: float
    centre: FloatArray
    before: FloatArray
    after: FloatArray
    bend: float

    @classmethod
    def of(cls, joints: Sequence[ChainJoint], tip: FixedFrame) -> SphericalWrist | None:
        """Closed form of six joints and the tip's frame in the last one; None if they have none."""
        if len(joints) != 6 or any(joint.linear for joint in joints):
            return None
        homes, home = [], STILL
        for joint in joints:
            home = home.then(joint.place)
            homes.append(home)
        home = home.then(tip)
        z = [frame.axes[:, 2] for frame in homes]
        reach = sum(float(np.linalg.norm(joint.place.origin)) for joint in joints[1:])
        centre = _meeting_point([frame.origin for frame in homes[3:]], z[3:], SQUARE * reach)
        square = max(abs(float(z[i] @ z[j])) for i, j in ((0, 1), (3, 4), (4, 5))) < SQUARE
        if centre is None or not square or abs(abs(float(z[1] @ z[2])) - 1.0) > SQUARE:
            return None
        arm = FixedFrame(np.column_stack([np.cross(z[1], z[0]), z[1], z[0]]), homes[0].origin)
        a, b, c = (
            arm.inverse().then(FixedFrame(np.eye(3), p)).origin for p in (homes[1].origin, homes[2].origin, centre)
        )
        plane = [complex(point[2], point[0]) for point in (a, b, c)]
        wrist = np.column_stack([np.cross(z[4], z[3]), z[4], z[3]])
        sine, _, cosine = wrist.T @ z[5]
        about_y = np.array([[cosine, 0.0, sine], [0.0, 1.0, 0.0], [-sine, 0.0, cosine]])
        return cls(
            base=arm,
            shoulder=plane[0],
            upper=plane[1] - plane[0],
            lower=plane[2] - plane[1],
            lateral=float(c[1]),
            sign=float(np.sign(z[1] @ z[2])),
            centre=home.inverse().then(FixedFrame(np.eye(3), centre)).origin,
            before=_cleaned(wrist.T @ arm.axes),
            after=_cleaned(home.axes.T @ wrist @ about_y),
            bend=float(np.arctan2(sine, cosine)),
        )

    def solutions(
        self, axes: FloatArray, tip: FloatArray, configuration: int | None = None
    ) -> Iterator[tuple[int, FloatArray]]:
        """Number and (6, n) rad of each of `CONFIGURATIONS`, or of one; nan where the arm does not reach.

        `axes` (3, 3, n) and `tip` (3, n) are the tip's frame in the frame before joint 1.
        """
        inverse = self.base.inverse()
        target = turned(turned_from_left(inverse.axes, axes), self.after)
        wrist = turned_from_left(inverse.axes, (tip + applied(axes, self.centre))[:, None])[:, 0]
        x, y, z = wrist + inverse.origin[:, None]
        upper, lower = abs(self.upper), abs(self.lower)
        with np.errstate(invalid="ignore"):
            flat, round_z = np.sqrt(x * x + y * y - self.lateral**2), np.arctan2(y, x)
            for number in range(0, 8, 2):
                if configuration is not None and configuration // 2 * 2 != number:
                    continue
                front, up = number < 4, number % 4 < 2
                radius = flat if front else -flat
                q1 = round_z - np.arctan2(self.lateral, radius)
                real, imaginary = z - self.shoulder.real, radius - self.shoulder.imag
                cosine = (real * real + imaginary * imaginary - upper**2 - lower**2) / (2.0 * upper * lower)
                # Up means the elbow above the line from shoulder to wrist, whichever way the arm leans.
                gamma = np.arccos(cosine) if front == up else -np.arccos(cosine)
                bend = np.arctan2(lower * np.sin(gamma), upper + lower * cosine)
                q2 = np.arctan2(imaginary, real) - bend - np.angle(self.upper)
                q3 = self.sign * (gamma - np.angle(self.lower) + np.angle(self.upper))
                rest = _unturned(target, q1, q2 + self.sign * q3)
                for i, wrist_angles in enumerate(self._wrist(rest)):
                    if configuration in (None, number + i):
                        yield number + i, np.stack([q1, q2, q3, *wrist_angles])

    def _wrist(self, rest: FloatArray) -> tuple[tuple[FloatArray, ...], tuple[FloatArray, ...]]:
        """q4, q5, q6 of both wrist solutions for the rest (3, 3, n): Rz(q4) Ry(q5 + bend) Rz(q6)."""
        euler = turned_from_left(self.before, rest)
        sine = np.hypot(euler[0, 2], euler[1, 2])
        q4, q5 = np.arctan2(euler[1, 2], euler[0, 2]), np.arctan2(sine, euler[2, 2])
        c, s = np.cos(q4), np.sin(q4)
        q6 = np.arctan2(c * euler[1, 0] - s * euler[0, 0], c * euler[1, 1] - s * euler[0, 1])
        return (q4, q5 - self.bend, q6), (q4 + np.pi, -q5 - self.bend, q6 + np.pi)

    def singularities(self, joints: FloatArray) -> FloatArray:
        """(3, n) distance from singularity at joint values (6, n): 1 far, 0 singular.

        Wrist centre's distance from axis 1 over the arm's length; sine of the elbow's bend; sine of the wrist's.
        """
        upper, lower = abs(self.upper), abs(self.lower)
        shoulder = joints[1] + np.angle(self.upper)
        gamma = self.sign * joints[2] + np.angle(self.lower) - np.angle(self.upper)
        out = (self.shoulder.imag + upper * np.sin(shoulder) + lower * np.sin(shoulder + gamma)) / (upper + lower)
        return np.asarray(np.abs(np.stack([out, np.sin(gamma), np.sin(joints[4] + self.bend)])))


def _meeting_point(origins: Sequence[FloatArray], axes: Sequence[FloatArray], most: float) -> FloatArray | None:
    """(3,) point nearest to three lines; None if it is farther than `most` from one of them."""
    across = [np.eye(3) - np.outer(axis, axis) for axis in axes]
    offset = np.sum([part @ origin for part, origin in zip(across, origins, strict=True)], axis=0)
    point = np.linalg.lstsq(np.sum(across, axis=0), offset)[0]
    apart = max(float(np.linalg.norm(part @ (point - origin))) for part, origin in zip(across, origins, strict=True))
    return point if apart <= most else None


def _cleaned(axes: FloatArray) -> FloatArray:
    """A constant rotation without the rounding of right angles, which would only cost multiplications."""
    return np.where(np.abs(axes) < 1e-14, 0.0, axes)


def _unturned(axes: FloatArray, about_z: FloatArray, about_y: FloatArray) -> FloatArray:
    """Product Ry^T Rz^T R, (3, 3, n)."""
    cosine, sine = np.cos(about_z), np.sin(about_z)
    x, y, z = cosine * axes[0] + sine * axes[1], cosine * axes[1] - sine * axes[0], axes[2]
    cosine, sine = np.cos(about_y), np.sin(about_y)
    rest = np.empty(axes.shape)
    np.subtract(cosine * x, sine * z, out=rest[0])
    rest[1] = y
    np.add(sine * x, cosine * z, out=rest[2])
    return rest
