"""A milling cutter stepped through time, tooth by tooth and slice by slice; shares nothing with the package.

mm, N, degrees as written; right-hand cutter, spindle clockwise. At each step every slice of every tooth stands at its
angle; what it cuts reaches from its edge inwards to what the teeth before it left, exact circles about where the
deflected cutter then stood. It cuts only where the stock stood when the tooth before passed, or a turn before. Tip and
cutter yield as the springs that they are given, at once, and the chip is as thick as the yielding cutter makes it.
"""

from dataclasses import dataclass, field

import numpy as np


@dataclass
class Mill:
    """A cutter at work along x, its wall to the left or to the right, its motion over the last turn after `turns`."""

    radius: float
    teeth: int
    helix: float
    depth: float
    feed: float  # mm per tooth
    coefficients: tuple[float, ...]  # Ktc, Krc, Kac N/mm2; Kte, Kre, Kae N/mm
    compliance: np.ndarray  # (3, 3) mm/N
    width: float  # of cut
    side: str = "left"  # where the work is; "both" of a slot
    ball: bool = False
    run_out: float = 0.0
    run_out_angle: float = 0.0
    slices: int = 40
    steps: int = 360  # a turn; a multiple of the teeth
    turns: int = 3
    centre: np.ndarray = field(init=False)

    def __post_init__(self) -> None:
        self.z = (np.arange(self.slices) + 0.5) * self.depth / self.slices
        self.lag = self.z * np.tan(np.radians(self.helix)) / self.radius
        self.tooth_radius = self.run_out * np.cos(self.run_out_angle + 2 * np.pi * np.arange(self.teeth) / self.teeth)
        kappa = np.arccos(1 - self.z / self.radius) if self.ball else np.full(self.slices, np.pi / 2)
        self.out, self.up = np.sin(kappa), np.cos(kappa)
        self.slice_radius = self.radius * self.out
        self.length = self.depth / self.slices / self.out
        self.run()

    def run(self) -> None:
        """Step through the turns."""
        total, pitch = self.steps * (self.turns + 1), self.steps // self.teeth
        self.centre = self.path(np.arange(total) * self.feed / pitch)
        nominal = self.centre.copy()
        self.force = np.zeros((total, 3))
        for step in range(self.steps, total):
            self.look_back(step, pitch)
            here, correction = self.centre[step - 1] - nominal[step - 1], np.eye(3)
            off = here - self.compliance @ self.force_at(nominal[step] + here)
            for _ in range(25):  # the deflection follows the force that it changes: Broyden's rule
                if np.abs(off).max() < 1e-7:
                    break
                move = -correction @ off
                here = here + move
                before, off = off, here - self.compliance @ self.force_at(nominal[step] + here)
                change = correction @ (off - before)
                correction = correction + np.outer(move - change, move @ correction) / (move @ change)
            self.centre[step] = nominal[step] + here
            self.force[step] = self.force_at(self.centre[step])
        self.deflection = self.centre - nominal

    def path(self, travel: np.ndarray) -> np.ndarray:
        """Where the rigid cutter's tip is after so many mm."""
        return np.stack([travel, 0 * travel, 0 * travel], axis=-1)

    def stock_at(self, step: int, x: np.ndarray, y: np.ndarray) -> np.ndarray:
        """Whether points are in the stock, `memory` steps before a step."""
        wide = self.radius - self.width
        return {"left": y > wide, "right": y < -wide, "both": np.full(y.shape, True)}[self.side]

    def look_back(self, step: int, pitch: int) -> None:
        """Where the teeth are at a step, and what the teeth before them left."""
        teeth = np.arange(self.teeth)
        phi = 2 * np.pi * (step / self.steps - teeth / self.teeth)[:, None] - self.lag
        self.sine, self.cosine = np.sin(phi), np.cos(phi)
        back = teeth[:, None] + 1
        self.earlier = self.centre[step - back * pitch][..., None]  # (teeth before, 1, 3, 1)
        circle = self.slice_radius + self.tooth_radius[(teeth - back) % self.teeth][..., None] * self.out
        self.circle = circle  # (teeth before, tooth, slice)
        self.reach = self.slice_radius + self.tooth_radius[:, None] * self.out
        # With run-out the tooth before may not have cut.
        self.memory = self.steps if self.run_out else pitch
        before = self.centre[step - self.memory]
        self.stock = self.stock_at(step, before[0] + self.reach * self.sine, before[1] + self.reach * self.cosine)

    def force_at(self, now: np.ndarray) -> np.ndarray:
        """N on the cutter if its centre is here."""
        tangential, radial, axial, *edges = self.coefficients
        x, y, z = (self.earlier[:, :, k] - now[k] for k in range(3))
        along = x * self.sine + y * self.cosine
        # A ball that stood higher had a narrower circle at this height.
        circle = self.circle - (z * self.up / self.out if self.ball else 0.0)
        left = along + np.sqrt(np.maximum(circle**2 - (x * x + y * y - along * along), 0.0))
        chip = np.where(self.stock, np.maximum((self.reach - left.max(axis=0)) * self.out, 0.0), 0.0)
        ramp = np.minimum(chip / 1e-3, 1.0)
        t, r, a = ((k * chip + e * ramp) * self.length for k, e in zip((tangential, radial, axial), edges, strict=True))
        across = r * self.out + a * self.up
        return np.array(
            [
                (-t * self.cosine - across * self.sine).sum(),
                (t * self.sine - across * self.cosine).sum(),
                (r * self.up - a * self.out).sum(),
            ]
        )

    def when(self, phi: np.ndarray, tooth: int, lag: np.ndarray) -> np.ndarray:
        """Deflection mm when a tooth passes an angle in the last turn."""
        step = (phi + lag + 2 * np.pi * tooth / self.teeth) / (2 * np.pi) * self.steps
        step = step % self.steps + self.steps * self.turns
        return np.stack([np.interp(step, np.arange(len(self.deflection)), d) for d in self.deflection.T], axis=-1)

    def wall(self, side: str) -> np.ndarray:
        """Um of material left on a wall, by slice; the deepest tooth counts."""
        angle, sign = (0.0, 1.0) if side == "left" else (np.pi, -1.0)
        deepest = [
            sign * self.when(np.full(self.slices, angle), tooth, self.lag)[:, 1] + self.tooth_radius[tooth]
            for tooth in range(self.teeth)
        ]
        return -1e3 * (np.max(deepest, axis=0) - self.tooth_radius.max())

    def below(self, aside: np.ndarray, climb: float = 0.0) -> np.ndarray:
        """Um of material left below, square to the path, at distances mm to the left; `climb`: mm a mm of travel.

        A floor is passed ahead and behind, the lower pass counts; a ball makes a point where the normals agree.
        """
        if self.ball:
            out, angle = np.abs(aside) / self.radius, np.where(aside > 0, 0.0, np.pi)
            up = np.sqrt(1 - out**2)
            lag = self.radius * (1 - up) * np.tan(np.radians(self.helix)) / self.radius
            moved = self.when(angle, 0, lag)
            return 1e3 * (moved[:, 2] * up - moved[:, 1] * np.sign(aside) * out)
        ahead = np.arccos(aside / self.radius)
        # The tip passes half a chord before the point, and half a chord beyond it.
        tips = [climb * side * np.sqrt(self.radius**2 - aside**2) for side in (-1, 1)]
        passes = [
            self.when(angle, tooth, np.zeros_like(angle))[:, 2] + tip
            for angle, tip in zip((ahead, 2 * np.pi - ahead), tips, strict=True)
            for tooth in range(self.teeth)
        ]
        return 1e3 * (np.min(passes, axis=0) - np.min(tips, axis=0)) / np.hypot(1.0, climb)


