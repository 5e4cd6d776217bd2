"""Flies hidden systems, runs the diagnosis on what a lab would have of them, and keeps the scores."""
import hashlib
import json
import os
import resource
import shutil
import subprocess
import sys
import time

from . import hidden, scoring

BASELINES = ("nominal", "fit_all", "disturbance_ekf", "sparse_regression")
MEMORY_LIMIT = 4 << 30  # bytes of address space for a child


class Failure(Exception):
    pass


def digest(paths):
    total = hashlib.sha256()
    for path in paths:
        with open(path, "rb") as file:
            total.update(file.read())
    return total.hexdigest()[:16]


def child(command, timeout, log=None):
    """Runs a child at low priority; its output goes to `log`. Returns wall and CPU time [s] and peak memory [MiB]."""
    def lower():
        os.nice(10)
        resource.setrlimit(resource.RLIMIT_AS, (MEMORY_LIMIT, MEMORY_LIMIT))

    begin = time.monotonic()
    with open(log or os.devnull, "w") as out:
        process = subprocess.Popen(command, stdout=out, stderr=subprocess.STDOUT, preexec_fn=lower)
        try:
            while True:
                pid, status, usage = os.wait4(process.pid, os.WNOHANG)
                if pid:
                    break
                if time.monotonic() - begin > timeout:
                    process.kill()
                    os.wait4(process.pid, 0)
                    raise Failure(f"{os.path.basename(command[0])} took longer than {timeout:.0f} s")
                time.sleep(0.02)
        finally:
            process.returncode = 0
    code = os.waitstatus_to_exitcode(status)
    if code != 0:
        tail = open(log).read().strip().splitlines()[-1:] if log else []
        raise Failure(f"{os.path.basename(command[0])} ended with {code}: {' '.join(tail)}")
    return time.monotonic() - begin, usage.ru_utime + usage.ru_stime, usage.ru_maxrss / 1024.0


