#!/usr/bin/python3
"""The blind benchmark's own arithmetic, on truths and reports written by hand; and that everything it draws can be flown.
Usage: blind_test.py SCRIPTS ATMOS_SIM_FLIGHT VEHICLE"""
import json
import math
import os
import subprocess
import sys
import tempfile
import unittest

SCRIPTS, FLIGHT, VEHICLE = sys.argv[1:4]
sys.dont_write_bytecode = True
sys.path.insert(0, SCRIPTS)

from blind import hidden, scoring, tables  # noqa: E402

START = hidden.FIRST_START


def claim(kind, gain=50.0, listed=(), **parameters):
    return {"kind": kind, "parameters": {k: {"value": v[0], "std": v[1], "unit": ""} for k, v in parameters.items()},
            "evidence": {"log_likelihood_gain": gain}, "indistinguishable_from": list(listed)}


def report(*claims, verdict=None):
    return {"verdict": verdict or ("explained" if claims else "consistent"), "effects": list(claims),
            "mismatch": {"p_value": 0.5, "smallest_detectable": {}}}


def truth(family, *effects, accepted=()):
    return {"family": family, "effects": [{"kind": k, "parameters": p} for k, p in effects], "accepted": list(accepted)}


def scored(a_truth, a_report, errors=None):
    return scoring.score(a_truth, a_report, errors, START, shown=())


