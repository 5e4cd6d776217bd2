#include "atmos_model/effects.h"

#include <yaml-cpp/yaml.h>

#include <algorithm>
#include <stdexcept>
#include <type_traits>
#include <utility>

namespace atmos {

namespace {

template <class E, class = void>
constexpr bool has_thruster = false;
template <class E>
constexpr bool has_thruster<E, std::void_t<decltype(E::thruster)>> = true;

struct ParameterReader {
  const ConfigMap& map;

  void operator()(const ParameterInfo& info, double& value) const {
    value = map.number(info.name, info.bounds);
  }
  void operator()(const ParameterInfo& info, int& value) const {
    value = map.integer(info.name, static_cast<int>(info.bounds.min), static_cast<int>(info.bounds.max));
  }
  void operator()(const ParameterInfo& info, std::array<double, 2>& value) const {
    const Eigen::Vector2d v = map.vector2(info.name, info.bounds);
    value = {v.x(), v.y()};
  }
  void operator()(const ParameterInfo& info, GridRows& value) const {
    // A large map may stand in a file of its own: `height_file` in place of `height_m`.
    const std::string file_key = info.name == "height_m" ? "height_file" : "";
    value = !file_key.empty() && map.has(file_key) ? map.rows_file(file_key, info.bounds)
                                                   : map.rows(info.name, info.bounds);
    if (value.empty() || value.front().empty()) value = {{0.0}};
  }
  void operator()(const ParameterInfo& info, std::string& value) const { value = map.text(info.name); }
  void operator()(const ParameterInfo& info, std::vector<ImpulseEvent>& value) const {
    value.clear();
    for (const ConfigMap& event : map.maps(info.name)) {
      value.push_back(
          {event.number("time_s", ros_time()),
           {event.number("impulse_x_n_s", info.bounds), event.number("impulse_y_n_s", info.bounds)},
           event.number("impulse_yaw_n_m_s", info.bounds)});
    }
  }
  void operator()(const ParameterInfo& info, std::map<std::string, Unmodelled::Coefficient>& value) const {
    value.clear();
    if (const auto named = map.optional_map(info.name)) {
      for (const std::string& name : named->keys()) {
        const ConfigMap coefficient = named->map(name);
        value[name] = {coefficient.number("value", info.bounds), coefficient.text("unit")};
      }
    }
  }
};

struct ParameterWriter {
  YAML::Emitter& out;