class Runner:
    def __init__(self, options, tools, vehicle):
        self.options, self.tools, self.vehicle = options, tools, vehicle
        # What flies and what diagnoses are told apart: programs with the libraries of ours that they load.
        libraries = os.path.join(options.binaries, "libatmos_{}.so")
        common = [libraries.format("model")]
        self.versions = {
            "flight": digest([tools["fly"], libraries.format("sim")] + common),
            "diagnosis": digest([tools[name] for name in ("diagnose", "predict")]
                                + [libraries.format("sim2real"), libraries.format("sim2real_ros")] + common)}

    def folder(self, family, index):
        return os.path.join(self.options.out, str(self.options.seed), f"{family}_{index:04d}")

    def finished(self, family, index):
        """The kept result of a run by these very tools, or None."""
        path = os.path.join(self.folder(family, index), "result.json")
        if not os.path.exists(path):
            return None
        with open(path) as file:
            result = json.load(file)
        if self.options.any_version or result["versions"] == self.versions:
            return result
        return None

    def system(self, family, index, **options):
        return hidden.draw(f"{self.options.seed}/{family}/{index}", family, index, self.options.durations, self.vehicle, **options)

    def fly(self, folder, system, names):
        for name in names:
            start = hidden.SECOND_START if name == "b" else hidden.FIRST_START
            scenario = os.path.join(folder, f"hidden_{name}.yaml")
            with open(scenario, "w") as file:
                json.dump(system["flights"][name], file, indent=1)  # JSON is YAML
            child([self.tools["fly"], scenario, "--start", repr(start), "--bag", os.path.join(folder, f"{name}.bag"),
                   "--shown", os.path.join(folder, f"shown_{name}.csv"),
                   "--natural-frequency", repr(system["frequency"])], 300, os.path.join(folder, "fly.log"))

    def diagnose(self, folder, name):
        """(report, wall and CPU time [s], peak memory [MiB]). The diagnosis gets the bag under a name that says nothing, and the
        nominal vehicle."""
        apart = os.path.join(folder, f"diagnosis_{name}")
        os.makedirs(apart)
        bag = os.path.join(apart, "flight.bag")
        os.rename(os.path.join(folder, f"{name}.bag"), bag)
        wall, cpu, memory = child([self.tools["diagnose"], "--vehicle", self.vehicle, "--out", apart, bag],
                             self.options.timeout, os.path.join(apart, "log"))
        with open(os.path.join(apart, "report.json")) as file:
            return json.load(file), wall, cpu, memory

    def predictions(self, folder, truth, models):
        """Errors of models (name -> file or None) on the second flight, every window started from the motion that the mocap
        would show without error."""
        shown = scoring.read_table(os.path.join(folder, "shown_b.csv"))
        starts = os.path.join(folder, "starts.csv")
        end, due = shown[-1]["stamp"] - 5.2, shown[0]["stamp"] + 2.0
        with open(starts, "w") as file:
            file.write("stamp,x,y,yaw,vx,vy,yaw_rate\n")
            for row in shown:
                if due <= row["stamp"] < end:
                    file.write(",".join(f"{row[k]:.9f}" for k in ("stamp", "x", "y", "yaw", "vx", "vy", "yaw_rate")) + "\n")
                    due += 2.5
        with open(os.path.join(folder, "oracle.yaml"), "w") as file:
            json.dump({"effects": truth["second_effects"]}, file)
        errors = {}
        for name, model in models.items():
            table = os.path.join(folder, "predicted.csv")
            child([self.tools["predict"], "--vehicle", self.vehicle, "--horizon", "5", "--initial-states", starts, "--out",
                   table, os.path.join(folder, "b.bag")] + (["--model", model] if model else []), 300,
                  os.path.join(folder, "predict.log"))
            errors[name] = scoring.prediction_error(scoring.read_table(table), shown)
            os.remove(table)
        return errors

    def baseline(self, folder, name, truth, errors, shown):
        """Score of a baseline on the same bag; one that fails claims nothing and predicts as the nominal model."""
        apart = os.path.join(folder, f"baseline_{name}")
        os.makedirs(apart)
        report = {"verdict": "consistent", "mismatch": {"p_value": None, "smallest_detectable": {}}, "effects": []}
        fitted = errors and errors["nominal"]
        bag = os.path.join(folder, "diagnosis_a", "flight.bag")
        try:
            if name == "fit_all":
                child([self.tools["fit_all"], "--vehicle", self.vehicle, "--out", apart, bag], 300, os.path.join(apart, "log"))
            elif name != "nominal":
                script = os.path.join(os.path.dirname(os.path.realpath(__file__)), "baselines.py")
                child([sys.executable, script, name, bag, self.vehicle, apart], 300, os.path.join(apart, "log"))
            if name != "nominal":
                with open(os.path.join(apart, "report.json")) as file:
                    report = json.load(file)
                if errors:
                    fitted = self.predictions(folder, truth, {"fitted": os.path.join(apart, "model.yaml")})["fitted"]
        except Failure as failure:
            progress(f"baseline {name}: {failure}")
        return scoring.score(truth, report, errors and dict(errors, fitted=fitted), hidden.FIRST_START, shown)

    def visible_system(self, folder, index, stated, duration):
        """A system of the family multi of which each effect is at least twice what its twin's report states as the smallest."""
        shown = scoring.read_table(os.path.join(folder, "shown_twin.csv"))

        def seen(effect):
            multiple = scoring.stated_multiple(effect, stated, duration, shown)
            return multiple is None or multiple >= scoring.VISIBLE

        return self.system("multi", index, seen=seen)

    def run(self, family, index):
        """One run from the draw to the score; what cannot be scored is a result with `failure`."""
        folder = self.folder(family, index)
        shutil.rmtree(folder, ignore_errors=True)
        os.makedirs(folder)
        system = self.system(family, index)
        result = {"family": family, "index": index, "truth": system["truth"], "versions": self.versions}
        try:
            if "twin" in system["flights"]:
                self.fly(folder, system, ["twin"])
                result["twin"] = scoring.score_null(self.diagnose(folder, "twin")[0])
            if family == "multi":
                system = self.visible_system(folder, index, result["twin"]["stated"], system["truth"]["duration_s"])
            truth = result["truth"] = system["truth"]
            self.fly(folder, system, [name for name in system["flights"] if name != "twin"])
            report, wall, cpu, memory = self.diagnose(folder, "a")
            errors = self.predictions(folder, truth, {
                "nominal": None, "fitted": os.path.join(folder, "diagnosis_a", "model.yaml"),
                "oracle": os.path.join(folder, "oracle.yaml")}) if truth["effects"] else None
            shown = scoring.read_table(os.path.join(folder, "shown_a.csv"))
            result["score"] = scoring.score(truth, report, errors, hidden.FIRST_START, shown)
            if family == "single":
                result["score"]["multiple"] = scoring.stated_multiple(
                    truth["effects"][0], result["twin"]["stated"], truth["duration_s"], shown)
            result.update(wall_s=wall, cpu_s=cpu, memory_mib=memory)
            if self.options.baselines:
                result["baselines"] = {name: self.baseline(folder, name, truth, errors, shown) for name in BASELINES}
        except Failure as failure:
            result["failure"] = str(failure)
        with open(os.path.join(folder, "result.json"), "w") as file:
            json.dump(result, file, indent=1)
        if result.get("score", {}).get("good") and not self.options.keep:
            for name in os.listdir(folder):
                if name != "result.json":
                    path = os.path.join(folder, name)
                    shutil.rmtree(path) if os.path.isdir(path) else os.remove(path)
        return result


def describe(result):
    """One line of progress."""
    truth = result["truth"]
    name = f"{result['family']}_{result['index']:04d} {truth['label']}"
    if "failure" in result:
        return f"{name}: FAILED: {result['failure']}"
    score = result["score"]
    claims = ", ".join(kind + (f"[{thruster}]" if thruster else "") for kind, thruster, _ in score["claims"]) or "-"
    size = f"{score['multiple']:.1f}x" if score.get("multiple") else ""
    gain = f", gain {score['gain_ratio']:.2f} of the oracle's" if "gain_ratio" in score else ""
    if result.get("twin", {}).get("detected"):
        gain += f", its null twin {result['twin']['claims'] or 'unexplained'}"
    return (f"{name} {size}: {score['verdict']}: {claims}{gain} ({result['wall_s']:.0f} s)"
            + ("" if score["good"] else "  <-- look"))


def progress(text):
    print(text, file=sys.stderr, flush=True)
