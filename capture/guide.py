"""The performer led through calibration while a session runs: what to do, the countdown, the result, again if poor.

Nobody has to come back to the keyboard: a good result is taken, and a poor one tried again, after a few seconds.
"""

import math
import threading
import time
from collections.abc import Callable, Mapping
from enum import Enum

from capture.calibrating import CalibrationRun, CalibrationScript, StepKind
from capture.pipeline import Shot
from capture.scene import Banner
from capture.viewing import Action
from devices.errors import SixpointError
from reconstruction.calibration import CalibrationResult, Grade
from reconstruction.database import MotionDatabase

_READ_GOOD_S, _READ_POOR_S = 6.0, 12.0
"""How long a result stands before what follows from it is done."""
_MOST_ADVICE = 3
_GIVE_WAY_S = 0.08


class _Phase(Enum):
    PROMPTING = "prompting"
    FITTING = "fitting"
    JUDGING = "judging"
    DONE = "done"


class CalibrationGuide:
    """Feed it every shot of a session (`watch`, on the session's thread), look at `banner` from any thread.

    It begins when the banner is first looked at: a window may take its time to open. `result` is what was accepted,
    None until then; `finished` once it is. clock: seconds, for the time a result stands.
    """

    def __init__(
        self,
        database: MotionDatabase,
        height_m: float | None,
        script: CalibrationScript | None = None,
        clock: Callable[[], float] = time.monotonic,
    ) -> None:
        self.result: CalibrationResult | None = None
        self._database, self._height_m, self._clock = database, height_m, clock
        self._script = script or CalibrationScript()
        self._lock = threading.Lock()
        self._phase, self._run, self._found = _Phase.PROMPTING, None, None
        self._trouble, self._judged_s, self._said = "", 0.0, ""
        self._looked_at = False

    @property
    def finished(self) -> bool:
        """Whether a result was accepted."""
        return self._phase is _Phase.DONE

    def watch(self, shot: Shot) -> None:
        """Takes in one moment of the session."""
        with self._lock:
            if not self._looked_at:
                return
            if self._phase is _Phase.PROMPTING and self._script.feed(shot.frame).done:
                self._run = CalibrationRun(self._script.take(), self._database, self._height_m)
                self._phase = _Phase.FITTING
            elif self._phase is _Phase.FITTING and self._run is not None and self._run.finished:
                self._judge(self._run)
            elif self._phase is _Phase.JUDGING and self._seconds_left() <= 0:
                self._follow()
            fitting = self._phase is _Phase.FITTING
        if fitting:
            time.sleep(_GIVE_WAY_S)  # nobody performs now: what is solved less often leaves the processor to the fit

    def accept(self) -> None:
        """Takes the result as it is, where there is one."""
        with self._lock:
            if self._phase is _Phase.JUDGING and self._found is not None:
                self.result, self._phase = self._found, _Phase.DONE

    def again(self) -> None:
        """From the T-pose again."""
        with self._lock:
            if self._phase is not _Phase.DONE:
                self._restart()

    def actions(self) -> Mapping[str, Action]:
        """Its keys."""
        return {
            "Enter": Action("take the calibration", self.accept, lambda: not self.finished),
            "Backspace": Action("calibrate again", self.again, lambda: not self.finished),
        }

    def banner(self) -> Banner | None:
        """What the performer is to be told now; None when all is done."""
        with self._lock:
            self._looked_at = True
            if self._phase is _Phase.PROMPTING:
                return _prompted(self._script)
            if self._phase is _Phase.FITTING and self._run is not None:
                return Banner("Thank you. Finding your body ...", share=self._run.fraction)
            return self._verdict() if self._phase is _Phase.JUDGING else None

    def tell_changes(self, tell: Callable[[str], None]) -> None:
        """For whoever has no window: what the banner says, each time that it says something else."""
        banner = self.banner()
        said = "" if banner is None else ". ".join((banner.text, *banner.below[:-1]))
        if said and said != self._said:
            tell(said)
        self._said = said

    def _judge(self, run: CalibrationRun) -> None:
        self._found, self._trouble = None, ""
        try:
            self._found = run.result()
        except SixpointError as error:
            self._trouble = str(error)
        self._phase, self._judged_s = _Phase.JUDGING, self._clock()

    def _follow(self) -> None:
        """What a result leads to when nobody says otherwise."""
        if self._found is None or self._found.grade is Grade.POOR:
            self._restart()
        else:
            self.result, self._phase = self._found, _Phase.DONE

    def _restart(self) -> None:
        self._script.restart()
        self._phase, self._run, self._found = _Phase.PROMPTING, None, None

    def _seconds_left(self) -> float:
        good = self._found is not None and self._found.grade is Grade.GOOD
        return (_READ_GOOD_S if good else _READ_POOR_S) - (self._clock() - self._judged_s)

    def _verdict(self) -> Banner:
        left = max(0, round(self._seconds_left()))
        if self._found is None:
            return Banner("That did not work", (self._trouble, f"again in {left} s"))
        found = self._found
        verdict = () if found.verdict == found.grade.value else (found.verdict,)
        lines = (*verdict, *found.advice[:_MOST_ADVICE], residual_words(found))
        if found.grade is Grade.POOR:
            return Banner("Once more, please", (*lines, f"again in {left} s   (Enter takes it as it is)"))
        title = "That fits well" if found.grade is Grade.GOOD else "That will do"
        return Banner(title, (*lines, f"taken in {left} s   (Backspace: again)"))


def residual_words(result: CalibrationResult) -> str:
    """What is left over at each tracker, and the height."""
    left = ", ".join(f"{role.replace('_', ' ')} {cm:.1f}" for role, cm in result.residuals_cm.items())
    return f"height {result.profile.height_m:.2f} m; left over, cm: {left}"


def _prompted(script: CalibrationScript) -> Banner:
    prompt = script.prompt
    hint = prompt.hint or {StepKind.READY: "get ready", StepKind.HOLD: "hold it", StepKind.MOVE: "go on"}[prompt.kind]
    seconds = script.steps[prompt.step].seconds
    below = (hint, f"step {prompt.step + 1} of {prompt.count}")
    return Banner(prompt.text, below, f"{math.ceil(prompt.seconds_left)}", 1 - prompt.seconds_left / seconds)
