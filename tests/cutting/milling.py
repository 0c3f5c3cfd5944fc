"""A program on a box of stock, for tests of engagement; mm in, SI out."""

import itertools

import numpy as np

from toolpath_stiff.cutting.cutters import Cutter
from toolpath_stiff.cutting.engagement import engage
from toolpath_stiff.cutting.patches import of_stations
from toolpath_stiff.cutting.stock import box_stock
from toolpath_stiff.cutting.workpiece import stages_of
from toolpath_stiff.nc.courses import points_along
from toolpath_stiff.nc.reader import parse_program
from toolpath_stiff.path.sampling import sample_moves


class Milling:
    """The program `text` of a cutter on the box between `low` and `high`."""

    def __init__(self, text, low=(-30, -30, -10), high=(60, 30, 0), diameter=10.0, corner=0.0, step=1.0):
        self.cutter = Cutter(0, diameter * 1e-3, corner * 1e-3, 3, 0.5)
        self.moves = parse_program(text).moves
        self.samples = sample_moves(self.moves, step * 1e-3)
        self.cutters = {0: self.cutter}
        stock = box_stock(tuple(np.multiply(low, 1e-3)), tuple(np.multiply(high, 1e-3)), "given")
        self.stages = list(stages_of(stock, self.moves, self.cutters))
        self.work = self.stages[-1]
        self.context = self.work, np.zeros(len(self.samples), int), self.samples, self.cutters

    def engaged(self):
        """All patches, and the removed volume of each sample."""
        self.engagement = engage(self.stages, self.moves, self.samples, self.cutters)
        return of_stations(self.engagement.patches, self.engagement.source), self.engagement.removed

    def removed(self):
        return self.engaged()[1]

    def contact(self, x, line=None):
        """Patches of the last sample at x (mm): rows of low, high (mm), entry, exit (degrees)."""
        near = np.abs(self.samples.position[:, 0] * 1e3 - x) < 1e-6
        near &= (self.samples.line == line) | (line is None)
        patches = self.engaged()[0]
        some = patches.take(patches.station == np.flatnonzero(near & (self.samples.motion != 0))[-1])
        return np.stack([some.low * 1e3, some.high * 1e3, np.degrees(some.entry), np.degrees(some.exit)], axis=1)

    def chords(self, sagitta):
        """Start and end, mm, of chords of all cutting moves."""
        for row in np.flatnonzero(self.moves.motion != 0):
            sweep = abs(self.moves.arc_sweep[row])
            radius = np.linalg.norm(self.moves.start[row, :3] - self.moves.arc_center[row]) * 1e3
            count = max(int(np.ceil(sweep / np.sqrt(8.0 * sagitta / radius))), 1) if sweep else 1
            shares = np.linspace(0.0, 1.0, count + 1)
            points = points_along(self.moves, np.full(count + 1, row), shares)[0] * 1e3
            yield from itertools.pairwise(points)
