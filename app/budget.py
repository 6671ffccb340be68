"""How coarse to draw so that frames take the time that they may: a controller without a clock, a window or OpenGL.

Coarseness is a factor of at least 1 on the largest radii of splats. Frame times are looked at as logarithms, relative
to the goal: noise is a share of the time, and a power law between time and coarseness becomes a line.
"""

from __future__ import annotations

import math
from collections import deque
from statistics import median, median_low

# From a radius of 2 pixels to 16; what is coarser still is no picture of the model.
MAX_COARSENESS = 8.0

# Detail is lowered above 1.1 of the goal, raised below 0.75 of it, and both aim between: what a step misses by, and the
# next frames' noise, stay inside.
TOO_SLOW, TOO_FAST, AIM = math.log(1.1), math.log(0.75), math.log(0.92)

# Detail falls by at most 2 a step, and rises by at most the root of that: a wrong guess costs little.
LARGEST_FALL, LARGEST_RISE = math.log(2.0), 0.5 * math.log(2.0)

# Frames looked back at to lower detail: few show a jump of the load at once, many a small excess in spite of noise. Of
# each the lower median counts, so that one slow frame, such as the one that compiles a shader, lowers nothing.
LOOKS_BACK = (2, 4, 8, 16)
# Frames that have to agree before detail is raised.
PATIENCE = 8
# Where detail was raised and had to be lowered again, it is not raised there for so many frames, twice as many every
# time: where a little more detail costs much more time, one side would follow the other for ever.
FIRST_BAN, LONGEST_BAN = 64, 512
# Unless frames take less than half of what they may: then something else has changed.
LIFTS_BAN = math.log(2.0)

# Noise (standard deviation of the logarithm) assumed before anything has been measured.
FIRST_NOISE = 0.15
# The exponent p in time ~ 1 / coarseness^p: splats go with the square, other costs not at all.
FIRST_EXPONENT, LEAST_EXPONENT, LARGEST_EXPONENT = 1.2, 0.3, 2.0


