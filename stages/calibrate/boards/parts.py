"""Dealing views out for held-out judgement, with the board as each part of the views shows it to be."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from pipeline.arrays import Bool
from pipeline.instrument.camera.calibration import BoardSurvey, BoardView
from stages.calibrate.boards.bundle import Estimate
from stages.calibrate.boards.parameters import BoardCalibrationParameters
from stages.calibrate.boards.survey import applied, placed, survey_board


@dataclass(frozen=True)
class Part:
    """Views to fit to and views held out, both with the board as the former show it.

    Attributes
    ----------
    inside, outside
        ``outside`` is empty where all views are fitted to.
    first
        A start for the views inside.
    survey
        The board as measured in the views inside; None when it is not.
    """

    inside: list[BoardView]
    outside: list[BoardView]
    first: Estimate
    survey: BoardSurvey | None = None


def deal(
    views: Sequence[BoardView], first: Estimate, parameters: BoardCalibrationParameters
) -> tuple[Part, tuple[Part, ...]]:
    """Return the part of all views, and those in which each of ``parameters.folds`` parts is held out."""
    index = np.arange(len(views))
    folds = min(parameters.folds, len(views))
    masks = [index % folds == fold for fold in range(folds)]
    whole = _part(views, first, np.zeros(len(views), bool), parameters)
    return whole, tuple(_part(views, first, mask, parameters) for mask in masks)


def _part(
    views: Sequence[BoardView], first: Estimate, out: Bool, parameters: BoardCalibrationParameters
) -> Part:
    inside = [view for view, left in zip(views, out, strict=True) if not left]
    outside = [view for view, left in zip(views, out, strict=True) if left]
    start = replace(first, T_cb=first.T_cb[~out])
    if parameters.board_shape != "surveyed":
        return Part(inside, outside, start)
    survey, shown, estimate = survey_board(inside, start, parameters)
    elsewhere = [placed(survey, view, estimate.camera, parameters.huber_px) for view in outside]
    return Part(
        [applied(survey, view) for view in shown],
        [applied(survey, view) for view in elsewhere],
        replace(start, T_cb=estimate.T_cb),
        survey,
    )
