"""Loops that cannot end, or make no move in very many blocks: found where they go back."""

from __future__ import annotations

from dataclasses import dataclass

from toolpath_stiff.nc.state import State

MOST_IDLE = 100_000  # blocks of loops that run without a move between; a program that works out values needs far fewer
# What a control gathers and no block reads: left out where one pass of a loop is compared with another.
GATHERED = frozenset(
    (
        "recorder", "used_tools", "tip_held", "unsupported", "warnings", "assumptions", "bare", "pointed", "trace",
        "turning",
    )
)  # fmt: skip


@dataclass
class LoopGuard:
    """Compares a run with itself at earlier jumps back.

    What runs next follows from the run's present state alone: once a state comes again, so does all after it. The
    state is held against one that is renewed after 2, 4, 8... passes, so that any period is found within about
    three times its length (Brent, "An improved Monte Carlo factorization algorithm", BIT 20 (1980) 176).

    Attributes
    ----------
    state
        Of the control.
    passes
        Jumps back so far.
    earlier
        The run at one of them: what changes often, and all else as text.
    moved
        Moves at the last jump back after a move, and the blocks that had run by then.
    """

    state: State
    passes: int = 0
    earlier: tuple[list[object], str] | None = None
    moved: tuple[int, int] = (-1, 0)

    def fault(self, steps: int, often: list[object], rarely: object) -> tuple[str, str]:
        """What is wrong with a loop that goes back now, `{}` for its line, and what was expected; "" if nothing is.

        `steps`: blocks so far; `often`: what a loop's condition reads; `rarely`: what else the run keeps.
        """
        self.passes += 1
        if self.earlier is not None and self.earlier[0] == often and self.earlier[1] == self._modes(rarely):
            problem = "the loop back to line {} never ends: no variable or position changes in it"
            return problem, "a loop whose condition becomes false"
        if self.passes & (self.passes - 1) == 0:
            self.earlier = often, self._modes(rarely)
        moves = len(self.state.recorder)
        if moves != self.moved[0]:
            self.moved = moves, steps
        elif steps - self.moved[1] > MOST_IDLE:
            problem = f"more than {MOST_IDLE:,} blocks of loops without a move, back to line {{}} each time"
            return problem, "a loop that ends: see whether its condition becomes false"
        return "", ""

    def _modes(self, rarely: object) -> str:
        """All else that the control keeps, as text: it is large, and rarely compared."""
        return repr(([value for name, value in vars(self.state).items() if name not in GATHERED], rarely))
