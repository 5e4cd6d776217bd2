#include "atmos_model/effects.h"

#include <yaml-cpp/yaml.h>

#include <algorithm>
#include <utility>

namespace atmos {

namespace {

struct ParameterReader {
  const ConfigMap& map;
  void operator()(const ParameterInfo& info, double& value) const {
    value = map.number(info.name, info.bounds);
  }
};

struct ParameterWriter {
  YAML::Emitter& out;
  void operator()(const ParameterInfo& info, double value) const {
    out << YAML::Key << info.name << YAML::Value << value;
  }
};

struct ParameterCollector {
  std::vector<ParameterInfo>& list;
  template <class T>
  void operator()(const ParameterInfo& info, const T&) const {
    list.push_back(info);
  }
};

template <std::size_t... I>
std::vector<EffectInfo> collect(std::index_sequence<I...>) {
  std::vector<EffectInfo> all;
  const auto add = [&all](auto effect) {
    using Kind = decltype(effect);
    EffectInfo info{Kind::kKind, Kind::kEquation, {}};
    Kind::parameters(effect, ParameterCollector{info.parameters});
    all.push_back(std::move(info));
  };
  (add(std::variant_alternative_t<I, Effect>{}), ...);
  return all;
}

// Default-constructs the alternative whose kind is `kind`.
template <std::size_t I = 0>
bool make_effect(const std::string& kind, Effect& effect) {
  if constexpr (I < std::variant_size_v<Effect>) {
    if (kind == std::variant_alternative_t<I, Effect>::kKind) {
      effect.emplace<I>();
      return true;
    }
    return make_effect<I + 1>(kind, effect);
  } else {
    return false;
  }
}

std::vector<std::string> kinds() {
  std::vector<std::string> names;
  for (const EffectInfo& info : registered_effects()) names.push_back(info.kind);
  return names;
}

}  // namespace

const std::vector<EffectInfo>& registered_effects() {
  static const std::vector<EffectInfo> all = collect(std::make_index_sequence<std::variant_size_v<Effect>>{});
  return all;
}

std::string kind_of(const Effect& effect) {
  return std::visit([](const auto& e) { return std::string(e.kKind); }, effect);
}

std::vector<Effect> read_effects(const ConfigMap& root) {
  std::vector<Effect> effects;
  for (const ConfigMap& item : root.maps("effects", false)) {
    const std::string kind = item.choice("kind", kinds());
    Effect effect;
    if (item.faulty("kind") || !make_effect(kind, effect)) {
      item.skip("parameters");
      continue;
    }
    const bool repeated = std::any_of(effects.begin(), effects.end(),
                                      [&](const Effect& other) { return other.index() == effect.index(); });
    if (repeated && !std::visit([](const auto& e) { return e.kRepeatable; }, effect))
      item.fault("kind", "stands more than once: " + kind);
    const ConfigMap parameters = item.map("parameters");
    std::visit([&](auto& e) { e.parameters(e, ParameterReader{parameters}); }, effect);
    effects.push_back(effect);
  }
  std::stable_sort(effects.begin(), effects.end(),
                   [](const Effect& a, const Effect& b) { return a.index() < b.index(); });
  return effects;
}

std::vector<Effect> load_model(const std::string& path) {
  const ConfigFile file(path);
  std::vector<Effect> effects = read_effects(file.root());
  file.check();
  return effects;
}

std::string write_model(const std::vector<Effect>& effects) {
  YAML::Emitter out;
  out.SetDoublePrecision(17);
  out << YAML::BeginMap << YAML::Key << "effects" << YAML::Value;
  if (effects.empty()) out << YAML::Flow;
  out << YAML::BeginSeq;
  for (const Effect& effect : effects) {
    out << YAML::BeginMap << YAML::Key << "kind" << YAML::Value << kind_of(effect);
    out << YAML::Key << "parameters" << YAML::Value << YAML::Flow << YAML::BeginMap;
    std::visit([&](const auto& e) { e.parameters(e, ParameterWriter{out}); }, effect);
    out << YAML::EndMap << YAML::EndMap;
  }
  out << YAML::EndSeq << YAML::EndMap;
  return std::string(out.c_str()) + "\n";
}

}  // namespace atmos
