"""What the compared frames cannot decide, in sentences."""

from __future__ import annotations

import numpy as np

from stages.twin.picture import LEAST_BLUR_PX
from stages.twin.second_ring import LEAST_SECOND
from stages.twin.state import PhotometricState

_NEVER_TOLD = (
    "Vignetting cannot be separated from the LEDs' lobe: both act by the polar angle alone. If it "
    "changes slowly, the photo of the wall changes with it, and frames fit nearly as well.",
    "Noise, electrons per grey level and non-uniformity are those of the decoded frames. A lossy codec "
    "removes noise and adds errors of its own: only frames coded without loss show the camera's.",
    "A power response cannot be separated from the wall's contrast, since the photo has it, too. Gamma "
    "is estimated from the noise, which a video codec changes: it does not prove a nonlinear response.",
    "Lamps that are uneven in all frames, other than by one dim LED, can be distinguished from wall that "
    "is paler on one side only as far as the probe rolls.",
    "If all frames move alike during their exposure, their blur is also in the wall's photo: motion blur "
    "is found only in frames that are more blurred than the others, and from a 1 σ of "
    f"{LEAST_BLUR_PX} px on: lens and pixels blur as much.",
    "Frames are compared in grey: a change of colour during the run is told only as far as wall ahead "
    "and wall near the camera differ by it from their photo.",
)
_SILENT = (
    "Nearly all dark pixels are at the black level, or clipped there: light fainter than half a grey level "
    "is rounded away, as is most of the line's light that the wall reflects."
)
_NO_LAMP = "No lit frame could be used: lamps, vignetting and photon transfer are unknown."
_NO_LINE = (
    "No frame of the laser alone could be used: the line's profile is unknown, and pixels near the line are "
    "not compared."
)
_OF_LINE = (
    "The sheet's thickness is the stated one: in one diameter it looks like the lens's blur.",
    "A second line, or a mirror image of the line on the wall, is told only if darkness lies between "
    f"it and the line, and from {100 * LEAST_SECOND:.0f} % of the line's brightness on; beside a "
    "faint line, only if it also stands out from the noise.",
)


def cannot_tell(state: PhotometricState, silent: bool = False) -> tuple[str, ...]:
    """Return sentences on what such recordings cannot decide; ``silent``: dark pixels show no noise."""
    return (
        *_NEVER_TOLD,
        *((_SILENT,) if silent else ()),
        *_of_black(state),
        *_of_clipped_line(state),
        *((_NO_LAMP,) if state.lamp is None else ()),
        *((_NO_LINE,) if state.line is None else _OF_LINE),
    )


def _of_black(state: PhotometricState) -> tuple[str, ...]:
    """Return why the contrast of the wall's photo says nothing about the response, if it does not."""
    if np.isnan(state.photo_black):
        return (
            "Whether the wall's photo includes the black level is unknown, since there is no colour frame of "
            "the laser alone: the photo's contrast says nothing about the response.",
        )
    if not state.black_in_photo:
        return ()
    return (
        f"The black level of {state.photo_black:.0f} grey levels is also in the wall's photo: its contrast "
        "says nothing about the response.",
    )


def _of_clipped_line(state: PhotometricState) -> tuple[str, ...]:
    """Return that the laser's power cannot be seen, if the line is clipped."""
    if not state.line_is_clipped:
        return ()
    return (
        f"The line is clipped in {100 * state.line_clipped:.0f} % of its middle: whether the laser's power "
        "changes over time or around the sheet is not visible.",
    )