class Controller:
    """Finds the coarseness that holds a frame time while the camera moves.

    goal : milliseconds that a frame may take; None: any, and the coarseness is 1
    coarseness : what the next frame is to be drawn with, in [1, MAX_COARSENESS]
    """

    def __init__(self, goal: float | None = None) -> None:
        self.goal = goal
        self.coarseness = 1.0
        # Logarithms of the last times over the goal, all at the present coarseness.
        self._times: deque[float] = deque(maxlen=LOOKS_BACK[-1])
        self._frames = 0
        self._differences = deque([FIRST_NOISE] * 4, maxlen=LOOKS_BACK[-1])
        self._exponent = FIRST_EXPONENT
        # Coarseness and median time before the last change, as logarithms.
        self._before: tuple[float, float] | None = None
        # Coarseness before the last change, if that raised detail.
        self._rose_from: float | None = None
        # Detail is not raised beyond this coarseness for so many frames, and the next time for so many.
        self._least = 1.0
        self._ban, self._next_ban = 0, FIRST_BAN

    def set_goal(self, goal: float | None) -> None:
        """Hold another time from now on; the coarseness starts from where it is, or from 1 without a goal."""
        if goal != self.goal:
            self.goal = goal
            self._forget()
            self._ban, self._next_ban = 0, FIRST_BAN
            if goal is None:
                self.coarseness = 1.0

    @property
    def settled(self) -> bool:
        """The last frames, enough to have raised detail, changed nothing."""
        return self._frames >= PATIENCE

    def measure(self, milliseconds: float) -> None:
        """Take in what a frame with the present coarseness took, and change the coarseness if need be."""
        if self.goal is None or not milliseconds > 0.0:
            return
        time = math.log(milliseconds / self.goal)
        if self._times:
            self._differences.append(abs(time - self._times[-1]))
        self._times.append(time)
        self._frames += 1
        self._ban = max(self._ban - 1, 0)
        excess = self._excess()
        if excess > 0.0:
            self._fall(min(excess / self._learn_exponent(), LARGEST_FALL))
        elif self.coarseness > 1.0 and self._frames >= PATIENCE:
            slack = AIM - median(self._times)
            if slack - self._noise / math.sqrt(len(self._times)) > AIM - TOO_FAST:
                self._ban = 0 if slack > LIFTS_BAN else self._ban
                self._rise(min(slack / self._learn_exponent(), LARGEST_RISE))

    @property
    def _noise(self) -> float:
        """Standard deviation of a frame's time; 0.954 of it is the median difference of two."""
        return median(self._differences) / 0.954

    def _excess(self) -> float:
        """Return by how much the last frames certainly exceed the aim; 0 where they need not be too slow."""
        times, noise = list(self._times), self._noise
        for count in LOOKS_BACK:
            if count > len(times):
                break
            certain = median_low(times[-count:]) - noise / math.sqrt(count)
            if certain > TOO_SLOW:
                return certain - AIM
        return 0.0

    def _learn_exponent(self) -> float:
        """Compare the times before and after the last change; the less the change drowns in noise, the more it says."""
        if self._before is not None:
            step = math.log(self.coarseness) - self._before[0]
            if step:
                seen = (self._before[1] - median_low(self._times)) / step
                seen = min(max(seen, LEAST_EXPONENT), LARGEST_EXPONENT)
                self._exponent += (seen - self._exponent) * step**2 / (step**2 + self._noise**2)
            self._before = None
        return self._exponent

    def _fall(self, step: float) -> None:
        """Divide the detail by exp(step)."""
        if self._rose_from is not None:
            self._least, self._ban = self._rose_from, self._next_ban
            self._next_ban = min(2 * self._next_ban, LONGEST_BAN)
            self._rose_from = None
        if self.coarseness < MAX_COARSENESS:
            self._change(min(self.coarseness * math.exp(step), MAX_COARSENESS))

    def _rise(self, step: float) -> None:
        """Multiply the detail by exp(step), but not beyond what has just proved too much."""
        if self._rose_from is not None and self.coarseness < self._least:
            # The last one went beyond, and has stood.
            self._next_ban = FIRST_BAN
        least = self._least if self._ban else 1.0
        wanted = max(self.coarseness * math.exp(-step), least)
        if wanted < self.coarseness:
            self._rose_from = self.coarseness
            self._change(wanted)

    def _change(self, coarseness: float) -> None:
        before = (math.log(self.coarseness), median_low(self._times))
        self._forget()
        self._before, self.coarseness = before, coarseness

    def _forget(self) -> None:
        self._times.clear()
        self._frames = 0
        self._before = None


class Budget:
    """Coarsens what moves and refines what rests.

    controller : sets the coarseness of what moves
    coarseness : what the next frame is to be drawn with
    rests : the camera has stood still for a while
    """

    def __init__(self) -> None:
        self.controller = Controller()
        self.coarseness = 1.0
        self.rests = True

    def update(self, *, moved: bool, rests: bool) -> None:
        """Set the coarseness of the next frame.

        moved : the camera has moved since the last call
        rests : it has stood still for a while
        """
        if moved:
            self.coarseness = self.controller.coarseness
        elif rests and not self.rests:
            self._refine()
        self.rests = rests and not moved

    def drawn(self, milliseconds: float, *, measured: bool) -> None:
        """Take in that a frame has been drawn, and how long it took.

        measured : it was drawn because the camera had moved, and for no other reason
        """
        if self.rests:
            self._refine()
        elif measured:
            self.controller.measure(milliseconds)

    def _refine(self) -> None:
        """Halve the coarseness, down to full detail: the window answers between any two of these frames."""
        self.coarseness = max(0.5 * self.coarseness, 1.0)


def coarsened(radius: float, coarseness: float) -> float:
    """Return the largest radius of a splat in pixels at a coarseness; a radius of 0 grows, too."""
    return max(radius * coarseness, coarseness - 1.0)
