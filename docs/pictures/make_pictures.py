"""Makes the pictures of the guide and the concepts anew from the shipped take: `python docs/pictures/make_pictures.py`.

Scenes are drawn by `capture.raster`, diagrams by matplotlib; all of them show what the program computes.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import matplotlib as mpl
import numpy as np
from numpy.typing import NDArray
from PIL import Image

from capture.library import open_named_database
from capture.raster import contact_sheet, render
from capture.scene import LATTICE, Camera, Lines, Scene, Surface, ghost_marks, skeleton_marks, tracker_spheres
from deformation.character import Character, mannequin_character
from deformation.deformer import Deformer
from deformation.lattice import CORNERS
from deformation.mannequin import mannequin_colours
from devices.frame import TrackerFrame
from devices.sample import ROLES
from reconstruction.baselines.neighbourhood import own_history
from reconstruction.body_kinematics import Body, joint_positions
from reconstruction.database import MotionDatabase
from reconstruction.default_predictor import DefaultPredictor, NeighbourSettings
from reconstruction.gathering import gather
from reconstruction.kinematics import world_transforms
from reconstruction.local_model import LocalModelSettings
from reconstruction.local_regression import history_weights
from reconstruction.motion import Pose
from reconstruction.prediction import Observation, Prediction, SolvedPose
from reconstruction.solution import Solution
from reconstruction.solver import Reconstructor
from reconstruction.tracking import Footing
from reconstruction.window_features import SPAN, seen_from
from replay_logs.frames import load_frames

mpl.use("Agg")

from matplotlib import pyplot as plt

HERE = Path(__file__).parent
TAKE = HERE.parents[1] / "replay_logs" / "takes" / "demo.mcap"
FPS = 60.0
SHOWN_S = (2.2, 6.1, 11.3, 15.75, 16.05, 20.6, 21.85, 26.4)
"""Moments of the demo that the guide shows."""
MOMENT_S = 11.3
"""The moment at which the concepts look inside: a jog."""
DEGREE = ("LeftLeg", 0)
"""The degree of freedom whose regression is drawn: the left knee's bending."""


class WatchedPredictor:
    """Our own prior, remembering what it was asked and what it said."""

    def __init__(self, database: MotionDatabase) -> None:
        self._own = DefaultPredictor(database, 1.0, NeighbourSettings(), LocalModelSettings())
        self.said: Prediction
        self.past: list[SolvedPose]

    def predict(self, past: Sequence[SolvedPose], seen: Observation) -> Prediction:
        self.past, self.said = list(past), self._own.predict(past, seen)
        return self.said


@dataclass(frozen=True, eq=False)
class Moment:
    """A solved frame with the neighbours that its prior came from."""

    frame: TrackerFrame
    solution: Solution
    past: list[SolvedPose]
    rows: NDArray[np.int64]


def main() -> None:
    """Makes them all."""
    database, frames = open_named_database(), load_frames(TAKE, FPS)
    predictor = WatchedPredictor(database)
    solver = Reconstructor(database, predictor=predictor)
    moments = []
    for frame in frames[: round((max(SHOWN_S) + 0.1) * FPS)]:
        solution = solver.solve(frame)
        moments.append(Moment(frame, solution, predictor.past, predictor.said.rows))
    character = mannequin_character(solver.skeleton, "medium", moments[0].solution.pose)
    moment = moments[round(MOMENT_S * FPS)]
    save(contact_sheet([skinned(character, moments, s) for s in SHOWN_S]), "demo.jpg")
    save(contact_sheet(stages(character, moments)), "stages.jpg")
    save(neighbours(database, moment), "neighbours.jpg")
    save(headings(database), "heading.jpg")
    regression(database, moment)
    dropout(database, frames)


def save(image: NDArray[np.uint8], name: str) -> None:
    """As JPEG: small, and without bands in the sky."""
    Image.fromarray(image).save(HERE / name, quality=88, optimize=True)


def joints_of(character: Character, pose: Pose) -> NDArray[np.float64]:
    """(J, 4, 4) of a pose."""
    return world_transforms(character.skeleton, pose.root_position, pose.rotations)


