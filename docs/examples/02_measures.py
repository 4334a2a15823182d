"""What a clinician reads of a recording: every figure of every task with its standard deviation, its grade and its source.

python docs/examples/02_measures.py RECORDING.zip [FIGURES.csv]
"""

import sys
from pathlib import Path

from handscope.app.report.norms import norm_of
from handscope.estimators.measures.accuracy import accuracy_of
from handscope.estimators.measures.assessment import assess
from handscope.estimators.methods import METHODS
from handscope.estimators.pipeline.process import process
from handscope.sessions.files import frames
from handscope.sessions.formats.recordings import load

recording = load(Path(sys.argv[1]))
processed = process(METHODS["m2"], METHODS["m2"].Params(), recording)
accuracy = accuracy_of("m2", processed.calibrations)
results = assess(processed.trajectory, recording.events, recording.geometry, accuracy)

table = frames.frame(frames.figures(results))
print(table[["task", "name", "value", "sd", "unit", "grade", "reason"]].to_string(max_rows=40))
print("standard deviations:", results[0].sd_basis)
for what, part, task in table[["what", "part", "task"]].itertuples(index=False):
    if norm := norm_of(what, part, task):
        print(f"{part} {what}: norm {norm.mean:g} {norm.unit} ({norm.source.name})".strip())
if len(sys.argv) > 2:
    table.to_csv(sys.argv[2], index=False)
