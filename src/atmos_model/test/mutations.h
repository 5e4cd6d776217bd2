// Systematically broken copies of a configuration file: each key removed, renamed and mistyped.
#pragma once

#include <gtest/gtest.h>
#include <yaml-cpp/yaml.h>

#include <algorithm>
#include <string>
#include <vector>

#include "atmos_model/strict_yaml.h"

namespace atmos {

struct Mutation {
  std::string key;  // that must be named in a fault
  std::string what;
  YAML::Node root;
};

inline std::string emitted(const YAML::Node& node) {
  YAML::Emitter out;
  out << node;
  return out.c_str();
}

// Applies `change(parent, key)` to a copy of `root` at the mapping reached by `path`.
template <class Change>
YAML::Node changed_copy(const YAML::Node& root, const std::vector<std::string>& path, const Change& change) {
  YAML::Node copy = YAML::Clone(root);
  YAML::Node at = copy;
  for (const std::string& step : path) {
    const YAML::Node next = step[0] == '#' ? at[std::stoi(step.substr(1))] : at[step];
    at.reset(next);
  }
  change(at);
  return copy;
}

inline void collect_mutations(const YAML::Node& root, const YAML::Node& at,
                              const std::vector<std::string>& path, const std::string& prefix,
                              const std::vector<std::string>& optional, std::vector<Mutation>& all) {
  if (at.IsSequence()) {
    for (std::size_t i = 0; i < at.size(); ++i) {
      std::vector<std::string> deeper = path;
      deeper.push_back("#" + std::to_string(i));
      collect_mutations(root, at[i], deeper, prefix + "[" + std::to_string(i) + "]", optional, all);
    }
  }
  if (!at.IsMap()) return;
  for (const auto& entry : at) {
    const std::string name = entry.first.Scalar();
    const std::string key = prefix.empty() ? name : prefix + "." + name;
    const bool required = std::find(optional.begin(), optional.end(), key) == optional.end();
    if (required) {
      all.push_back({key, "removed", changed_copy(root, path, [&](YAML::Node map) { map.remove(name); })});
    }
    all.push_back({key + "_", "renamed", changed_copy(root, path, [&](YAML::Node map) {
                     map[name + "_"] = YAML::Clone(map[name]);
                     map.remove(name);
                   })});
    // A number, list or mapping where a text stands, and the other way round.
    all.push_back({key, "mistyped", changed_copy(root, path, [&](YAML::Node map) {
                     const bool is_text = map[name].IsScalar() && map[name].Scalar().find_first_not_of(
                                                                      "-+.0123456789eE") != std::string::npos;
                     map[name] = is_text ? YAML::Load("[]") : YAML::Load("0.01 // metres");
                   })});
    std::vector<std::string> deeper = path;
    deeper.push_back(name);
    collect_mutations(root, entry.second, deeper, key, optional, all);
  }
}

// `optional`: keys whose absence is no fault.
inline std::vector<Mutation> every_mutation(const YAML::Node& root,
                                            const std::vector<std::string>& optional) {
  std::vector<Mutation> all;
  collect_mutations(root, root, {}, "", optional, all);
  return all;
}

template <class Read>
void expect_refused(const Mutation& mutation, const Read& read) {
  try {
    read(mutation.root);
    ADD_FAILURE() << mutation.key << " " << mutation.what << " was accepted";
  } catch (const ConfigError& error) {
    EXPECT_TRUE(std::any_of(error.faults().begin(), error.faults().end(),
                            [&](const ConfigFault& fault) { return fault.key == mutation.key; }))
        << mutation.key << " " << mutation.what << ": " << error.what();
  }
}

}  // namespace atmos
