#include "atmos_model/effects.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <fstream>
#include <sstream>

#include "nominal.h"

namespace atmos {
namespace {

std::vector<Effect> effects_from(const std::string& text) {
  const ConfigFile file = ConfigFile::from_text(text, "model.yaml");
  const std::vector<Effect> effects = read_effects(file.root());
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

std::string entry(const EffectInfo& info, const std::string& changed = "", const std::string& value = "") {
  std::ostringstream text;
  text.precision(17);
  text << "  - kind: " << info.kind << "\n    parameters: {";
  const char* separator = "";
  for (const ParameterInfo& parameter : info.parameters) {
    text << separator << parameter.name << ": ";
    if (parameter.name == changed) {
      text << value;
    } else {
      text << parameter.bounds.min + 0.3 * (parameter.bounds.max - parameter.bounds.min);
    }
    separator = ", ";
  }
  text << "}\n";
  return text.str();
}

TEST(Effects, EveryKindSurvivesWritingAndReading) {
  std::string text = "effects:\n";
  for (const EffectInfo& info : registered_effects()) text += entry(info);
  const std::vector<Effect> effects = effects_from(text);
  ASSERT_EQ(effects.size(), registered_effects().size());
  const std::string written = write_model(effects);
  const std::vector<Effect> again = effects_from(written);
  ASSERT_EQ(again.size(), effects.size());
  for (std::size_t i = 0; i < effects.size(); ++i) {
    EXPECT_EQ(kind_of(again[i]), registered_effects()[i].kind);
    EXPECT_EQ(write_model({again[i]}), write_model({effects[i]}));
  }
  EXPECT_EQ(write_model(again), written);
  EXPECT_TRUE(effects_from(write_model({})).empty());
  const std::vector<Effect> one = effects_from("effects:\n" + entry(registered_effects()[0]));
  EXPECT_DOUBLE_EQ(std::get<SupplyCoupling>(one.at(0)).fraction_per_open_thruster, -0.1 + 0.3 * 0.43);
}

TEST(Effects, EveryParameterIsRequiredAndBounded) {
  for (const EffectInfo& info : registered_effects()) {
    for (const ParameterInfo& parameter : info.parameters) {
      ASSERT_TRUE(std::isfinite(parameter.bounds.min) && std::isfinite(parameter.bounds.max))
          << parameter.name;
      const double beyond = 0.01 * (parameter.bounds.max - parameter.bounds.min);
      const std::string key = "effects[0].parameters." + parameter.name;
      for (const std::string& bad : {std::to_string(parameter.bounds.max + beyond), std::string(".nan"),
                                     std::to_string(parameter.bounds.min - beyond), std::string("much")}) {
        const std::vector<ConfigFault> faults = faults_of("effects:\n" + entry(info, parameter.name, bad));
        ASSERT_EQ(faults.size(), 1u) << info.kind << " " << parameter.name << " " << bad;
        EXPECT_EQ(faults[0].key, key);
        EXPECT_EQ(faults[0].line, 3);
      }
      std::string renamed = "effects:\n" + entry(info);
      renamed.replace(renamed.find(parameter.name), parameter.name.size(), "unheard_of");
      const std::vector<ConfigFault> faults = faults_of(renamed);
      ASSERT_EQ(faults.size(), 2u);
      EXPECT_TRUE(
          std::any_of(faults.begin(), faults.end(), [&](const ConfigFault& f) { return f.key == key; }));
    }
  }
}

TEST(Effects, AnUnknownKindIsOneFault) {
  const std::vector<ConfigFault> faults = faults_of("effects:\n  - kind: gremlins\n    parameters: {x: 1}\n");
  ASSERT_EQ(faults.size(), 1u);
  EXPECT_EQ(faults[0].key, "effects[0].kind");
  EXPECT_NE(faults[0].rule.find("floor_tilt"), std::string::npos);
}

TEST(Effects, AKindStandsOnce) {
  for (const EffectInfo& info : registered_effects()) {
    const std::vector<ConfigFault> faults = faults_of("effects:\n" + entry(info) + entry(info));
    ASSERT_EQ(faults.size(), 1u) << info.kind;
    EXPECT_EQ(faults[0].key, "effects[1].kind");
  }
}

TEST(Effects, AreInTableOrderHoweverTheFileListsThem) {
  std::string text = "effects:\n";
  for (auto info = registered_effects().rbegin(); info != registered_effects().rend(); ++info)
    text += entry(*info);
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
