"""What a clinician reads. A new measure is a file beside this and a line in the table: name -> module with TITLE, Params, `applies` and `measure`."""

from types import ModuleType

from estimators.measures import range_of_motion, tapping

MEASURES: dict[str, ModuleType] = {"range_of_motion": range_of_motion, "tapping": tapping}
