"""How long test files and tests take, from pytest's own table of durations (standard input): the order of the schedule, and what `make test-fast` leaves out."""

import re
import sys
from collections import defaultdict
from collections.abc import Iterable, Mapping
from pathlib import Path

LONG = 0.5  # s, of a test
FILES, TESTS = (Path(__file__).with_name(name) for name in ("durations.txt", "long_tests.txt"))


def read(lines: Iterable[str]) -> Mapping[str, float]:
    """Seconds by test, with what is set up and torn down for it."""
    seconds: dict[str, float] = defaultdict(float)
    for line in lines:
        if row := re.match(r"([\d.]+)s (?:call|setup|teardown) +(\S.*)", line):
            seconds[row[2].strip()] += float(row[1])
    return seconds


def main() -> None:
    tests = read(sys.stdin)
    files: dict[str, float] = defaultdict(float)
    for test, seconds in tests.items():
        files[test.partition("::")[0]] += seconds
    longest = sorted(files.items(), key=lambda item: -item[1])
    FILES.write_text("".join(f"{total:7.1f} {file}\n" for file, total in longest))
    TESTS.write_text("".join(f"{test}\n" for test in sorted(tests) if tests[test] > LONG))


if __name__ == "__main__":
    main()
