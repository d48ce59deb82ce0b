"""The deformation's speed as a table: `python -m tests.benchmarks.bench_deform [--json]`."""

import argparse
import json

from rich.console import Console

from capture.deform_benchmark import benchmark, table


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--json", action="store_true")
    parser.add_argument("--frames", type=int, default=600)
    arguments = parser.parse_args()
    rows = benchmark(frames=arguments.frames)
    if arguments.json:
        print(json.dumps(rows, indent=1))
    else:
        Console(width=150).print(table(rows))


if __name__ == "__main__":
    main()