class Scoring(unittest.TestCase):
    def test_a_null_is_good_only_when_nothing_is_said(self):
        self.assertTrue(scored(truth("null"), report())["good"])
        self.assertFalse(scored(truth("null"), report(verdict="unexplained"))["good"])
        self.assertFalse(scored(truth("null"), report(claim("floor_tilt")))["good"])

    def test_the_first_name_is_that_with_the_largest_gain(self):
        tilt = truth("single", ("floor_tilt", {"slope_x": 1e-3, "slope_y": 0.0}))
        right = claim("floor_tilt", 90.0, slope_x=(1.01e-3, 1e-5), slope_y=(0.0, 1e-5))
        score = scored(tilt, report(claim("airflow", 20.0), right))
        self.assertTrue(score["right_first"])
        self.assertEqual(score["extra"], ["airflow"])
        self.assertFalse(score["good"])
        score = scored(tilt, report(claim("airflow", 200.0), right))
        self.assertFalse(score["right_first"])
        score = scored(tilt, report(claim("airflow", 200.0, listed=["floor_tilt"])))
        self.assertTrue(score["listed"])
        self.assertFalse(score["right_first"])

    def test_only_documented_sets_count_as_one_name(self):
        delay = truth("single", ("command_delay", {"delay_s": 0.02}))
        self.assertTrue(scored(delay, report(claim("mocap_latency", delay_s=(0.02, 1e-4))))["right_first"])
        self.assertFalse(scored(delay, report(claim("thrust_rise", time_constant_s=(0.02, 1e-4))))["right_first"])

    def test_parameter_errors_are_relative_to_the_distance_from_no_effect(self):
        heavy = truth("single", ("mass_error", {"factor": 1.1}))
        parameter = scored(heavy, report(claim("mass_error", factor=(1.105, 0.001))))["parameters"][0]
        self.assertAlmostEqual(parameter["relative_error"], 0.05)
        self.assertAlmostEqual(parameter["scores"][0], 5.0)
        tilt = truth("single", ("floor_tilt", {"slope_x": 3e-4, "slope_y": 4e-4}))
        found = claim("floor_tilt", slope_x=(3e-4, 1e-5), slope_y=(4.5e-4, 1e-5))
        self.assertAlmostEqual(scored(tilt, report(found))["parameters"][0]["relative_error"], 0.1)

    def test_thruster_and_onset(self):
        dead = truth("single", ("thruster_dead", {"thruster": 3, "since_s": START + 40.0}))
        right = scored(dead, report(claim("thruster_dead", thruster=(3, None), since_s=(START + 40.4, None))))
        self.assertEqual(right["thruster_right"], [True])
        self.assertAlmostEqual(right["onset_errors"][0], 0.4, places=5)
        wrong = scored(dead, report(claim("thruster_dead", thruster=(4, None), since_s=(START + 40.4, None))))
        self.assertEqual(wrong["thruster_right"], [False])
        self.assertFalse(wrong["good"])
        always = truth("single", ("thruster_dead", {"thruster": 3, "since_s": 0.0}))
        at_start = scored(always, report(claim("thruster_dead", thruster=(3, None), since_s=(START, None))))
        self.assertEqual(at_start["onset_errors"], [0.0])

    def test_several_effects_must_all_be_named(self):
        both = truth("multi", ("supply_coupling", {"fraction_per_open_thruster": 0.1}), ("tether", {"stiffness_n_m": 0.1}))
        one = scored(both, report(claim("supply_coupling", fraction_per_open_thruster=(0.1, 0.001))))
        self.assertTrue(one["right_first"])
        self.assertFalse(one["all_named"])

    def test_what_the_flight_could_not_show_is_marked(self):
        for stated, invisible in ((0.04, []), (0.06, ["mass_error"])):
            both = dict(truth("multi", ("supply_coupling", {"fraction_per_open_thruster": 0.1}), ("mass_error", {"factor": 1.1})),
                        duration_s=60.0)
            said = report(claim("supply_coupling", fraction_per_open_thruster=(0.1, 0.001)))
            said["mismatch"]["smallest_detectable"] = {"mass_error": {"parameter": "factor", "value": stated},
                                                       "supply_coupling": {"parameter": "fraction_per_open_thruster", "value": 9.0}}
            self.assertEqual(scored(both, said)["invisible"], invisible)

    def test_outside_the_vocabulary_only_a_formula_or_silence_is_right(self):
        law = truth("outside", ("unmodelled", {}), accepted=("airflow",))
        self.assertTrue(scored(law, report(verdict="unexplained"))["good"])
        self.assertTrue(scored(law, report(claim("unmodelled")))["good"])
        self.assertTrue(scored(law, report(claim("airflow")))["good"])
        self.assertFalse(scored(law, report(claim("unmodelled"), claim("viscous_drag")))["good"])

    def test_gain_is_relative_to_the_oracle(self):
        tilt = truth("single", ("floor_tilt", {"slope_x": 1e-3, "slope_y": 0.0}))
        errors = {"nominal": 0.1, "fitted": 0.028, "oracle": 0.01}
        self.assertAlmostEqual(scored(tilt, report(), errors)["gain_ratio"], 0.8)
        self.assertNotIn("gain_ratio", scored(tilt, report(), dict(errors, oracle=0.095)))

    def test_a_rough_place_counts_by_the_way_that_bearings_rub_in_it(self):
        along_x = [{"x": 0.01 * i, "y": 0.0, "yaw": 0.0} for i in range(201)]  # half-way: x = 1
        stated = {"friction_patch": {"parameter": "coefficient", "value": 1e-4}}

        def multiple(x, y):
            patch = {"center_x_m": x, "center_y_m": y, "radius_m": 0.3, "coefficient": 1e-3}
            return scoring.stated_multiple({"kind": "friction_patch", "parameters": patch}, stated, 60.0, along_x)

        self.assertAlmostEqual(multiple(1.0, 0.0), 10.0)
        self.assertEqual(multiple(1.0, 0.5), 0.0)  # the nearest bearing passes at 0.35 m
        self.assertTrue(0.0 < multiple(1.0, 0.4) < 10.0)

    def test_a_tether_counts_by_how_differently_it_pulls(self):
        along_x = [{"x": 0.1 * i, "y": 0.0, "yaw": 0.0} for i in range(11)]
        stated = {"tether": {"parameter": "stiffness_n_m", "value": 0.05}}

        def multiple(slack):
            tether = {"anchor_x_m": -1.0, "anchor_y_m": 0.0, "slack_m": slack, "stiffness_n_m": 0.2, "damping_n_s_m": 0.1}
            return scoring.stated_multiple({"kind": "tether", "parameters": tether}, stated, 60.0, along_x)

        self.assertAlmostEqual(multiple(0.5), 4.0)  # always taut
        self.assertEqual(multiple(2.0), 0.0)  # never
        self.assertTrue(0.0 < multiple(1.5) < 4.0)

    def test_multiples_of_the_stated_size(self):
        stated = {"mass_error": {"parameter": "factor", "value": 0.02}}
        effect = {"kind": "mass_error", "parameters": {"factor": 0.9}}
        self.assertAlmostEqual(scoring.stated_multiple(effect, stated, 60.0, []), 5.0)
        self.assertIsNone(scoring.stated_multiple({"kind": "slosh", "parameters": {}}, stated, 60.0, []))
        dead = {"kind": "thruster_dead", "parameters": {"thruster": 3, "since_s": hidden.FIRST_START + 40.0}}
        self.assertAlmostEqual(
            scoring.stated_multiple(dead, {"thruster_dead": {"parameter": "since_s", "value": 5.0}}, 60.0, []), 4.0)
        floor = {"kind": "floor_unevenness", "parameters": {"height_m": [[1e-3, -1e-3], [1e-3, -1e-3]]}}
        self.assertAlmostEqual(
            scoring.stated_multiple(floor, {"floor_unevenness": {"parameter": "height_m", "value": 5e-4}}, 60.0, []), 2.0)

    def test_prediction_error_is_that_of_the_windows_ends(self):
        shown = [{"stamp": 0.1 * i, "x": 1.0, "y": 2.0, "yaw": 0.0} for i in range(100)]
        rows = [{"window_start": w, "stamp": w + 0.1 * k, "x": 1.0 + 0.01 * k, "y": 2.0, "yaw": 0.02 * k}
                for w in (1.0, 3.0) for k in (1, 2)]
        expected = (0.02 ** 2 + (0.15 * 0.04) ** 2) ** 0.5
        self.assertAlmostEqual(scoring.prediction_error(rows, shown), expected)
        for away in (1e200, math.inf, math.nan):
            ran_away = [dict(row, x=away) for row in rows]
            self.assertGreaterEqual(scoring.prediction_error(ran_away, shown), 1e199)

    def test_rows_and_table_sum_up(self):
        good = scored(truth("single", ("mass_error", {"factor": 1.1})), report(claim("mass_error", factor=(1.1, 0.01))))
        bad = scored(truth("single", ("mass_error", {"factor": 1.1})), report())
        results = [{"family": "single", "index": i, "truth": {"label": "mass_error", "stratum": 0.5}, "wall_s": 1.0,
                    "score": dict(s, multiple=3.0), "twin": {"detected": i == 1, "claims": []}}
                   for i, s in enumerate((good, bad))]
        rows = {row["name"]: row for row in tables.rows(results)}
        self.assertEqual(rows["blind/detection"]["value"], 0.5)
        self.assertEqual(rows["blind/false_alarm"]["value"], 0.5)
        self.assertEqual(rows["blind/right_name_first"]["n"], 2)
        self.assertIn("| mass_error | 2–5 | 2 | 50 % | 50 % |", tables.markdown(results))


