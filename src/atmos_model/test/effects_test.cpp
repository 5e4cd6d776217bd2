#include "atmos_model/plant.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cctype>
#include <filesystem>
#include <fstream>
#include <sstream>

#include "nominal.h"

namespace atmos {
namespace {

std::vector<Effect> effects_from(const std::string& text) {
  const ConfigFile file = ConfigFile::from_text(text, "model.yaml");
  const std::vector<Effect> effects = read_effects(file.root(), nullptr);
  file.check();
  return effects;
}

std::vector<ConfigFault> faults_of(const std::string& text) {
  try {
    effects_from(text);
  } catch (const ConfigError& error) {
    return error.faults();
  }
  return {};
}

// What a file may say for one parameter: something valid, and things that are not, each with the place of its
// fault below the parameter.
struct Sample {
  std::string good;
  std::vector<std::pair<std::string, std::string>> bad;
  bool required = true;
};

std::string number(double value) {
  std::ostringstream text;
  text.precision(17);
  text << value;
  return text.str();
}

double inside(const Bounds& bounds, double share = 0.3) {
  return bounds.min + share * (bounds.max - bounds.min);
}

std::vector<std::string> bad_numbers(const Bounds& bounds) {
  const double beyond = 0.01 * (bounds.max - bounds.min);
  return {number(bounds.max + beyond), number(bounds.min - beyond), ".nan", "much"};
}

Sample sample(const ParameterInfo& info, double) {
  Sample sample{number(inside(info.bounds)), {}};
  for (const std::string& bad : bad_numbers(info.bounds)) sample.bad.push_back({bad, ""});
  return sample;
}
Sample sample(const ParameterInfo& info, int) {
  return {"3", {{number(info.bounds.max + 1), ""}, {number(info.bounds.min - 1), ""}, {"1.5", ""}}};
}
Sample sample(const ParameterInfo& info, const std::array<double, 2>&) {
  Sample sample{"[" + number(inside(info.bounds)) + ", " + number(inside(info.bounds, 0.6)) + "]", {}};
  for (const std::string& bad : bad_numbers(info.bounds)) sample.bad.push_back({"[0, " + bad + "]", "[1]"});
  sample.bad.push_back({"[0]", ""});
  return sample;
}
Sample sample(const ParameterInfo& info, const GridRows&) {
  Sample sample{"[[0, 0, 0], [0, " + number(inside(info.bounds)) + ", 0]]", {}};
  for (const std::string& bad : bad_numbers(info.bounds))
    sample.bad.push_back({"[[0, 0, 0], [0, 0, " + bad + "]]", "[1][2]"});
  return sample;
}
Sample sample(const ParameterInfo&, const std::string&) {
  return {"\"0.1 * x + u1\"", {{"\"0.1 * speed\"", ""}, {"\"sin x\"", ""}, {"\"(\"", ""}, {"\"\"", ""}}};
}
Sample sample(const ParameterInfo&, const std::vector<ImpulseEvent>&) {
  const auto event = [](const std::string& time, const std::string& x) {
    return "[{time_s: " + time + ", impulse_x_n_s: " + x + ", impulse_y_n_s: -0.2, impulse_yaw_n_m_s: 0.01}]";
  };
  return {event("1003.0", "0.5"),
          {{event("1003.0", "1001"), "[0].impulse_x_n_s"}, {event("-1", "0.5"), "[0].time_s"}, {"3", ""}}};
}
Sample sample(const ParameterInfo&, const std::map<std::string, Unmodelled::Coefficient>&) {
  return {"{k: {value: 0.1, unit: N}}",
          {{"{k: {value: much, unit: N}}", ".k.value"}, {"{k: {value: 1e7, unit: N}}", ".k.value"}},
          false};
}

struct Kind {
  EffectInfo info;
  std::vector<Sample> samples;  // one per parameter
  bool repeatable;
};

template <std::size_t... I>
std::vector<Kind> collect(std::index_sequence<I...>) {
  std::vector<Kind> all;
  const auto add = [&all](auto effect) {
    Kind kind{registered_effects()[all.size()], {}, effect.kRepeatable};
    effect.parameters(effect, [&kind](const ParameterInfo& info, const auto& value) {
      kind.samples.push_back(sample(info, value));
    });
    all.push_back(std::move(kind));
  };
  (add(std::variant_alternative_t<I, Effect>{}), ...);
  return all;
}

const std::vector<Kind>& all_kinds() {
  static const std::vector<Kind> all = collect(std::make_index_sequence<std::variant_size_v<Effect>>{});
  return all;
}

std::string entry(const Kind& kind, const std::string& changed = "", const std::string& value = "") {
  std::string text = "  - kind: " + kind.info.kind + "\n    parameters: {";
  for (std::size_t i = 0; i < kind.samples.size(); ++i) {
    const std::string& name = kind.info.parameters[i].name;
    text += (i == 0 ? "" : ", ") + name + ": " + (name == changed ? value : kind.samples[i].good);
  }
  return text + "}\n";
}

TEST(Effects, EveryKindSurvivesWritingAndReading) {
  std::string text = "effects:\n";
  for (const Kind& kind : all_kinds()) text += entry(kind);
  const std::vector<Effect> effects = effects_from(text);
  ASSERT_EQ(effects.size(), all_kinds().size());
  const std::string written = write_model(effects);
  const std::vector<Effect> again = effects_from(written);
  ASSERT_EQ(again.size(), effects.size());
  for (std::size_t i = 0; i < effects.size(); ++i) {
    EXPECT_EQ(kind_of(again[i]), registered_effects()[i].kind);
    EXPECT_EQ(write_model({again[i]}), write_model({effects[i]}));
    // No parameter is left out or takes another's place.
    for (const Sample& sample : all_kinds()[i].samples) {
      const std::string digits = sample.good.substr(0, sample.good.find_first_of(",:*"));
      if (std::isdigit(digits[0]) || digits[0] == '-') {
        EXPECT_NE(write_model({effects[i]}).find(digits.substr(0, 5)), std::string::npos) << written;
      }
    }
  }
  EXPECT_EQ(write_model(again), written);
  EXPECT_TRUE(effects_from(write_model({})).empty());
}

TEST(Effects, EveryParameterIsRequiredAndBounded) {
  for (const Kind& kind : all_kinds()) {
    for (std::size_t i = 0; i < kind.samples.size(); ++i) {
      const ParameterInfo& parameter = kind.info.parameters[i];
      const std::string key = "effects[0].parameters." + parameter.name;
      EXPECT_FALSE(parameter.unit.empty()) << key;
      for (const auto& [bad, below] : kind.samples[i].bad) {
        const std::vector<ConfigFault> faults = faults_of("effects:\n" + entry(kind, parameter.name, bad));
        ASSERT_EQ(faults.size(), 1u) << kind.info.kind << " " << parameter.name << " " << bad;
        EXPECT_EQ(faults[0].key, key + below) << bad;
        EXPECT_EQ(faults[0].line, 3);
      }
      std::string renamed = "effects:\n" + entry(kind);
      renamed.replace(renamed.find(parameter.name, renamed.find("{")), parameter.name.size(), "unheard_of");
      const std::vector<ConfigFault> faults = faults_of(renamed);
      const bool reported =
          std::any_of(faults.begin(), faults.end(), [&](const ConfigFault& f) { return f.key == key; });
      EXPECT_EQ(reported, kind.samples[i].required) << key;
      EXPECT_GE(faults.size(), 1u) << key;
    }
  }
}

TEST(Effects, AnUnknownKindIsOneFault) {
  const std::vector<ConfigFault> faults = faults_of("effects:\n  - kind: gremlins\n    parameters: {x: 1}\n");
  ASSERT_EQ(faults.size(), 1u);
  EXPECT_EQ(faults[0].key, "effects[0].kind");
  EXPECT_NE(faults[0].rule.find("floor_tilt"), std::string::npos);
}

TEST(Effects, AKindStandsOnceExceptForEachThrusterAndPlace) {
  for (const Kind& kind : all_kinds()) {
    const std::vector<ConfigFault> faults = faults_of("effects:\n" + entry(kind) + entry(kind));
    const bool names_thruster = kind.info.parameters[0].name == "thruster";
    if (kind.repeatable && !names_thruster) {
      EXPECT_TRUE(faults.empty()) << kind.info.kind;
      continue;
    }
    ASSERT_EQ(faults.size(), 1u) << kind.info.kind;
    EXPECT_EQ(faults[0].key, names_thruster ? "effects[1].parameters.thruster" : "effects[1].kind");
    if (names_thruster) {
      EXPECT_EQ(effects_from("effects:\n" + entry(kind) + entry(kind, "thruster", "4")).size(), 2u);
    }
  }
}

TEST(Effects, AThrusterOrMassTheVehicleDoesNotHaveIsAFault) {
  const Vehicle vehicle = nominal_vehicle();
  const std::string path = testing::TempDir() + "/effects_test_model.yaml";
  const auto faults_for_vehicle = [&](const std::string& text) {
    std::ofstream(path) << text;
    try {
      load_model(path, vehicle);
    } catch (const ConfigError& error) {
      return error.faults();
    }
    return std::vector<ConfigFault>{};
  };
  int checked = 0;
  for (const Kind& kind : all_kinds()) {
    if (kind.info.parameters[0].name != "thruster") continue;
    ++checked;
    EXPECT_TRUE(faults_for_vehicle("effects:\n" + entry(kind, "thruster", "8")).empty());
    const auto faults = faults_for_vehicle("effects:\n" + entry(kind, "thruster", "9"));
    ASSERT_EQ(faults.size(), 1u) << kind.info.kind;
    EXPECT_EQ(faults[0].file, path);
    EXPECT_EQ(faults[0].key, "effects[0].parameters.thruster");
    EXPECT_NE(faults[0].rule.find("8"), std::string::npos);
    // Without a vehicle the file may be right; the plant still refuses.
    EXPECT_THROW(Plant(vehicle, effects_from("effects:\n" + entry(kind, "thruster", "9")), kStart),
                 std::invalid_argument);
  }
  EXPECT_EQ(checked, 7);
  const auto slosh = faults_for_vehicle(
      "effects:\n  - kind: slosh\n    parameters: {mass_kg: 8.5, frequency_hz: 1, damping_ratio: 0, x_m: 0, "
      "y_m: "
      "0}\n");
  ASSERT_EQ(slosh.size(), 1u);
  EXPECT_EQ(slosh[0].key, "effects[0].parameters.mass_kg");
  const auto formula = faults_for_vehicle(
      "effects:\n  - kind: unmodelled\n    parameters: {force_x_n: u9, force_y_n: u8, torque_n_m: \"0\"}\n");
  ASSERT_EQ(formula.size(), 1u);
  EXPECT_EQ(formula[0].key, "effects[0].parameters.force_x_n");
}

TEST(Effects, RulesThatSpanParameters) {
  const auto one_fault = [](const std::string& kind, const std::string& parameters, const std::string& key) {
    const auto faults = faults_of("effects:\n  - kind: " + kind + "\n    parameters: {" + parameters + "}\n");
    ASSERT_EQ(faults.size(), 1u) << kind;
    EXPECT_EQ(faults[0].key, "effects[0].parameters." + key);
  };
  one_fault("airflow", "origin_m: [0, 0], spacing_m: 1, force_x_n: [[1, 1]], force_y_n: [[1], [1]]",
            "force_y_n");
  one_fault("unmodelled",
            "force_x_n: k, force_y_n: \"0\", torque_n_m: \"0\", coefficients: {k: {value: 1, unit: N, x: 1}}",
            "coefficients.k.x");
}

TEST(Effects, HeightsMayStandInAFileOfTheirOwn) {
  const std::string folder = std::filesystem::temp_directory_path().string();
  const auto write = [&](const std::string& heights) {
    std::ofstream(folder + "/effects_test_floor.txt") << heights;
    std::ofstream(folder + "/effects_test_model.yaml")
        << "effects:\n  - kind: floor_unevenness\n    parameters: {origin_m: [0, 0], spacing_m: 0.3, "
           "height_file: effects_test_floor.txt}\n";
    return folder + "/effects_test_model.yaml";
  };
  const auto floor = std::get<FloorUnevenness>(
      load_model(write("# two rows\n0 0.001 0.002\n\n0.003 0.004 5e-3 # m\n"), nominal_vehicle()).at(0));
  EXPECT_EQ(floor.height_m, (GridRows{{0, 0.001, 0.002}, {0.003, 0.004, 0.005}}));
  try {
    load_model(write("0 1\n0 0 x\n0\n"), nominal_vehicle());
    FAIL();
  } catch (const ConfigError& error) {
    ASSERT_EQ(error.faults().size(), 4u)
        << error.what();  // too high, not a number, and two rows too long or short
    EXPECT_EQ(error.faults()[0].line, 1);
    EXPECT_EQ(error.faults()[1].line, 2);
    EXPECT_EQ(error.faults()[1].file, folder + "/effects_test_floor.txt");
  }
  EXPECT_THROW(load_model(write(""), nominal_vehicle()), ConfigError);
}

TEST(Effects, AreInTableOrderHoweverTheFileListsThem) {
  std::string text = "effects:\n";
  for (auto kind = all_kinds().rbegin(); kind != all_kinds().rend(); ++kind) text += entry(*kind);
  const std::vector<Effect> effects = effects_from(text);
  for (std::size_t i = 0; i < effects.size(); ++i) EXPECT_EQ(effects[i].index(), i);
}

TEST(Effects, EveryKindIsDocumentedAsImplemented) {
  std::ifstream file(shipped("docs/effects.md"));
  std::stringstream text;
  text << file.rdbuf();
  for (const EffectInfo& info : registered_effects()) {
    EXPECT_NE(text.str().find("| `" + info.kind + "` | yes |"), std::string::npos) << info.kind;
    for (const ParameterInfo& parameter : info.parameters)
      EXPECT_NE(text.str().find(parameter.name), std::string::npos) << parameter.name;
  }
  std::size_t implemented = 0;
  for (std::size_t at = 0; (at = text.str().find("` | yes |", at)) != std::string::npos; ++at) ++implemented;
  EXPECT_EQ(implemented, registered_effects().size());
}

TEST(Effects, GravityIsThatOfTheDocument) { EXPECT_EQ(kGravity, 9.81); }

}  // namespace
}  // namespace atmos
