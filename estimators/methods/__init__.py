"""The tables of methods: a new one is a file beside this and a line here. Those of METHODS step
through blocks, live or not; those of BATCH need the whole recording (`solve`) and are offered for
recordings alone; those of EXPERIMENTS step as well and are offered nowhere: who wants one names
it."""

from types import ModuleType

from handscope.estimators.methods import b, ekf, m1, m2, map_live
from handscope.estimators.methods import map as self_calibrated

METHODS: dict[str, ModuleType] = {"b": b, "m1": m1, "m2": m2, "ekf": ekf}
BATCH: dict[str, ModuleType] = {"map": self_calibrated}
EXPERIMENTS: dict[str, ModuleType] = {"map-live": map_live}
DEFAULT = "ekf"  # of a session, a recording and a call that name none: docs/decisions/0013
OFFERED = {**METHODS, **BATCH}  # on pages, for recordings
ALL_METHODS = {**OFFERED, **EXPERIMENTS}  # that a recording can be processed with
