"""What a clinician reads of a recording: every figure of every task with its standard deviation, its grade and its source.

python docs/examples/02_measures.py RECORDING.zip [FIGURES.csv]
"""

import sys

import handscope as hs

result = hs.process(sys.argv[1], method="m2")
table = result.measures()
print(table[["task", "name", "value", "sd", "unit", "grade", "reason"]].to_string(max_rows=40))
print(result.segment_lengths(unit="mm").round(1))
print("to cite:", result.cite())
if len(sys.argv) > 2:
    table.to_csv(sys.argv[2], index=False)
