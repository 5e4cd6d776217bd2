"""Runs benchmark programs, prints their rows as a table and writes them as a JSON list.

A benchmark program prints one JSON object per row on stdout: name, unit and any of value, median, p99, max, n. A program that
is given a prefix as its only argument may skip rows whose name does not start so.
"""
import argparse
import glob
import json
import subprocess
import sys

COLUMNS = ("value", "median", "p99", "max", "n")


def fail(message):
    print(f"error: {message}", file=sys.stderr)
    sys.exit(1)


def rows_of(program, prefix):
    """Rows of one program; a failure or a malformed row ends the run."""
    print(f"running {program}", file=sys.stderr, flush=True)
    result = subprocess.run([program] + ([prefix] if prefix else []), stdout=subprocess.PIPE, text=True)
    if result.returncode != 0:
        fail(f"{program} ended with exit code {result.returncode}")
    rows = []
    for line in result.stdout.splitlines():
        try:
            row = json.loads(line)
            row["name"], row["unit"]
        except (ValueError, KeyError, TypeError):
            fail(f"{program} printed a line that is not a row: {line}")
        if row["name"].startswith(prefix):
            rows.append(row)
    return rows


def print_table(rows):
    width = max([len(row["name"]) for row in rows] + [4])
    print(f"{'name':<{width}}  {'unit':<6}" + "".join(f"{c:>12}" for c in COLUMNS))
    for row in rows:
        cells = "".join(f"{row[c]:>12.5g}" if c in row else f"{'':>12}" for c in COLUMNS)
        print(f"{row['name']:<{width}}  {row['unit']:<6}{cells}")


def main():
    parser = argparse.ArgumentParser()
    parser.add_argument("--binaries", required=True, help="glob of benchmark programs")
    parser.add_argument("--out", required=True)
    parser.add_argument("prefix", nargs="?", default="")
    args = parser.parse_args()

    rows = []
    for program in sorted(glob.glob(args.binaries)):
        rows += rows_of(program, args.prefix)
    rows.sort(key=lambda row: row["name"])
    with open(args.out, "w") as out:
        json.dump(rows, out, indent=1)
    if not rows:
        fail(f"no benchmark name starts with '{args.prefix}'")
    print_table(rows)
    print(f"written: {args.out}")


if __name__ == "__main__":
    main()
