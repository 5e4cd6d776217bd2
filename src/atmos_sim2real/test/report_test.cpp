#include "atmos_sim2real/report.h"

#include <gtest/gtest.h>

#include <nlohmann/json.hpp>

#include "atmos_sim2real/statement.h"
#include "synthetic.h"

namespace atmos {
namespace {

using json = nlohmann::ordered_json;

constexpr double kStart = 1.7e9;

struct Reported {
  Vehicle vehicle = nominal_vehicle();
  std::vector<Flight> flights;
  Diagnosis diagnosis;
  json report;
  std::string model;

  Reported(const std::vector<Effect>& truth, bool hold_out) {
    flights.emplace_back(fly(vehicle, truth, pulse_commands(kStart, 45.0, 41), 42).recording);
    diagnosis = diagnose(vehicle, {}, flights, {});
    const Problem problem{&vehicle, {}, &flights};
    const Recording unseen = fly(vehicle, truth, pulse_commands(kStart + 900.0, 30.0, 43), 44).recording;
    const Proof proof = hold_out ? prove_held_out(problem, diagnosis.search.final, {unseen})
                                 : prove_on_blocks(problem, diagnosis.search.final);
    report = atmos::report(diagnosis, problem, proof);
    model = write_model(claimed_effects(diagnosis));
    EXPECT_FALSE(plot_data(diagnosis, problem, proof).dump().empty());
  }
};

// The keys and types that other programs rely on (docs/diagnosis.md).
void expect_schema(const json& r) {
  EXPECT_EQ(r.at("schema"), 1);
  const auto& mismatch = r.at("mismatch");
  EXPECT_TRUE(mismatch.at("p_value").is_number());
  for (const char* axis : {"x", "y", "yaw"}) EXPECT_TRUE(mismatch.at("axes").at(axis).is_number());
  for (const auto& place : mismatch.at("where")) {
    EXPECT_TRUE(place.at("what").is_string() && place.at("statement").is_string());
    EXPECT_TRUE(place.at("share").is_number() && place.at("even_share").is_number());
  }
  EXPECT_TRUE(mismatch.at("smallest_detectable").is_object());
  for (const auto& [kind, smallest] : mismatch.at("smallest_detectable").items())
    EXPECT_TRUE(smallest.at("parameter").is_string() && smallest.contains("value") &&
                smallest.contains("unit"));
  for (const auto& effect : r.at("effects")) {
    EXPECT_FALSE(effect.at("statement").get<std::string>().empty());
    for (const auto& [name, p] : effect.at("parameters").items())
      EXPECT_TRUE(p.contains("value") && p.contains("std") && p.at("unit").is_string()) << name;
    for (const char* key : {"log_likelihood_gain", "heldout_log_likelihood_gain", "inclusion"})
      EXPECT_TRUE(effect.at("evidence").at(key).is_number()) << key;
    EXPECT_TRUE(effect.at("indistinguishable_from").is_array() && effect.at("next_experiment").is_string());
  }
  EXPECT_TRUE(r.at("rivals").is_array());
  EXPECT_TRUE(r.at("unexplained").at("acceleration_rms_m_s2").is_number());
  EXPECT_TRUE(r.at("unexplained").at("where").is_string());
  EXPECT_EQ(r.at("fit").at("horizon_s"), 5.0);
  for (const char* model : {"nominal", "fitted", "noise_floor"}) {
    for (const char* key : {"position_rms_m", "yaw_rms_rad"})
      EXPECT_TRUE(r.at("fit").at(model).at(key).is_number()) << model << " " << key;
  }
  EXPECT_EQ(r.at("fit").at("other_horizons").size(), 2u);
}

TEST(Report, ANullFlightIsConsistent) {
  const Reported null({}, true);
  expect_schema(null.report);
  EXPECT_EQ(null.report["verdict"], "consistent");
  EXPECT_GT(null.report["mismatch"]["p_value"], 0.01);
  EXPECT_LT(null.report["mismatch"]["p_value"], 1.0);
  EXPECT_TRUE(null.report["effects"].empty());
  EXPECT_TRUE(ConfigFile::from_text(null.model, "model.yaml").root().maps("effects", false).empty());
  const json& fit = null.report["fit"];
  EXPECT_EQ(fit["on"], "held-out");
  EXPECT_EQ(fit["nominal"], fit["fitted"]);
  // What the noise model alone leaves is what the true model is seen to leave.
  const double error = fit["fitted"]["position_rms_m"], floor = fit["noise_floor"]["position_rms_m"];
  EXPECT_GT(error / floor, 0.4);
  EXPECT_LT(error / floor, 2.5);
}

TEST(Report, ASupplyCouplingIsNamedFittedAndProved) {
  const Reported found({SupplyCoupling{{}, 0.1}}, false);
  expect_schema(found.report);
  EXPECT_EQ(found.report["fit"]["on"], "blocks");
  EXPECT_EQ(found.report["verdict"], "explained");
  EXPECT_LT(found.report["mismatch"]["p_value"], 1e-6);
  ASSERT_EQ(found.report["effects"].size(), 1u);
  const double nominal = found.report["fit"]["nominal"]["position_rms_m"];
  EXPECT_LT(found.report["fit"]["fitted"]["position_rms_m"].get<double>(), 0.5 * nominal);

  // The report lists what model.yaml holds, number by number.
  const ConfigFile file = ConfigFile::from_text(found.model, "model.yaml");
  const std::vector<Effect> read = read_effects(file.root(), nullptr);
  file.check();
  ASSERT_EQ(read.size(), 1u);
  EXPECT_EQ(kind_of(read[0]), found.report["effects"][0]["kind"]);
  EXPECT_EQ(write_model(read), found.model);
}

TEST(Report, APushIsLocatedAndProvedWithItself) {
  ExternalImpulse push;
  push.events = {{kStart + 20.0, {0.3, -0.2}, 0.02}};
  const Reported found({push}, false);
  ASSERT_EQ(found.report["effects"].size(), 1u);
  ASSERT_FALSE(found.report["mismatch"]["where"].empty());
  const json& where = found.report["mismatch"]["where"][0];
  EXPECT_EQ(where["what"], "time");
  EXPECT_EQ(where["statement"].get<std::string>().rfind("around 20", 0), 0u) << where["statement"];
  EXPECT_LT(where["even_share"].get<double>(), 0.2);
  // No other block knows of the push, so it is predicted as it was fitted.
  const json& second = found.report["fit"]["other_horizons"][0];
  EXPECT_EQ(second["horizon_s"], 1.0);
  EXPECT_LT(second["fitted"]["position_rms_m"].get<double>(),
            0.3 * second["nominal"]["position_rms_m"].get<double>());
}

TEST(Report, ListsEveryParameterOfEveryKind) {
  FloorUnevenness floor;
  floor.height_m = {{0.0, 1e-3}, {2e-3, 0.0}};
  Airflow wind;
  wind.force_x_n = wind.force_y_n = {{0.01, 0.0}, {0.0, 0.0}};
  ExternalImpulse pushes;
  pushes.events = {{kStart + 3.0, {0.1, 0.2}, 0.01}};
  Unmodelled law;
  law.force_x_n = "-a*x";
  law.coefficients["a"] = {0.5, "N/m"};
  ThrusterDead dead;
  dead.thruster = 4;
  dead.since_s = kStart + 67.5;

  Diagnosis diagnosis;
  diagnosis.verdict = Verdict::kExplained;
  Fit& final = diagnosis.search.final;
  // In the order in which a search may have found them.
  final.effects = {law, pushes, wind, floor, dead};
  FreeParameter since{4, "since_s", 0, 0.0, 1.0, 1.0};
  final.free = {since};
  final.covariance = Eigen::MatrixXd::Constant(1, 1, 0.04);
  for (const Effect& effect : final.effects) {
    Claim claim;
    claim.hypothesis.kind = kind_of(effect);
    diagnosis.search.claims.push_back(claim);
    diagnosis.indistinguishable.push_back({});
    diagnosis.placebo.emplace_back();
  }
  diagnosis.indistinguishable[4] = {"lost command bit"};
  const Vehicle vehicle = nominal_vehicle();
  std::vector<Flight> flights;
  flights.emplace_back(fly(vehicle, {}, pulse_commands(kStart, 4.0, 1), 2).recording);
  Proof proof;
  proof.on = "blocks";
  proof.horizons = {{5.0, {}, {}, {}}};
  const json r = report(diagnosis, {&vehicle, {}, &flights}, proof);

  const std::vector<Effect> read = [&] {
    const ConfigFile file = ConfigFile::from_text(write_model(claimed_effects(diagnosis)), "model.yaml");
    const std::vector<Effect> effects = read_effects(file.root(), nullptr);
    file.check();
    return effects;
  }();
  ASSERT_EQ(r["effects"].size(), read.size());
  for (std::size_t i = 0; i < read.size(); ++i) {
    const json& listed = r["effects"][i];
    EXPECT_EQ(listed["kind"], kind_of(read[i]));
    std::visit(
        [&](const auto& e) {
          e.parameters(e, [&](const ParameterInfo& info, const auto&) {
            EXPECT_TRUE(listed["parameters"].contains(info.name)) << info.name;
          });
        },
        read[i]);
  }
  const json& thruster = r["effects"][0];
  EXPECT_EQ(thruster["parameters"]["thruster"], json({{"value", 4}, {"std", nullptr}, {"unit", "1"}}));
  EXPECT_NEAR(thruster["parameters"]["since_s"]["std"].get<double>(), 0.2, 1e-12);
  EXPECT_EQ(thruster["statement"], "thruster 4 is dead from 67.5 s after the first command on");
  EXPECT_NE(thruster["next_experiment"], "");
  EXPECT_EQ(r["effects"][1]["parameters"]["height_m"]["value"], json({{0.0, 1e-3}, {2e-3, 0.0}}));
  EXPECT_EQ(r["effects"][3]["parameters"]["events"]["value"][0]["impulse_y_n_s"], 0.2);
  EXPECT_EQ(r["effects"][4]["parameters"]["coefficients"]["value"]["a"]["unit"], "N/m");
  // No window was long enough: there is no error to report.
  EXPECT_TRUE(r["fit"]["nominal"]["position_rms_m"].is_null());
}

TEST(Statement, EveryKindHasOneWithANumber) {
  for (const EffectInfo& info : registered_effects()) {
    if (info.kind == "unmodelled") continue;
    std::string text = "effects:\n  - kind: " + info.kind + "\n    parameters: {";
    for (const ParameterInfo& p : info.parameters) {
      const bool rows = p.name == "height_m" || p.name.rfind("force_", 0) == 0;
      const std::string value = p.name == "events"                            ? "[]"
                                : p.name == "origin_m"                        ? "[0, 0]"
                                : rows                                        ? "[[0, 0.01], [0, 0]]"
                                : p.name == "thruster" || p.name == "bearing" ? "2"
                                                                              : "0.5";
      text += (text.back() == '{' ? "" : ", ") + p.name + ": " +
              (value == "0.5" && !p.bounds.contains(0.5) ? std::to_string(0.5 * (p.bounds.min + p.bounds.max))
                                                         : value);
    }
    const ConfigFile file = ConfigFile::from_text(text + "}\n", info.kind);
    const std::vector<Effect> effects = read_effects(file.root(), nullptr);
    file.check();
    const std::string statement = statement_of(effects.at(0), {{"flight", kStart}});
    EXPECT_NE(statement.find_first_of("0123456789"), std::string::npos) << info.kind << ": " << statement;
    EXPECT_NE(experiment_against(info.kind, "viscous_drag"), "") << info.kind;
  }
}

TEST(Statement, SaysOnWhichSideAPlaceInTheBodyLies) {
  ComOffset centre;
  centre.x_m = -0.013;
  centre.y_m = 0.02;
  EXPECT_EQ(statement_of(centre, {}),
            "the centre of mass lies 13 mm behind and 20 mm to the left of the geometric centre");
  MarkerOffset marker;
  marker.x_m = 0.03;
  marker.y_m = -0.005;
  EXPECT_EQ(statement_of(marker, {}),
            "the tracked point lies 30 mm in front and 5 mm to the right of the geometric centre");
}

TEST(Statement, TellsTimesFromTheRecordingTheyLieIn) {
  ThrusterDead dead;
  dead.thruster = 4;
  const std::vector<Began> flights = {{"second", 2000.0}, {"first", 1000.0}};
  const auto said = [&](double since_s, double deviation_s) {
    dead.since_s = since_s;
    return statement_of(dead, flights, deviation_s);
  };
  EXPECT_EQ(said(0.0, 0.0), "thruster 4 has been dead from the start (0 s)");
  EXPECT_EQ(said(1030.0, 0.1), "thruster 4 is dead from 30 s after the first command of first on");
  EXPECT_EQ(said(2012.0, 8.6), "thruster 4 is dead from 12 +- 8.6 s after the first command of second on");
  ExternalImpulse push;
  push.events = {{1041.0, {0.03, 0.04}, 0.0}};
  EXPECT_EQ(statement_of(push, flights),
            "something pushed the robot once: 0.05 N s and 0 N m s, 41 s after the first command of first");
  EXPECT_EQ(statement_of(dead, {flights.front()}), "thruster 4 is dead from 12 s after the first command on");
}

TEST(Verdict, WhatDoesNotCarryOverToHeldOutRecordingsIsPartlyExplained) {
  const auto verdict_of = [](Verdict before, const char* on, double fitted_m, double fitted_rad) {
    Diagnosis diagnosis;
    diagnosis.verdict = before;
    Proof proof;
    proof.on = on;
    proof.horizons = {{5.0, {0.2, 0.1, 0.0, 9}, {fitted_m, fitted_rad, 0.0, 9}, {0.01, 0.02, 0.0, 9}}};
    judge_by(proof, diagnosis);
    EXPECT_EQ(diagnosis.unexplained_where.empty(), diagnosis.verdict == before);
    return diagnosis.verdict;
  };
  EXPECT_EQ(verdict_of(Verdict::kExplained, kHeldOut, 0.029, 0.02), Verdict::kExplained);
  EXPECT_EQ(verdict_of(Verdict::kExplained, kHeldOut, 0.031, 0.02), Verdict::kPartlyExplained);
  EXPECT_EQ(verdict_of(Verdict::kExplained, kHeldOut, 0.01, 0.07), Verdict::kPartlyExplained);
  EXPECT_EQ(verdict_of(Verdict::kExplained, kBlocks, 0.1, 0.1), Verdict::kExplained);
  EXPECT_EQ(verdict_of(Verdict::kConsistent, kHeldOut, 0.1, 0.1), Verdict::kConsistent);
}

}  // namespace
}  // namespace atmos
