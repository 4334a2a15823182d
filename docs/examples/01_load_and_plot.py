"""Load a recording, run a method on it, take the movement as a data frame, plot it.

    python docs/examples/01_load_and_plot.py RECORDING.zip [PLOT.png]

RECORDING is a Motion-BIDS zip or folder, or a native recording; `handscope simulate rom --out RECORDING.zip` writes one.
"""

import sys
from pathlib import Path

import matplotlib as mpl

mpl.use("Agg")  # leave this line out in a notebook
from matplotlib import pyplot as plt

from handscope.estimators.methods import METHODS
from handscope.estimators.pipeline.process import process
from handscope.sessions.files import frames
from handscope.sessions.formats.recordings import load

recording = load(Path(sys.argv[1]))
method = METHODS["m2"]
processed = process(method, method.Params(), recording)
for warning in processed.warnings:
    print("warning:", warning)

table = frames.frame(frames.movement(processed.trajectory))
print(
    table[[c for c in table if c.startswith("index_") and c.endswith("flexion_deg")]]
    .describe()
    .round(1)
)

axes = table.plot(
    x="time", y=["index_mcp_flexion_deg", "index_pip_flexion_deg", "index_dip_flexion_deg"]
)
axes.set(xlabel="s", ylabel="deg")
plt.savefig(sys.argv[2] if len(sys.argv) > 2 else "movement.png")
