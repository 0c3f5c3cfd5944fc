"""A milling cutter stepped through time, tooth by tooth and slice by slice; shares nothing with the package.

mm, N, degrees as written; right-hand cutter, spindle clockwise. At each step every slice of every tooth stands at its
angle; what it cuts reaches from its edge inwards to what the teeth before it left, exact circles about where the
deflected cutter then stood. It cuts only where the stock stood one turn before. Tip and cutter yield as the springs
that they are given, at once, and the chip is as thick as the yielding cutter makes it.
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
    slices: int = 60
    steps: int = 720  # a turn; a multiple of the teeth
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
        self.centre = np.zeros((total, 3))
        self.centre[:, 0] = np.arange(total) * self.feed / pitch
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
        turn_before = self.centre[step - self.steps][1] + self.reach * self.cosine
        wide = self.radius - self.width
        inside = {"left": turn_before > wide, "right": turn_before < -wide, "both": True}
        self.stock = inside[self.side] & (self.sine > 0.0)

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

    def below(self, aside: np.ndarray) -> np.ndarray:
        """Um of material left below, at distances mm to the left.

        A floor is passed ahead and behind, the lower pass counts; a ball makes a point where the normals agree.
        """
        if self.ball:
            out, angle = np.abs(aside) / self.radius, np.where(aside > 0, 0.0, np.pi)
            up = np.sqrt(1 - out**2)
            lag = self.radius * (1 - up) * np.tan(np.radians(self.helix)) / self.radius
            moved = self.when(angle, 0, lag)
            return 1e3 * (moved[:, 2] * up - moved[:, 1] * np.sign(aside) * out)
        ahead = np.arccos(aside / self.radius)
        passes = [
            self.when(angle, tooth, np.zeros_like(angle))[:, 2]
            for angle in (ahead, 2 * np.pi - ahead)
            for tooth in range(self.teeth)
        ]
        return 1e3 * np.min(passes, axis=0)
