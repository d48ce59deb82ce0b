"""`sixpoint live` for somebody who has configured nothing: set up, calibrated in the window, saved, started."""

from pathlib import Path

from capture.asking import Asker
from capture.config import DeviceConfig, PerformerConfig, SessionConfig
from capture.going_live import opened, run_session, tell
from capture.guide import CalibrationGuide, residual_words
from capture.live import make_pipeline, make_session
from capture.profiles import save_profile
from capture.progress import progress_bar
from capture.setting_up import SESSION_FILE, plan_session, save_session
from devices.errors import SixpointError
from reconstruction.calibration import CalibrationResult


def set_up_session(
    asker: Asker, device: DeviceConfig | None, profile: str | None, shown: bool, path: Path = SESSION_FILE
) -> tuple[SessionConfig, Path | None]:
    """The configuration of a session that can start now, and its file where it was saved.

    device: where the command line names one; profile: the performer; shown: whether there is a window to guide in.
    Raises SixpointError where the calibration was given up.
    """
    plan = plan_session(asker, device, profile)
    config = plan.config
    if plan.calibrate:
        result = calibrate_live(config, config.performer.height_m, shown)
        if result is None:
            raise SixpointError("no calibration, so no session; `sixpoint live --no-guide` starts without one")
        save_profile(plan.name, result.profile)
        asker.say(f"{result.verdict}\n{residual_words(result)}\nSaved as performer {plan.name!r}.")
        config = config.model_copy(update={"performer": PerformerConfig(profile=plan.name)})
    return config, save_session(asker, config, path)


def calibrate_live(config: SessionConfig, height_m: float | None, shown: bool) -> CalibrationResult | None:
    """Guides whoever wears the trackers through calibration, in the window or at the terminal.

    None where they ended it before there was a result. Raises DeviceError and SettingError.
    """
    with progress_bar("opening the database") as progress:
        pipeline = make_pipeline(config, progress)
    with progress_bar("loading kernels"):
        pipeline.warm_up()
    guide = CalibrationGuide(pipeline.reconstructor.database, height_m)
    with opened(config) as devices:
        session = make_session(config, devices, pipeline, None, (guide.watch,), tell)
        run_session(session, None, shown, guide=guide)
    return guide.result
