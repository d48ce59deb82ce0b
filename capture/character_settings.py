"""The `[character]` section as the deformation takes it, and what of it can be changed while it runs."""

from collections.abc import Callable
from dataclasses import replace
from typing import Protocol

from capture.characters import Cast, cast
from capture.config import CharacterConfig
from capture.tuning import LiveSetting, Value
from deformation.character import LatticeSettings
from deformation.deformer import DeformSettings
from deformation.live_deformer import LiveDeformer
from deformation.materials import MATERIAL_REGIONS, SOFTEST
from deformation.secondary_motion import SecondarySettings
from reconstruction.motion import Pose
from reconstruction.skeleton import Skeleton


class HasDeformer(Protocol):
    """A pipeline, or a recording being played."""

    @property
    def deformer(self) -> LiveDeformer | None: ...


def lattice_settings(look: CharacterConfig) -> LatticeSettings:
    """How finely the character is cut, and what moves as one."""
    return LatticeSettings(particles=look.particles, region_half_width=look.region_half_width)


def configured_cast(look: CharacterConfig, performer: Skeleton, reference: Pose | None = None) -> Cast:
    """The configured character in a performer's part. Raises as `capture.characters.cast`."""
    examples, painting = look.examples or None, look.painting or None
    return cast(look.mesh, performer, look.resolution, reference, lattice_settings(look), examples, painting)


def deform_settings(look: CharacterConfig) -> DeformSettings:
    """What is done to the particles."""
    swing = SecondarySettings(look.delta, look.frequency_hz, look.damping_ratio, (0.0, -look.gravity_m_s2, 0.0))
    return DeformSettings(
        look.volume,
        swing if look.secondary else None,
        {str(region): factor for region, factor in look.softness.items()},
    )


def character_settings(owner: HasDeformer) -> list[LiveSetting]:
    """What can be changed while the character is shown, named as in `session.toml`; none where none is skinned."""
    return [] if owner.deformer is None else _Settings(owner.deformer).all()


class _Settings:
    """Reads and writes a deformer's settings one by one."""

    def __init__(self, deformer: LiveDeformer) -> None:
        self.deformer = deformer
        self._swing = deformer.settings.secondary or SecondarySettings()

    def all(self) -> list[LiveSetting]:
        return [
            self._setting("delta", *self._of_swing("delta"), step=0.05),
            self._setting("frequency_hz", *self._of_swing("frequency_hz"), unit="Hz", step=0.25),
            self._setting("damping_ratio", *self._of_swing("damping_ratio"), step=0.05),
            self._setting("gravity_m_s2", self._gravity, self._set_gravity, unit="m/s²", step=1),
            self._setting("secondary", self._swings, self._set_swings),
            self._setting("volume", self._volume, self._set_volume),
            self._setting("particles", *self._of_lattice("particles"), step=200),
            self._setting("region_half_width", *self._of_lattice("region_half_width"), unit="cells", step=1),
            *(self._softness(region) for region in MATERIAL_REGIONS),
        ]

    def _setting(
        self, key: str, read: Callable[[], Value], write: Callable[[Value], None], unit: str = "", step: float = 0.1
    ) -> LiveSetting:
        """A setting with the text and the range that `session.toml` has for it."""
        field = CharacterConfig.model_fields[key]
        bounds = {type(item).__name__: item for item in field.metadata}
        low, high = (float(bounds["Ge"].ge), float(bounds["Le"].le)) if bounds else (0.0, 1.0)
        return LiveSetting(f"character.{key}", field.description or "", read, write, unit, low, high, step)

    def _of_swing(self, name: str) -> tuple[Callable[[], Value], Callable[[Value], None]]:
        return lambda: getattr(self._swing, name), lambda value: self._set_swing(replace(self._swing, **{name: value}))

    def _gravity(self) -> Value:
        return -self._swing.gravity_m_s2[1]

    def _set_gravity(self, value: Value) -> None:
        self._set_swing(replace(self._swing, gravity_m_s2=(0.0, -float(value), 0.0)))

    def _set_swing(self, swing: SecondarySettings) -> None:
        """Kept for when the flesh is let swing again, where it is not now."""
        self._swing = swing
        if self.deformer.settings.secondary is not None:
            self.deformer.settings = replace(self.deformer.settings, secondary=swing)

    def _swings(self) -> Value:
        return self.deformer.settings.secondary is not None

    def _set_swings(self, value: Value) -> None:
        self.deformer.settings = replace(self.deformer.settings, secondary=self._swing if value else None)

    def _volume(self) -> Value:
        return self.deformer.settings.volume

    def _set_volume(self, value: Value) -> None:
        self.deformer.settings = replace(self.deformer.settings, volume=bool(value))

    def _of_lattice(self, name: str) -> tuple[Callable[[], Value], Callable[[Value], None]]:
        def read() -> Value:
            value = getattr(self.deformer.lattice_settings, name)
            return float(len(self.deformer.character.lattice.particles) if value is None else value)

        def write(value: Value) -> None:
            changed = {name: round(float(value))} | ({"cell_size_m": None} if name == "particles" else {})
            self.deformer.rebind(replace(self.deformer.lattice_settings, **changed))

        return read, write

    def _softness(self, region: str) -> LiveSetting:
        def read() -> Value:
            return float(self.deformer.settings.softness.get(region, 1.0))

        def write(value: Value) -> None:
            softness = dict(self.deformer.settings.softness) | {region: float(value)}
            self.deformer.settings = replace(self.deformer.settings, softness=softness)

        text = f"Factor on the softness of the {region}: 0 is rigid, 1 as it is made."
        return LiveSetting(f"character.softness.{region}", text, read, write, "", 0.0, SOFTEST, 0.1)
