"""The verbs of the evidence: `handscope bench` and `handscope reproduce`."""
