"""Seconds a test file takes, summed from pytest's own table of durations (standard input), the longest file first."""

import re
import sys
from collections import defaultdict


def main() -> None:
    seconds: dict[str, float] = defaultdict(float)
    for line in sys.stdin:
        if row := re.match(r"([\d.]+)s (?:call|setup|teardown) +([^:]+)::", line):
            seconds[row[2]] += float(row[1])
    for file, total in sorted(seconds.items(), key=lambda item: -item[1]):
        print(f"{total:7.1f} {file}")  # noqa: T201


if __name__ == "__main__":
    main()
