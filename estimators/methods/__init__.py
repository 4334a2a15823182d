"""The tables of methods: a new one is a file beside this and a line here. Those of METHODS step
through blocks, live or not; those of BATCH need the whole recording (`solve`) and are offered for
recordings alone; those of EXPERIMENTS step as well and are offered nowhere: who wants one names
it."""

from collections.abc import Mapping
from typing import Any

from handscope.estimators.methods import b, ekf, m1, m2, map_live
from handscope.estimators.methods import map as self_calibrated
from handscope.estimators.pipeline.method import AnyMethod, BatchMethod, Method

METHODS: Mapping[str, Method[Any, Any]] = {"b": b, "m1": m1, "m2": m2, "ekf": ekf}
BATCH: Mapping[str, BatchMethod[Any]] = {"map": self_calibrated}
EXPERIMENTS: Mapping[str, Method[Any, Any]] = {"map-live": map_live}
DEFAULT = "ekf"  # of a session, a recording and a call that name none: docs/decisions/0013
OFFERED: Mapping[str, AnyMethod[Any]] = {**METHODS, **BATCH}  # on pages, for recordings
ALL_METHODS: Mapping[str, AnyMethod[Any]] = {
    **OFFERED,
    **EXPERIMENTS,
}  # that a recording can be processed with