  void operator()(const ParameterInfo& info, const GridRows& rows) const {
    out << YAML::Key << info.name << YAML::Value << YAML::Flow << rows;
  }
  void operator()(const ParameterInfo& info, const std::array<double, 2>& value) const {
    out << YAML::Key << info.name << YAML::Value << YAML::Flow
        << std::vector<double>(value.begin(), value.end());
  }
  void operator()(const ParameterInfo& info, const std::vector<ImpulseEvent>& events) const {
    out << YAML::Key << info.name << YAML::Value << YAML::BeginSeq;
    for (const ImpulseEvent& event : events) {
      out << YAML::Flow << YAML::BeginMap;
      out << YAML::Key << "time_s" << YAML::Value << event.time_s;
      out << YAML::Key << "impulse_x_n_s" << YAML::Value << event.impulse_n_s.x();
      out << YAML::Key << "impulse_y_n_s" << YAML::Value << event.impulse_n_s.y();
      out << YAML::Key << "impulse_yaw_n_m_s" << YAML::Value << event.impulse_yaw_n_m_s << YAML::EndMap;
    }
    out << YAML::EndSeq;
  }
  void operator()(const ParameterInfo& info,
                  const std::map<std::string, Unmodelled::Coefficient>& coefficients) const {
    out << YAML::Key << info.name << YAML::Value << YAML::BeginMap;
    for (const auto& [name, coefficient] : coefficients) {
      out << YAML::Key << name << YAML::Value << YAML::Flow << YAML::BeginMap;
      out << YAML::Key << "value" << YAML::Value << coefficient.value;
      out << YAML::Key << "unit" << YAML::Value << YAML::DoubleQuoted << coefficient.unit << YAML::EndMap;
    }
    out << YAML::EndMap;
  }
  template <class Scalar>
  void operator()(const ParameterInfo& info, const Scalar& value) const {
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

// The first thing wrong with a formula; empty when it compiles.
std::string formula_fault(const Unmodelled& law, const std::string& formula, std::size_t thrusters) {
  try {
    law.compile({formula}, thrusters);
    return "";
  } catch (const std::invalid_argument& error) {
    return error.what();
  }
}

// Rules that span several parameters, or this effect and those before it.
void check_consistency(const Effect& effect, const std::vector<Effect>& before, const Vehicle* vehicle,
                       const ConfigMap& item, const ConfigMap& parameters) {
  const auto same_kind = [&](const Effect& other) { return other.index() == effect.index(); };
  if (std::any_of(before.begin(), before.end(), same_kind) &&
      !std::visit([](const auto& e) { return e.kRepeatable; }, effect))
    item.fault("kind", "stands more than once: " + kind_of(effect));

  if (const int thruster = thruster_of(effect); thruster != 0) {
    if (std::any_of(before.begin(), before.end(),
                    [&](const Effect& other) { return same_kind(other) && thruster_of(other) == thruster; }))
      parameters.fault("thruster", "is named by another " + kind_of(effect) + " already");
    if (vehicle != nullptr && !misfit(effect, *vehicle).empty())
      parameters.fault("thruster", misfit(effect, *vehicle));
  }
  if (std::holds_alternative<Slosh>(effect) && vehicle != nullptr && !misfit(effect, *vehicle).empty())
    parameters.fault("mass_kg", misfit(effect, *vehicle));
  if (const auto* airflow = std::get_if<Airflow>(&effect)) {
    if (airflow->force_x_n.size() != airflow->force_y_n.size() ||
        airflow->force_x_n.front().size() != airflow->force_y_n.front().size())
      parameters.fault("force_y_n", "must have as many rows and columns as force_x_n");
  }
  if (const auto* law = std::get_if<Unmodelled>(&effect)) {
    const std::size_t thrusters =
        vehicle != nullptr ? vehicle->thrusters.size() : static_cast<std::size_t>(kMaxThrusters);
    law->parameters(*law, [&](const ParameterInfo& info, const auto& value) {
      if constexpr (std::is_same_v<std::decay_t<decltype(value)>, std::string>) {
        if (const std::string fault = formula_fault(*law, value, thrusters); !fault.empty())
          parameters.fault(info.name, fault);
      }
    });
  }
}

std::vector<std::string> kinds() {
  std::vector<std::string> names;
  for (const EffectInfo& info : registered_effects()) names.push_back(info.kind);
  return names;
}

}  // namespace

int thruster_of(const Effect& effect) {
  return std::visit(
      [](const auto& e) {
        if constexpr (has_thruster<std::decay_t<decltype(e)>>) return e.thruster;
        return 0;
      },
      effect);
}

void set_thruster(Effect& effect, int thruster) {
  std::visit(
      [thruster](auto& e) {
        if constexpr (has_thruster<std::decay_t<decltype(e)>>) e.thruster = thruster;
      },
      effect);
}

const std::vector<EffectInfo>& registered_effects() {
  static const std::vector<EffectInfo> all = collect(std::make_index_sequence<std::variant_size_v<Effect>>{});
  return all;
}

std::string kind_of(const Effect& effect) {
  return std::visit([](const auto& e) { return std::string(e.kKind); }, effect);
}

std::string misfit(const Effect& effect, const Vehicle& vehicle) {
  const int count = static_cast<int>(vehicle.thrusters.size());
  if (thruster_of(effect) > count)
    return "must not be above " + std::to_string(count) + ", the thrusters of " + vehicle.name;
  const auto* slosh = std::get_if<Slosh>(&effect);
  if (slosh != nullptr && slosh->mass_kg > Slosh::kMostOfVehicle * vehicle.mass_kg)
    return "must not be more than half the mass of " + vehicle.name;
  return "";
}

std::vector<Effect> read_effects(const ConfigMap& root, const Vehicle* vehicle) {
  std::vector<Effect> effects;
  for (const ConfigMap& item : root.maps("effects", false)) {
    const std::string kind = item.choice("kind", kinds());
    Effect effect;
    if (item.faulty("kind") || !make_effect(kind, effect)) {
      item.skip("parameters");
      continue;
    }
    const ConfigMap parameters = item.map("parameters");
    std::visit([&](auto& e) { e.parameters(e, ParameterReader{parameters}); }, effect);
    check_consistency(effect, effects, vehicle, item, parameters);
    effects.push_back(effect);
  }
  std::stable_sort(effects.begin(), effects.end(),
                   [](const Effect& a, const Effect& b) { return a.index() < b.index(); });
  return effects;
}

std::vector<Effect> load_model(const std::string& path, const Vehicle& vehicle) {
  const ConfigFile file(path);
  std::vector<Effect> effects = read_effects(file.root(), &vehicle);
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
    out << YAML::Key << "parameters" << YAML::Value << YAML::BeginMap;
    std::visit([&](const auto& e) { e.parameters(e, ParameterWriter{out}); }, effect);
    out << YAML::EndMap << YAML::EndMap;
  }
  out << YAML::EndSeq << YAML::EndMap;
  return std::string(out.c_str()) + "\n";
}

}  // namespace atmos
