"""boresight: measured, textured pipe models from recorded laser-ring runs, from a script.

    import boresight

    run = boresight.run("recording", "run")             # or boresight.open_run("run")
    print(run.wall.radius_map.radius_mm.shape)          # typed arrays; lengths in mm
    print(run.table("sections"))                        # a pandas table
    calibrated = boresight.calibrate("gauge", "probe")  # calibrated.probe_file is the calibrated probe
    found = boresight.diagnose("recording", gauge="gauge", output="diagnosis", run="run")
    print(found.answer.verdict, found.answer.effects)   # boresight.open_diagnosis("diagnosis") reads it again

An `InputError` reports a wrong input, an `UnusableError` a recording that does not contain enough
information.
"""

try:
    from pipeline.api.run import MissingPackageError, Run, open_run
except ModuleNotFoundError as error:
    if error.name not in ("pipeline.api", "pipeline.api.run"):
        raise
    import pipeline

    raise ImportError(
        f"another package named pipeline hides boresight's own: {list(pipeline.__path__)}. "
        "Install boresight in an environment without it."
    ) from error
from pipeline.api.calibrate import Calibration, calibrate
from pipeline.api.diagnosis.diagnose import DiagnosisFolder, diagnose, open_diagnosis
from pipeline.api.run import run
from pipeline.api.simulate import Simulated, simulate, simulate_like, simulate_pairs
from pipeline.api.twin import twin
from pipeline.drill.answer import Answer
from pipeline.errors import BoresightError, Cancelled, InputError, UnusableError
from pipeline.files.installed import PARAMETERS, PRIORS, SCENES, shipped_names

__all__ = [
    "PARAMETERS",
    "PRIORS",
    "SCENES",
    "Answer",
    "BoresightError",
    "Calibration",
    "Cancelled",
    "DiagnosisFolder",
    "InputError",
    "MissingPackageError",
    "Run",
    "Simulated",
    "UnusableError",
    "calibrate",
    "diagnose",
    "open_diagnosis",
    "open_run",
    "run",
    "shipped_names",
    "simulate",
    "simulate_like",
    "simulate_pairs",
    "twin",
]
