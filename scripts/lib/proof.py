#!/usr/bin/python3
"""proof.py add NAME REPORT VERSION BAG...: keeps a verdict in docs/proof/NAME.json, with the tool's version and the bags'
sha256. proof.py table: renews docs/proof.md from all of them."""
import glob
import hashlib
import json
import os
import sys


def add(name, report_path, version, *bags):
    with open(report_path) as source:
        report = json.load(source)
    kept = {"name": name, "tool_version": version, "bags": {}}
    for bag in bags:
        with open(bag, "rb") as content:
            kept["bags"][os.path.basename(bag)] = hashlib.sha256(content.read()).hexdigest()
    kept.update(report)
    with open(f"docs/proof/{name}.json", "w") as out:
        json.dump(kept, out, indent=1)
        out.write("\n")


def millimetres(value):
    return "–" if value is None else f"{1e3 * value:.3g}"


def degrees(value):
    return "–" if value is None else f"{57.29578 * value:.2g}"


def row(proof):
    claims = "<br>".join(f"`{e['kind']}`: {e['statement']}"
                         + (f" (or: {', '.join(e['indistinguishable_from'])})" if e["indistinguishable_from"] else "")
                         for e in proof["effects"]) or "–"
    fit = proof["fit"]
    errors = " | ".join(f"{millimetres(fit[m]['position_rms_m'])} / {degrees(fit[m]['yaw_rms_rad'])}"
                        for m in ("nominal", "fitted", "noise_floor"))
    return f"| {proof['name']} | {proof['verdict'].replace('_', ' ')} | {claims} | {errors} |"


def table():
    proofs = []
    for path in sorted(glob.glob("docs/proof/*.json")):
        with open(path) as source:
            proofs.append(json.load(source))
    versions = ", ".join(sorted({f"`{p['tool_version']}`" for p in proofs}))
    with open("docs/proof.md", "w") as out:
        out.write("# Verdicts on sealed recordings\n\n"
                  "What `diagnose` says about recordings whose answers are withheld from everyone who writes it: flight a is\n"
                  "diagnosed, flight b (the same robot 15 minutes later) is used for the errors alone. Errors are those of open-loop\n"
                  "prediction over 5 s on flight b: position [mm] / yaw [deg], root mean square. `docs/proof/*.json` holds each whole\n"
                  "report with the sha256 of its bags. Renewed by `scripts/proof`.\n\n"
                  f"Version of the tool: {versions}.\n\n"
                  "| recording | verdict | effects | nominal | fitted | noise alone |\n|---|---|---|---|---|---|\n")
        out.write("\n".join(map(row, proofs)) + "\n")


if __name__ == "__main__":
    {"add": add, "table": table}[sys.argv[1]](*sys.argv[2:])