def framed(scene: Scene, joints: NDArray[np.float64], width: int, height: int) -> NDArray[np.uint8]:
    """The scene from before the performer's left side."""
    hips, right, left = joints[0], joints[6], joints[1]
    yaw = float(np.arctan2(*(np.cross(left - right, [0.0, 1.0, 0.0])[[0, 2]])))
    camera = Camera((float(hips[0]), 0.88, float(hips[2])), 4.3, yaw + 0.55)
    return render(replace(scene, camera=camera), width, height)


def skin_at(character: Character, moments: Sequence[Moment], second: float) -> tuple[Surface, NDArray[np.float64]]:
    """The skin, swung by the half second before, and its particles."""
    deformer, now = Deformer(character), round(second * FPS)
    for moment in moments[max(0, now - 30) : now]:
        deformer.deform(joints_of(character, moment.solution.pose), 1 / FPS)
    shown = deformer.deform(joints_of(character, moments[now].solution.pose), 1 / FPS)
    colours = mannequin_colours(character.mesh)
    return Surface(shown.vertices, character.mesh.triangulated, shown.normals, colours), shown.particles


def skinned(character: Character, moments: Sequence[Moment], second: float) -> NDArray[np.uint8]:
    """The character with the trackers."""
    moment = moments[round(second * FPS)]
    skin, _ = skin_at(character, moments, second)
    scene = Scene(surfaces=(skin,), spheres=(tracker_spheres(moment.frame),))
    return framed(scene, joints_of(character, moment.solution.pose)[:, :3, 3], 232, 260)


def stages(character: Character, moments: Sequence[Moment]) -> list[NDArray[np.uint8]]:
    """Trackers, pose, particles and skin of one moment."""
    moment = moments[round(MOMENT_S * FPS)]
    joints = joints_of(character, moment.solution.pose)[:, :3, 3]
    trackers, (bones, balls) = tracker_spheres(moment.frame, 0.04), skeleton_marks(character.skeleton, joints)
    skin, particles = skin_at(character, moments, MOMENT_S)
    pairs = [(a, b) for a in range(8) for b in range(a) if np.abs(CORNERS[a] - CORNERS[b]).sum() == 1]
    edges = np.unique(np.sort(character.lattice.cells[:, pairs].reshape(-1, 2), axis=1), axis=0)
    scenes = (
        Scene(spheres=(trackers,)),
        Scene(lines=(bones,), spheres=(trackers, balls)),
        Scene(lines=(bones, Lines(particles, edges, LATTICE, width=0.7, opacity=0.6)), spheres=(balls,)),
        Scene(surfaces=(skin,)),
    )
    return [framed(scene, joints, 232, 320) for scene in scenes]


def neighbours(database: MotionDatabase, moment: Moment) -> NDArray[np.uint8]:
    """The solved pose among what its neighbours did next."""
    body, here = Body.of(database.space), moment.past[-1].heading
    points = joint_positions(body, gather(moment.rows, 0, np.asarray(database.poses), np.asarray(database.headings)))
    points = seen_from(points, np.tile(here, (len(points), 1)), np.zeros((len(points), 3)))
    pose = moment.solution.pose
    joints = world_transforms(database.space.skeleton, pose.root_position, pose.rotations)[:, :3, 3]
    bones, balls = skeleton_marks(database.space.skeleton, joints)
    ghosts = ghost_marks(database.space.skeleton, points, 0.25)
    scene = Scene(lines=(ghosts, bones), spheres=(balls, tracker_spheres(moment.frame, 0.035)))
    return framed(scene, joints, 420, 420)


def headings(database: MotionDatabase) -> NDArray[np.uint8]:
    """One pose at three places: the same numbers in the three heading frames that stand on the floor."""
    body = Body.of(database.space)
    q = np.asarray(database.poses[database.clips[0].first + 100], np.float64)
    lines, spheres = [], []
    for x, z, yaw in ((-1.3, 0.0, 0.3), (0.0, 0.5, -0.7), (1.3, 0.0, 1.5)):
        at = np.array([[x, z, yaw]])
        joints = seen_from(joint_positions(body, q[None]), at, np.zeros((1, 3)))[0]
        bones, balls = skeleton_marks(database.space.skeleton, joints)
        axes = np.array([[0.0, 0.01, 0.0], [0.4, 0.01, 0.0], [0.0, 0.01, 0.6]])
        placed = seen_from(axes[None], at, np.zeros((1, 3)))[0]
        colours = np.array([[0.85, 0.25, 0.2], [0.2, 0.45, 0.9]])
        lines += [bones, Lines(placed, np.array([[0, 1], [0, 2]]), colours, width=4.0)]
        spheres.append(balls)
    camera = Camera((0.0, 0.68, 0.0), 5.2, 0.0, 0.35)
    return render(Scene(lines=tuple(lines), spheres=tuple(spheres), camera=camera), 640, 330)