class Corner(Mill):
    """A cutter that finishes an inner corner: along x with its wall to the right, then left, along y.

    The corner is at the origin of its centre's path; before, a path `width` nearer to the middle was taken.
    """

    def path(self, travel: np.ndarray) -> np.ndarray:
        """To the origin after `before` mm, and on."""
        self.before = 0.62 * travel[-1]
        past = travel - self.before
        return np.stack([np.minimum(past, 0.0), np.maximum(past, 0.0), 0 * past], axis=-1)

    def stock_at(self, step: int, x: np.ndarray, y: np.ndarray) -> np.ndarray:
        """What neither the path before nor this one, `memory` steps ago and earlier, has taken."""
        moved = self.centre[step - 1] - self.centre[step - self.memory]  # the path before cut long ago
        u, v = x + moved[0] + self.width, y + moved[1] - self.width
        inner = np.minimum(np.hypot(np.maximum(u, 0.0), v), np.hypot(u, np.minimum(v, 0.0)))  # from its legs
        pitch = self.steps // self.teeth
        older = self.centre[step % pitch : step - self.memory : pitch]  # when teeth stood at these angles
        taken = (np.hypot(x - older[:, 0, None, None], y - older[:, 1, None, None]) < self.radius).any(axis=0)
        return (inner > self.radius) & ~taken

    def walls(self) -> list[tuple[float, float, float]]:
        """For each pass of a tooth over a wall: mm along the path from the corner; um left, mean and range of the wall.

        Of both walls, by the deflection of each slice when the tooth stands square to it.
        """
        rows, travel = [], self.feed * self.teeth / self.steps
        for angle, axis, sign in ((np.pi, 1, 1.0), (0.5 * np.pi, 0, -1.0)):
            for turn in range(2, self.turns):
                for tooth in range(self.teeth):
                    step = ((angle + self.lag + 2 * np.pi * tooth / self.teeth) / (2 * np.pi) + turn) * self.steps
                    past = step.mean() * travel - self.before
                    if (past < -0.1) == (axis == 1) and (past > 0.1) == (axis == 0):
                        left = 1e3 * sign * np.interp(step, np.arange(len(self.deflection)), self.deflection[:, axis])
                        rows.append((past, left.mean(), np.ptp(left)))
        return rows
