"""A deformer whose lattice can be made finer or coarser while it runs."""

import multiprocessing
import threading
from dataclasses import fields, is_dataclass, replace
from multiprocessing.connection import Connection

import numpy as np
from numpy.typing import NDArray

from deformation.character import Character, LatticeSettings, rebound
from deformation.deformer import DeformedMesh, Deformer, DeformSettings
from devices.errors import SixpointError

FADE_S = 0.3
"""Seconds in which the skin goes over from one lattice to the next."""


class LiveDeformer:
    """Deforms one character frame by frame, as `Deformer` does; `rebind` gives it another lattice.

    Binding takes half a second and would hold Python's lock for much of it, so it is done in a process of its own. The
    new lattice takes over between two frames; both are carried along for `FADE_S` while the skin goes from one to the
    other, so that nothing jumps.
    """

    def __init__(self, character: Character, settings: DeformSettings | None = None) -> None:
        self._now = Deformer(character, settings)
        self._before: Deformer | None = None
        self._faded_s = 0.0
        self._wanted = character.settings
        self._failure: SixpointError | None = None
        self._arrived: Deformer | None = None
        self._worker: threading.Thread | None = None
        self._lock = threading.Lock()

    @property
    def character(self) -> Character:
        """The character as it is bound now."""
        return self._now.character

    @property
    def settings(self) -> DeformSettings:
        """What is done to the particles; set between two frames."""
        return self._now.settings

    @settings.setter
    def settings(self, settings: DeformSettings) -> None:
        self._now.settings = settings
        if self._before is not None:
            self._before.settings = settings

    @property
    def lattice_settings(self) -> LatticeSettings:
        """What the lattice is, or is about to be, bound with."""
        return self._wanted

    @property
    def is_rebinding(self) -> bool:
        """Whether a new binding is under way."""
        return self._worker is not None or self._arrived is not None

    @property
    def failure(self) -> SixpointError | None:
        """Why the last `rebind` came to nothing; None where it did not."""
        return self._failure

    def rebind(self, settings: LatticeSettings) -> None:
        """Begins to bind the character anew; frames go on meanwhile. Of several wishes the last one counts."""
        with self._lock:
            self._wanted, self._failure = settings, None
            if self._worker is None:
                self._worker = threading.Thread(target=self._work, name="rebinding", daemon=True)
                self._worker.start()

    def reset(self) -> None:
        """Forgets all motion: the next frame starts at rest on its pose."""
        self._before = None
        self._now.reset()

    def push(self, velocity_m_s: NDArray[np.float64], centre: NDArray[np.float64], radius_m: float) -> None:
        """As `Deformer.push`."""
        self._now.push(velocity_m_s, centre, radius_m)

    def poke(self, speed_m_s: float = 2.0) -> None:
        """As `Deformer.poke`."""
        self._now.poke(speed_m_s)

    def deform(self, T_world_joint: NDArray[np.float64], dt_s: float = 1 / 60) -> DeformedMesh:
        """As `Deformer.deform`; the number of particles may change from one frame to the next."""
        self._take_over()
        shown = self._now.deform(T_world_joint, dt_s)
        if self._before is None:
            return shown
        if self._faded_s >= FADE_S:
            self._before = None
            return shown
        way = self._faded_s / FADE_S
        self._faded_s += dt_s
        return self._now.mixed(self._before.deform(T_world_joint, dt_s).vertices, way * way * (3 - 2 * way))

    def _take_over(self) -> None:
        with self._lock:
            arrived, self._arrived = self._arrived, None
        if arrived is not None:
            arrived.settings = self._now.settings
            self._before, self._now, self._faded_s = self._now, arrived, 0.0

    def _work(self) -> None:
        """Binds until the last wish is fulfilled."""
        settings = None
        while True:
            with self._lock:
                if self._wanted == settings:
                    self._worker = None
                    return
                settings = self._wanted
            try:
                arrived = Deformer(_rebound_apart(self._now.character, settings), self._now.settings)
            except SixpointError as error:
                with self._lock:
                    self._failure = error
            else:
                with self._lock:
                    self._arrived = arrived


def _rebound_apart(character: Character, settings: LatticeSettings) -> Character:
    """`rebound` in a process of its own. Raises SixpointError as it does, and where the process is lost."""
    context = multiprocessing.get_context("spawn")
    here, there = context.Pipe()
    bare = replace(character, examples=())
    process = context.Process(target=_bind, args=(there, bare, settings), name="sixpoint binding", daemon=True)
    process.start()
    there.close()
    try:
        result = here.recv()
    except EOFError:
        raise SixpointError("the character could not be bound anew: the process that did it is lost") from None
    finally:
        here.close()
        process.join()
    if isinstance(result, SixpointError):
        raise result
    _make_read_only(result)
    return replace(
        result, mesh=character.mesh, skeleton=character.skeleton, bind=character.bind, examples=character.examples
    )


def _bind(connection: Connection, character: Character, settings: LatticeSettings) -> None:
    """What the other process does."""
    try:
        connection.send(rebound(character, settings))
    except SixpointError as error:
        connection.send(error)
    connection.close()


def _make_read_only(value: object) -> None:
    """Arrays come writeable out of a pipe; the kernels are compiled for those that are not."""
    if isinstance(value, np.ndarray):
        value.flags.writeable = False
    elif is_dataclass(value):
        for field in fields(value):
            _make_read_only(getattr(value, field.name))
