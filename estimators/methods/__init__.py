"""The table of methods: a new one is a file beside this and a line here."""

from types import ModuleType

from estimators.methods import b, ekf, m1, m2

METHODS: dict[str, ModuleType] = {"b": b, "m1": m1, "m2": m2, "ekf": ekf}