class Drawing(unittest.TestCase):
    def system(self, family, index, durations=(8.0, 8.0)):
        return hidden.draw(f"1/{family}/{index}", family, index, durations, VEHICLE)

    def test_seeds_repeat(self):
        self.assertEqual(self.system("multi", 3), self.system("multi", 3))
        self.assertNotEqual(self.system("multi", 3), self.system("multi", 4))

    def test_several_effects_are_ones_that_would_be_seen_and_do_not_change_what_is_flown(self):
        strong = lambda effect: effect["kind"] != "floor_vibration" and effect["parameters"].get("coefficient", 1.0) > 5e-4
        for index in range(40):
            system = hidden.draw(f"1/{index}", "multi", index, (8.0, 8.0), VEHICLE, seen=strong)
            self.assertTrue(all(map(strong, system["truth"]["effects"])))
            any_size = hidden.draw(f"1/{index}", "multi", index, (8.0, 8.0), VEHICLE)
            self.assertEqual(system["flights"]["twin"], any_size["flights"]["twin"])

    def test_every_kind_and_law_can_be_flown(self):
        systems = [self.system("single", i) for i in range(len(hidden.KINDS))]
        systems += [self.system("outside", i) for i in range(len(hidden.LAWS))]
        self.assertEqual({s["truth"]["label"] for s in systems}, set(hidden.KINDS) | set(hidden.LAWS))
        with tempfile.TemporaryDirectory() as folder:
            for system in systems:
                scenario, bag = os.path.join(folder, "s.yaml"), os.path.join(folder, "s.bag")
                with open(scenario, "w") as file:
                    json.dump(system["flights"]["a"], file)
                done = subprocess.run([FLIGHT, scenario, "--start", repr(START), "--bag", bag], capture_output=True, text=True)
                self.assertEqual(done.returncode, 0, system["truth"]["label"] + ": " + done.stderr)


if __name__ == "__main__":
    unittest.main(argv=sys.argv[:1])
