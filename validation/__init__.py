"""The evidence: the papers' figures measured again, studies of errors, independent simulators, benchmarks."""
