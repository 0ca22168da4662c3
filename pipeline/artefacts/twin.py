"""What the comparison of recorded frames with re-rendered ones finds."""

from __future__ import annotations

from dataclasses import dataclass

from pipeline.arrays import Byte, Int


@dataclass(frozen=True)
class NamedFigure:
    """A number with its 1 σ; infinite σ where the recording cannot tell it."""

    name: str
    value: float
    sd: float
    unit: str = ""


@dataclass(frozen=True)
class RegionFit:
    """χ² per pixel, of pixels of one kind, before and after what was found is put into the rendering.

    Kinds: ``line_core`` and ``line_flank`` within and beyond one width of the laser line, ``wall`` lit by
    the LEDs, ``dark`` surroundings, ``edge`` of the view. χ² is NaN where pixels are not compared: at the
    edge, and in the dark where noise is cut off at black.
    """

    name: str
    pixels: int
    chi2_before: float
    chi2_after: float


@dataclass(frozen=True)
class Look:
    """Where a difference is best looked at: a frame, and a square of the image of so many px to each side."""

    frame: int
    u_px: float
    v_px: float
    half_px: float


@dataclass(frozen=True)
class Mismatch:
    """A place where recorded and re-rendered frames differ.

    Attributes
    ----------
    name : str
        Of the effect; empty where none explains it.
    channel : str
        ``intensity``, ``colour`` or ``line``.
    fixed_to : str
        ``image``, ``wall``, ``time``, ``line`` or ``rows``; ``image or wall`` where both may be.
    place : tuple of NamedFigure
        Where: pixels, distance and azimuth, or frames.
    parameters : tuple of NamedFigure
        Its size.
    probability : float
        That chance alone would show as much anywhere.
    chi2_before, chi2_after : float
        Per pixel there, in the compared frames, without and with it.
    statement : str
    look : Look, optional
    """

    name: str
    channel: str
    fixed_to: str
    place: tuple[NamedFigure, ...]
    parameters: tuple[NamedFigure, ...]
    probability: float
    chi2_before: float
    chi2_after: float
    statement: str
    look: Look | None = None

    @property
    def names(self) -> tuple[str, ...]:
        """Each effect that may be the cause: more than one where they are not distinguished."""
        return tuple(self.name.split(" or "))


@dataclass(frozen=True)
class TwinView:
    """A compared frame at half its size, for looking at.

    Attributes
    ----------
    frame : int
    light : str
    chi2 : float
        Per pixel of line and lit wall.
    recorded, twin : (h, w) uint8
        Grey levels.
    z : (h, w) uint8
        128 + 32 z, z the mean of four pixels; 0 where the wall is unknown.
    """

    frame: int
    light: str
    chi2: float
    recorded: Byte
    twin: Byte
    z: Byte


@dataclass(frozen=True)
class TwinMap:
    """A map of recorded less re-rendered brightness of blocks, mean over frames.

    Attributes
    ----------
    name : str
        ``image``, or ``wall``: rows along distance, columns around the pipe from azimuth 0.
    picture : (h, w) uint8
        128 + 16 z, z by the spread of the map itself; 0 where too few frames show it.
    """

    name: str
    picture: Byte


@dataclass(frozen=True)
class Twin:
    """Recorded frames beside the same frames re-rendered.

    Attributes
    ----------
    frame : (F,) int
        The compared frames.
    withheld : bool
        Whether no stage of the run had measured them.
    noise : tuple of NamedFigure
        The camera's noise and response.
    state : tuple of NamedFigure
        Lamps, laser and lens.
    regions : tuple of RegionFit
    found : tuple of Mismatch
    psnr_db, psnr_noise_free_db : float
        Of the lit wall against a full scale of 255 levels: of the difference, and of what of it the noise
        does not explain; infinite where the noise explains all of it.
    chi2_camera : float
        Of the lit wall per pixel, by the camera's noise alone: the error of the photo's place left out.
    stray : float
        Share of dark pixels that are brighter than noise explains.
    seen : float
        Share of the view's pixels whose wall is known, in lit frames.
    compared : float
        Share of the pixels of known wall in lit frames that are compared: neither at the edge of the view
        nor too dark.
    cannot_tell : tuple of str
        What the recording does not tell.
    views : tuple of TwinView
    maps : tuple of TwinMap
    by_level : tuple of NamedFigure
        χ² per pixel of lit wall by its brightness, grey levels above black; 1 σ that of as many pixels.
    worst : tuple of Mismatch
        Where lit wall differs most, whether or not it is explained: shown, not judged.
    withdrawn : tuple of Mismatch
        Names that single frames suggest and frames rendered again do not bear out.
    """

    frame: Int
    withheld: bool
    noise: tuple[NamedFigure, ...]
    state: tuple[NamedFigure, ...]
    regions: tuple[RegionFit, ...]
    found: tuple[Mismatch, ...]
    psnr_db: float
    psnr_noise_free_db: float
    chi2_camera: float
    stray: float
    seen: float
    compared: float
    cannot_tell: tuple[str, ...]
    views: tuple[TwinView, ...]
    maps: tuple[TwinMap, ...] = ()
    by_level: tuple[NamedFigure, ...] = ()
    worst: tuple[Mismatch, ...] = ()
    withdrawn: tuple[Mismatch, ...] = ()


@dataclass(frozen=True)
class GaugeTwin:
    """The line of a gauge run, whose bore is known, beside the same line re-rendered with two instruments.

    Attributes
    ----------
    frame : (F,) int
        The compared laser frames.
    effects : tuple of str
        What was switched on beyond the stated instrument, as `boresight simulate` takes it.
    pixels : int
    chi2_stated, chi2_diagnosed, chi2_measured : float
        Per pixel: with the stated instrument, with the effects, and with the line where it was measured,
        which is the least that any instrument can reach: 1 by the choice of the variance, less where pixels
        clip.
    rms_px_stated, rms_px_diagnosed : float
        R.m.s. of how far the line lies from where it is predicted.
    least_px : float
        Displacement of the line that raises χ² by a tenth: a smaller one cannot be distinguished.
    sigmas : float
        By how many σ, taken from frame to frame, χ² falls when the effects are switched on.
    kept : tuple of bool
        Of each effect, whether frames fit better with it than with the other effects alone; if not, it is
        withdrawn.
    chi2_wrong, sigmas_wrong : float
        χ² per pixel with the effects the other way round, a wrong diagnosis of the same size, and by how many
        σ that is worse than with the effects.
    """

    frame: Int
    effects: tuple[str, ...]
    pixels: int
    chi2_stated: float
    chi2_diagnosed: float
    chi2_measured: float
    rms_px_stated: float
    rms_px_diagnosed: float
    least_px: float
    sigmas: float
    kept: tuple[bool, ...]
    chi2_wrong: float = float("nan")
    sigmas_wrong: float = float("nan")
