"""Two solutions of one take beside each other, in step: what a changed setting does."""

from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from capture.comparing import Comparison, jitter_m_s3
from capture.figures_table import Refreshed, joined
from capture.latency import percentiles_ms
from capture.panel import TuningPanel
from capture.playing import PerformanceSource
from capture.scene import Badge, Colour, Scene, side_by_side
from capture.tuning import LiveSetting, Tuning
from capture.viewing import Action, Layers
from devices.sample import ROLES
from reconstruction.kinematics import world_transforms

LEFT: Colour = (0.15, 0.42, 0.78)
RIGHT: Colour = (0.86, 0.47, 0.12)


class SideBySideSource:
    """`FrameSource` over two sources of one take; settings that are changed hold for both.

    comparison: of the two solutions; names: what is shown on the left and on the right.
    """

    def __init__(
        self, left: PerformanceSource, right: PerformanceSource, comparison: Comparison, names: tuple[str, str]
    ) -> None:
        self.left, self.right, self.comparison, self.names = left, right, comparison, names
        self._degrees, self._cm = comparison.degrees.mean(axis=1), comparison.centimetres.mean(axis=1)
        self._jitter = [jitter_m_s3(side.performance.motion) for side in (left, right)]
        self.duration_s, self.frame_s, self.marks = left.duration_s, left.frame_s, left.marks
        self.tuning = Tuning(_both(left.tuning, right.tuning))
        self.panel = TuningPanel(self.tuning)
        self._time_s = 0.0
        self._figures = Refreshed(self._figure_rows)

    def scene(self, time_s: float, layers: Layers) -> Scene:
        """Both at that second."""
        if self.tuning.apply():
            self.left.swing()
            self.right.swing()
        self._time_s = time_s
        left, right = self.left.scene(time_s, layers), self.right.scene(time_s, layers)
        left_name, right_name = self.names
        return replace(
            side_by_side(left, right),
            title=self.comparison.take,
            badges=(Badge(LEFT, f"left: {left_name}"), Badge(RIGHT, f"right: {right_name}")),
            figures=self._figures.rows() if layers.statistics else (),
            panel=self.panel.panel(),
        )

    def actions(self) -> Mapping[str, Action]:
        """The keys of both."""
        return {"P": Action("poke the flesh", self._poke), **self.panel.actions()}

    def _poke(self) -> None:
        self.left.poke()
        self.right.poke()

    def _figure_rows(self) -> tuple[str, ...]:
        sides = (self.left, self.right)
        solved = [side.performance.solved for side in sides]
        now = min(round(self._time_s * self.comparison.fps), len(self._degrees) - 1)
        rows = ["solution\tleft\tright"]
        if solved[0] and solved[1]:
            times = [percentiles_ms(one.milliseconds) for one in solved if one]
            rows += [f"solve {p}, ms\t" + "\t".join(f"{t[p]:.1f}" for t in times) for p in ("p50", "p95", "p99")]
            coverage = [
                one.coverage[side.frame_at(self._time_s)] for one, side in zip(solved, sides, strict=True) if one
            ]
            rows.append("coverage now\t" + "\t".join(f"{c:.2f}" for c in coverage))
        off = [_off_trackers_cm(side, side.frame_at(self._time_s)) for side in sides]
        rows.append("off the trackers now, cm\t" + "\t".join(map(_or_dash, off)))
        rows.append("jitter, m/s^3\t" + "\t".join(f"{j:.1f}" for j in self._jitter))
        apart = [
            "between them\tnow\tmean",
            f"joint angles, degrees\t{self._degrees[now]:.1f}\t{self._degrees.mean():.1f}",
            f"joints, cm\t{self._cm[now]:.1f}\t{self._cm.mean():.1f}",
        ]
        return joined(rows, apart)


def _off_trackers_cm(source: PerformanceSource, frame: int) -> float:
    """Mean distance of the joints from their trackers; NaN without trackers."""
    p = source.performance
    if not len(p.frames):
        return float("nan")
    skeleton, motion = p.motion.skeleton, p.motion
    joints = world_transforms(skeleton, motion.root_positions[frame], motion.rotations[frame])
    places = joints[[skeleton.role_joint(role) for role in ROLES], :3, 3]
    off = np.linalg.norm(places - p.frames[frame].positions, axis=1)
    return 100 * float(off[np.isfinite(off)].mean()) if np.isfinite(off).any() else float("nan")


def _or_dash(value: float) -> str:
    return "-" if np.isnan(value) else f"{value:.1f}"


def _both(left: Tuning, right: Tuning) -> list[LiveSetting]:
    """The left one's settings, which write to both; only those that both have."""

    def shared(setting: LiveSetting, other: LiveSetting) -> LiveSetting:
        def write(value: float | bool) -> None:
            setting.write(value)
            other.write(value)

        return replace(setting, write=write)

    names = [name for name in left.settings if name in right.settings]
    return [shared(left.settings[name], right.settings[name]) for name in names]