def regression(database: MotionDatabase, moment: Moment) -> None:
    """Eq. 8-10 for one degree of freedom: neighbours along the direction u, the line, and where the query falls."""
    poses, frames = np.asarray(database.poses), np.asarray(database.headings)
    histories = np.concatenate([gather(moment.rows, back, poses, frames) for back in range(1, SPAN + 1)], axis=1)
    joint = list(database.space.moving).index(database.space.skeleton.names.index(DEGREE[0]))
    y = gather(moment.rows, 0, poses, frames)[:, 6 + 3 * joint + DEGREE[1]]
    query = own_history(moment.past)
    weights = history_weights(histories, query)
    x, dy = histories - weights @ histories, y - weights @ y
    u = x.T @ (weights * dy)
    u /= np.linalg.norm(u)
    along, asked = x @ u, float((query - weights @ histories) @ u)
    gain = (weights @ (along * dy)) / (weights @ along**2)
    sigma = float(np.sqrt(weights @ (dy - gain * along) ** 2))
    figure, axes = plt.subplots(figsize=(5.2, 3.2), dpi=110)
    axes.scatter(along, np.degrees(y), s=400 * weights + 6, alpha=0.6, label="neighbours, by weight")
    line = np.array([along.min(), along.max()])
    mean = np.degrees(weights @ y + gain * line)
    axes.plot(line, mean, color="0.2", lw=1)
    axes.fill_between(line, mean - np.degrees(sigma), mean + np.degrees(sigma), color="0.85", zorder=0)
    axes.plot(asked, np.degrees(weights @ y + gain * asked), "r*", ms=13, label="prediction")
    axes.set(xlabel="history along u", ylabel="left knee, degrees from its mean")
    axes.legend(frameon=False)
    keep(figure, "regression.png")


def dropout(database: MotionDatabase, frames: Sequence[TrackerFrame]) -> None:
    """A wrist lost for 0.8 s, then all trackers for a second: the wrist's height, and what its place stands on."""
    wrist, begin, end = ROLES.index("left_wrist"), 6.0, 10.5
    solver = Reconstructor(database)
    joint, times, height, states = solver.role_joints[wrist], [], [], []
    for frame in frames[round(5.0 * FPS) : round(end * FPS)]:
        positions = frame.positions.copy()
        if 6.8 <= frame.time_s < 7.6:
            positions[wrist] = np.nan
        if 8.6 <= frame.time_s < 9.6:
            positions[:] = np.nan
        seen = {role: p for role, p in zip(ROLES, positions, strict=True) if np.isfinite(p[0])}
        solution = solver.solve(TrackerFrame.from_positions(frame.time_s, seen))
        pose = solution.pose
        times.append(frame.time_s)
        height.append(world_transforms(solver.skeleton, pose.root_position, pose.rotations)[joint, 1, 3])
        states.append(solution.states[wrist])
    truth = [(f.time_s, f.positions[wrist, 1]) for f in frames if begin <= f.time_s < end]
    figure, axes = plt.subplots(figsize=(6.4, 2.7), dpi=110)
    axes.plot(*zip(*truth, strict=True), color="0.6", lw=3, label="left wrist, true")
    axes.plot(times, height, color="tab:red", lw=1.2, label="solved")
    axes.set(ylabel="height, m", xlabel="s", xlim=(begin, end))
    for footing, colour in ((Footing.PRIOR, "tab:orange"), (Footing.HELD, "tab:purple")):
        where = np.array(states) == footing
        axes.fill_between(
            times,
            0,
            1,
            where,
            transform=axes.get_xaxis_transform(),
            color=colour,
            alpha=0.25,
            label=footing.name.lower(),
        )
    axes.legend(frameon=False, ncols=4, fontsize=8)
    keep(figure, "dropout.png")


def keep(figure: plt.Figure, name: str) -> None:
    """Writes a diagram."""
    figure.tight_layout()
    figure.savefig(HERE / name, metadata={"Software": None})
    plt.close(figure)


if __name__ == "__main__":
    main()
