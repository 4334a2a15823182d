"""A tracking system as Motion-BIDS files, written from the standard alone."""

import json
from collections.abc import Iterable, Mapping
from pathlib import Path

import numpy as np

from handscope.validation.independent.simulator.hand import Values

Channel = tuple[str, str, str, str, str]  # name, component, type, tracked point, unit
HEAD = (
    ("name", "component", "type", "tracked_point", "units"),
    ("latency", "n/a", "LATENCY", "n/a", "s"),
)


def axes(point: str, what: str, kind: str, unit: str) -> list[Channel]:
    """The three channels of a quantity at a point."""
    return [(f"{point}_{what}_{axis}", axis, kind, point, unit) for axis in "xyz"]


def write_system(
    stem: str,
    name: str,
    t: Values,
    values: Values,
    channels: Iterable[Channel],
    sidecar: Mapping[str, object],
) -> None:
    """Samples (n, channels) at times t (n,) s beside files of the same `stem`."""
    begun = f"{stem}_tracksys-{name}"
    Path(f"{begun}_channels.tsv").write_text(
        "".join("\t".join(row) + "\n" for row in (*HEAD, *channels))
    )
    np.savetxt(f"{begun}_motion.tsv", np.column_stack([t, values]), delimiter="\t", fmt="%.9g")
    Path(f"{begun}_motion.json").write_text(json.dumps({"TrackingSystemName": name, **sidecar}))
