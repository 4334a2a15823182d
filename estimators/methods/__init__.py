"""The tables of methods: a new one is a file beside this and a line here. Those of METHODS step through blocks, live or not; those of BATCH need the
whole recording (`solve`) and are offered for recordings alone."""

from types import ModuleType

from estimators.methods import b, ekf, m1, m2
from estimators.methods import map as self_calibrated

METHODS: dict[str, ModuleType] = {"b": b, "m1": m1, "m2": m2, "ekf": ekf}
BATCH: dict[str, ModuleType] = {"map": self_calibrated}
ALL_METHODS = {**METHODS, **BATCH}  # that a recording can be processed with
