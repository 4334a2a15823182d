"""Whether a run of the benchmarks is worse than the committed baseline allows: `handscope bench --gate`.

Speeds are compared as shares of a yardstick measured in the same run (`per`), so that a slow hour of the machine is no failure; what cannot be
compared so has a wide `slack`, what is counted has none. Only a commit of its own moves baseline.json, and says why.
The same shares are the line of a release in the table of docs/benchmarks.md.
"""

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

from handscope.estimators.errors import InputError
from handscope.validation.benchmarks import BENCHES, Metric, share_of_yardstick

BASELINE = Path(__file__).with_name("baseline.json")
COLUMNS = (  # of a release: benchmark, metric
    ("batch", "m2 speed"),
    ("batch", "ekf speed"),
    ("batch", "m2 memory of 10 min"),
    ("batch", "ekf memory of 10 min"),
    ("cohort", "one recording"),
    ("start", "process of 40 s, native"),
    ("start", "process of 40 s, Motion-BIDS"),
)


@dataclass(frozen=True)
class Allowed:
    """How much worse than the baseline a figure may be."""

    value: float  # the baseline's, or its share of `per`
    slack: float  # times that a run may be worse
    per: str = ""  # the metric of the same benchmark that it is a share of


def read(path: Path) -> dict[str, dict[str, Allowed]]:
    """What is allowed, by benchmark and metric; InputError where the file is none."""
    try:
        text = {
            name: {m: Allowed(**a) for m, a in metrics.items()}
            for name, metrics in json.loads(path.read_text()).items()
        }
    except OSError as problem:
        raise InputError(f"{path} cannot be read: {problem.strerror}") from None
    except (AttributeError, TypeError, ValueError):
        raise InputError(
            f"{path} is no baseline: it should hold, by benchmark and metric, value, slack and per"
        ) from None
    if unknown := set(text) - set(BENCHES):
        raise InputError(f"{path} names the benchmark {unknown.pop()!r}, which there is not")
    return text


def find_regressions(
    allowed: Mapping[str, Mapping[str, Allowed]], found: Mapping[str, Sequence[Metric]]
) -> list[str]:
    """A sentence for each figure that is worse than allowed, or that was not measured although its benchmark was run."""
    messages = []
    for name, metrics in found.items():
        by_name = {m.name: m for m in metrics}
        for wanted, a in allowed.get(name, {}).items():
            if wanted not in by_name or (a.per and a.per not in by_name):
                messages.append(f"{name}: {wanted} was not measured")
                continue
            m = by_name[wanted]
            value = m.value / by_name[a.per].value if a.per else m.value
            limit = a.value / a.slack if m.better == "higher" else a.value * a.slack
            if value < limit if m.better == "higher" else value > limit:
                of = f" of {a.per}" if a.per else f" {m.unit}"
                messages.append(
                    f"{name}: {wanted} is {value:.4g}{of}, the baseline {a.value:.4g}; {limit:.4g} would do"
                )
    return messages


def release_row(name: str, found: Mapping[str, Sequence[Metric]]) -> str:
    """A line of the table; what was not measured is a dash."""
    return f"| {' | '.join([name, *(_cell(found.get(b, ()), m) for b, m in COLUMNS)])} |"


def _cell(metrics: Sequence[Metric], name: str) -> str:
    m = next((m for m in metrics if m.name == name), None)
    if m is None:
        return "-"
    share = share_of_yardstick(m, metrics)
    return f"{m.value:.0f} {m.unit}" if share is None else f"{share:.3g}"
