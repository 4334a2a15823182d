"""Load a recording, run a method on it, take the movement as a data frame, plot it.

    python docs/examples/01_load_and_plot.py RECORDING.zip [PLOT.png]

RECORDING is a Motion-BIDS zip or folder, or a native recording; `handscope simulate rom --out RECORDING.zip` writes one.
"""

import sys

import matplotlib as mpl

mpl.use("Agg")  # leave this line out in a notebook
from matplotlib import pyplot as plt

import handscope as hs

moved = hs.process(sys.argv[1], method="ekf")  # what the checks find is a Python warning
angles, sd = moved.angles(unit="deg"), moved.angles_sd(unit="deg")
print(moved.to_pandas().filter(regex="index_.*flexion_deg").describe().round(1))

axes = angles[["index_mcp_flexion", "index_pip_flexion", "index_dip_flexion"]].plot()
low, high = angles - 2 * sd, angles + 2 * sd
axes.fill_between(angles.index, low.index_pip_flexion, high.index_pip_flexion, alpha=0.2)
axes.set(xlabel="s", ylabel="deg")
plt.savefig(sys.argv[2] if len(sys.argv) > 2 else "movement.png")
