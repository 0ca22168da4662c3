"""A class with its causes, as the judgement hands it to the page."""

from stages.diagnose.causes import Cause, Causes, CourseShare
from stages.diagnose.result import Diagnosis, Verdict

FAR, LATE = (
    CourseShare("distance", 0.8, "The sheet tilts with the way."),
    CourseShare("exponential", 0.195, "The sheet tilts ever more slowly."),
)
TILT = Cause("laser_tilt", 0.8, (FAR, LATE, CourseShare("ramp", 0.005, "The sheet tilts evenly.")))
CAUSES = Causes(
    (
        TILT, Cause("centre_drift", 0.07, (CourseShare("exponential", 1.0, "The axis drifts."),)),
        Cause("principal_point", 0.03, (CourseShare("distance", 1.0, "The axis moves."),)),
        Cause("sensor_tilt", 0.003, (CourseShare("distance", 1.0, "The sensor tilts."),)),
        Cause("outside_index", 0.02, (CourseShare("constant", 1.0, "Gas."),)), Cause("laser_cone", 0.0),
    ),
    outside=0.1,
)  # fmt: skip
MEMBERS = ("laser_tilt", "principal_point", "sensor_tilt", "centre_drift")
FOUND = Diagnosis("field", "gauge", Verdict.CLASS, 1e-9, members=MEMBERS, causes=CAUSES)
