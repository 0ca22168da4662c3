"""See before an inspection what a probe would show: python plan.py SCENE FOLDER [EFFECT ...].

SCENE is a scene file or the name of a shipped one, an EFFECT is such as laser_tilt=0.6@40.
"""

import sys
from pathlib import Path

import boresight

scene, folder, *effects = sys.argv[1:]
made = boresight.simulate(scene, Path(folder) / "recording", effects=effects, frames=8)
print(f"{made.frames} frames in {made.recording}, their truth in {made.truth}")
for premise in made.premises:
    print(f"{premise.name}: {premise.text}")
