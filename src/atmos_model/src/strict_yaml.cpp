#include "atmos_model/strict_yaml.h"

#include <yaml-cpp/yaml.h>

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <set>
#include <sstream>

namespace atmos {

namespace {

std::string describe(const std::vector<ConfigFault>& faults) {
  std::ostringstream out;
  for (const ConfigFault& fault : faults) {
    if (&fault != &faults.front()) out << '\n';
    out << fault.file;
    if (fault.line > 0) out << ':' << fault.line;
    out << ": ";
    if (!fault.key.empty()) out << fault.key << ": ";
    out << fault.rule;
  }
  return out.str();
}

std::string format_number(double value) {
  std::ostringstream out;
  out.precision(12);
  out << value;
  return out.str();
}

// Quoted scalars (tag "!") are texts, whatever they look like.
template <class T>
std::optional<T> scalar_as(const YAML::Node& node) {
  T value;
  if (node.IsScalar() && node.Tag() != "!" && YAML::convert<T>::decode(node, value)) return value;
  return std::nullopt;
}

}  // namespace

ConfigError::ConfigError(std::vector<ConfigFault> faults)
    : std::runtime_error(describe(faults)), faults_(std::move(faults)) {}

bool Bounds::contains(double value) const {
  return std::isfinite(value) && (exclusive_min ? value > min : value >= min) && value <= max;
}

std::string Bounds::text() const {
  const bool below = std::isfinite(min), above = std::isfinite(max);
  if (below && above)
    return "must be in " + std::string(exclusive_min ? "(" : "[") + format_number(min) + ", " +
           format_number(max) + "]";
  if (below) return "must be " + std::string(exclusive_min ? "> " : ">= ") + format_number(min);
  if (above) return "must be <= " + format_number(max);
  return "must be a finite number";
}

namespace {

// `path` as written in the file `in`.
std::string resolved(const std::string& in, const std::string& path) {
  const std::filesystem::path given(path);
  if (given.is_absolute()) return path;
  return (std::filesystem::path(in).parent_path() / given).lexically_normal().string();
}

}  // namespace

struct ConfigFile::Impl {
  std::string path;
  YAML::Node root;
  std::vector<ConfigFault> faults;
  std::vector<std::shared_ptr<ConfigMap::Impl>> maps;
};

struct ConfigMap::Impl {
  std::weak_ptr<ConfigFile::Impl> file;
  YAML::Node node;
  std::string prefix;  // "vehicle.thrusters[2]"
  int line = 0;        // where the mapping stands, or should stand
  std::set<std::string> used;

  std::string key_path(const std::string& key) const { return prefix.empty() ? key : prefix + "." + key; }

  static int line_of(const YAML::Node& node) { return node.Mark().is_null() ? 0 : node.Mark().line + 1; }

  void report(const YAML::Node& at, const std::string& key, const std::string& rule) const {
    report(line_of(at), key, rule);
  }
  void report(int at_line, const std::string& key, const std::string& rule) const {
    const auto owner_file = file.lock();
    std::vector<ConfigFault>& faults = owner_file->faults;
    // A key read twice is still one fault.
    const bool known = std::any_of(faults.begin(), faults.end(), [&](const ConfigFault& fault) {
      return fault.line == at_line && fault.key == key && fault.rule == rule;
    });
    if (!known) faults.push_back({owner_file->path, at_line, key, rule});
  }

  // Whether a fault of `key`, or of something inside it, stands recorded.
  bool faulty(const std::string& key) const {
    const auto owner_file = file.lock();
    return std::any_of(owner_file->faults.begin(), owner_file->faults.end(),
                       [&key](const ConfigFault& fault) {
                         return fault.key.compare(0, key.size(), key) == 0 &&
                                (fault.key.size() == key.size() || fault.key[key.size()] == '.' ||
                                 fault.key[key.size()] == '[');
                       });
  }

  // The node under `key`, or nothing (reported when required).
  std::optional<YAML::Node> find(const std::string& key, bool required) {
    used.insert(key);
    if (node.IsMap()) {
      const YAML::Node child = const_cast<const YAML::Node&>(node)[key];
      if (child.IsDefined()) return child;
    }
    if (required) report(line, key_path(key), "is missing");
    return std::nullopt;
  }

  // A mapping that is read twice is one mapping: its keys count as read by either.
  std::shared_ptr<Impl> child(const YAML::Node& at, int at_line, const std::string& child_prefix) const {
    for (const auto& known : file.lock()->maps) {
      if (known->prefix == child_prefix) return known;
    }
    auto made = std::make_shared<Impl>();
    made->file = file;
    made->node = at;
    made->line = at_line;
    made->prefix = child_prefix;
    file.lock()->maps.push_back(made);
    return made;
  }

  std::optional<double> checked_number(const YAML::Node& at, const std::string& key, Bounds bounds) const {
    const auto value = scalar_as<double>(at);
    if (!value) {
      report(at, key, "must be a number");
    } else if (!bounds.contains(*value)) {
      report(at, key, bounds.text() + ", is " + format_number(*value));
    } else {
      return value;
    }
    return std::nullopt;
  }
};

ConfigFile::ConfigFile(const std::string& path) : impl_(std::make_shared<Impl>()) {
  impl_->path = path;
  try {
    impl_->root = YAML::LoadFile(path);
  } catch (const YAML::BadFile&) {
    throw ConfigError({{path, 0, "", "cannot be read"}});
  } catch (const YAML::Exception& error) {
    throw ConfigError(
        {{path, error.mark.is_null() ? 0 : error.mark.line + 1, "", "is not valid YAML: " + error.msg}});
  }
}

ConfigFile ConfigFile::from_text(const std::string& text, const std::string& name) {
  ConfigFile file;
  file.impl_ = std::make_shared<Impl>();
  file.impl_->path = name;
  try {
    file.impl_->root = YAML::Load(text);
  } catch (const YAML::Exception& error) {
    throw ConfigError(
        {{name, error.mark.is_null() ? 0 : error.mark.line + 1, "", "is not valid YAML: " + error.msg}});
  }
  return file;
}

const std::string& ConfigFile::path() const { return impl_->path; }

std::string ConfigFile::resolve(const std::string& path) const { return resolved(impl_->path, path); }

ConfigMap ConfigFile::root() const {
  if (!impl_->maps.empty()) return ConfigMap(impl_->maps.front());
  auto map = std::make_shared<ConfigMap::Impl>();
  map->file = impl_;
  map->node = impl_->root;
  map->line = ConfigMap::Impl::line_of(impl_->root);
  impl_->maps.push_back(map);
  if (!impl_->root.IsMap()) impl_->faults.push_back({impl_->path, 0, "", "must be a YAML mapping"});
  return ConfigMap(map);
}

void ConfigFile::check() const {
  std::vector<ConfigFault> faults = impl_->faults;
  for (const auto& map : impl_->maps) {
    if (!map->node.IsMap()) continue;
    std::set<std::string> seen;
    for (const auto& entry : map->node) {
      const std::string key = entry.first.IsScalar() ? entry.first.Scalar() : "(key that is not a text)";
      const int line = ConfigMap::Impl::line_of(entry.first);
      if (!seen.insert(key).second) faults.push_back({impl_->path, line, map->key_path(key), "stands twice"});
      if (map->used.count(key) == 0)
        faults.push_back({impl_->path, line, map->key_path(key), "is not a known key"});
    }
  }
  if (faults.empty()) return;
  std::stable_sort(faults.begin(), faults.end(),
                   [](const ConfigFault& a, const ConfigFault& b) { return a.line < b.line; });
  throw ConfigError(std::move(faults));
}

bool ConfigMap::has(const std::string& key) const {
  return impl_->node.IsMap() && const_cast<const YAML::Node&>(impl_->node)[key].IsDefined();
}

std::vector<std::string> ConfigMap::keys() const {
  std::vector<std::string> keys;
  if (!impl_->node.IsMap()) return keys;
  for (const auto& entry : impl_->node) {
    if (entry.first.IsScalar()) keys.push_back(entry.first.Scalar());
  }
  return keys;
}

double ConfigMap::number(const std::string& key, Bounds bounds) const {
  const auto node = impl_->find(key, true);
  if (node) {
    if (const auto value = impl_->checked_number(*node, impl_->key_path(key), bounds)) return *value;
  }
  return bounds.contains(1.0) ? 1.0 : bounds.min;
}

double ConfigMap::number(const std::string& key, Bounds bounds, double fallback) const {
  return has(key) ? number(key, bounds) : (impl_->used.insert(key), fallback);
}

int ConfigMap::integer(const std::string& key, int min, int max) const {
  const auto node = impl_->find(key, true);
  if (!node) return min;
  const auto value = scalar_as<int>(*node);
  if (!value) {
    impl_->report(*node, impl_->key_path(key), "must be a whole number");
  } else if (*value < min || *value > max) {
    impl_->report(*node, impl_->key_path(key),
                  Bounds::between(min, max).text() + ", is " + std::to_string(*value));
  } else {
    return *value;
  }
  return min;
}

int ConfigMap::integer(const std::string& key, int min, int max, int fallback) const {
  return has(key) ? integer(key, min, max) : (impl_->used.insert(key), fallback);
}

bool ConfigMap::flag(const std::string& key) const {
  const auto node = impl_->find(key, true);
  if (!node) return false;
  const auto value = scalar_as<bool>(*node);
  if (!value) impl_->report(*node, impl_->key_path(key), "must be true or false");
  return value.value_or(false);
}

bool ConfigMap::flag(const std::string& key, bool fallback) const {
  return has(key) ? flag(key) : (impl_->used.insert(key), fallback);
}

std::string ConfigMap::text(const std::string& key) const {
  const auto node = impl_->find(key, true);
  if (!node) return {};
  if (!node->IsScalar() || node->Scalar().empty()) {
    impl_->report(*node, impl_->key_path(key), "must be a text");
    return {};
  }
  return node->Scalar();
}

std::string ConfigMap::text(const std::string& key, const std::string& fallback) const {
  return has(key) ? text(key) : (impl_->used.insert(key), fallback);
}

std::string ConfigMap::choice(const std::string& key, const std::vector<std::string>& allowed) const {
  const std::string value = text(key);
  if (std::find(allowed.begin(), allowed.end(), value) != allowed.end()) return value;
  std::string rule = "must be one of";
  for (const std::string& word : allowed) rule += (word == allowed.front() ? " " : ", ") + word;
  fault(key, rule + "; is " + value);
  return allowed.front();
}

std::string ConfigMap::choice(const std::string& key, const std::vector<std::string>& allowed,
                              const std::string& fallback) const {
  return has(key) ? choice(key, allowed) : (impl_->used.insert(key), fallback);
}

std::vector<double> ConfigMap::numbers(const std::string& key, int size, Bounds bounds) const {
  std::vector<double> values;
  const auto node = impl_->find(key, true);
  if (node && !node->IsSequence()) impl_->report(*node, impl_->key_path(key), "must be a list of numbers");
  if (node && node->IsSequence()) {
    for (std::size_t i = 0; i < node->size(); ++i) {
      const auto value =
          impl_->checked_number((*node)[i], impl_->key_path(key) + "[" + std::to_string(i) + "]", bounds);
      values.push_back(value.value_or(bounds.contains(0.0) ? 0.0 : bounds.min));
    }
    if (size >= 0 && values.size() != static_cast<std::size_t>(size)) {
      impl_->report(*node, impl_->key_path(key),
                    "must have " + std::to_string(size) + " numbers, has " + std::to_string(values.size()));
    }
  }
  if (size >= 0) values.resize(static_cast<std::size_t>(size), 0.0);
  return values;
}

std::vector<std::string> ConfigMap::texts(const std::string& key) const {
  std::vector<std::string> values;
  const auto node = impl_->find(key, true);
  if (!node) return values;
  if (!node->IsSequence()) {
    impl_->report(*node, impl_->key_path(key), "must be a list of texts");
    return values;
  }
  for (std::size_t i = 0; i < node->size(); ++i) {
    if ((*node)[i].IsScalar()) {
      values.push_back((*node)[i].Scalar());
    } else {
      impl_->report((*node)[i], impl_->key_path(key) + "[" + std::to_string(i) + "]", "must be a text");
    }
  }
  return values;
}

std::vector<std::vector<double>> ConfigMap::rows(const std::string& key, Bounds bounds) const {
  std::vector<std::vector<double>> rows;
  const auto node = impl_->find(key, true);
  if (!node) return rows;
  if (!node->IsSequence() || node->size() == 0) {
    impl_->report(*node, impl_->key_path(key), "must be a list of rows of numbers");
    return rows;
  }
  for (std::size_t j = 0; j < node->size(); ++j) {
    const YAML::Node row = (*node)[j];
    const std::string row_key = impl_->key_path(key) + "[" + std::to_string(j) + "]";
    rows.emplace_back();
    if (!row.IsSequence() || row.size() == 0) {
      impl_->report(row, row_key, "must be a row of numbers");
      continue;
    }
    for (std::size_t i = 0; i < row.size(); ++i) {
      rows.back().push_back(
          impl_->checked_number(row[i], row_key + "[" + std::to_string(i) + "]", bounds).value_or(0.0));
    }
    if (rows.back().size() != rows.front().size()) {
      impl_->report(row, row_key,
                    "must be as long as the first row (" + std::to_string(rows.front().size()) + ")");
    }
  }
  for (auto& row : rows) row.resize(rows.front().size(), 0.0);
  return rows;
}

std::vector<std::vector<double>> ConfigMap::rows_file(const std::string& key, Bounds bounds) const {
  std::vector<std::vector<double>> rows;
  const std::string name = text(key);
  if (faulty(key)) return rows;
  const std::string path = resolved(impl_->file.lock()->path, name);
  std::ifstream in(path);
  if (!in) {
    fault(key, "cannot be read: " + path);
    return rows;
  }
  const auto report = [&](int line, const std::string& rule) {
    impl_->file.lock()->faults.push_back({path, line, impl_->key_path(key), rule});
  };
  std::string line;
  for (int number = 1; std::getline(in, line); ++number) {
    std::istringstream words(line.substr(0, line.find('#')));
    std::vector<double> row;
    for (std::string word; words >> word;) {
      char* end = nullptr;
      row.push_back(std::strtod(word.c_str(), &end));
      if (*end != '\0')
        report(number, "must be numbers, not " + word);
      else if (!bounds.contains(row.back()))
        report(number, bounds.text() + ", is " + format_number(row.back()));
    }
    if (row.empty()) continue;
    if (!rows.empty() && row.size() != rows.front().size())
      report(number, "must be as long as the first row (" + std::to_string(rows.front().size()) + ")");
    rows.push_back(std::move(row));
  }
  if (rows.empty()) report(0, "must hold at least one row of numbers");
  for (auto& row : rows) row.resize(rows.front().size(), 0.0);
  return rows;
}

Eigen::Vector2d ConfigMap::vector2(const std::string& key, Bounds bounds) const {
  const std::vector<double> values = numbers(key, 2, bounds);
  return {values[0], values[1]};
}

Eigen::Vector3d ConfigMap::vector3(const std::string& key, Bounds bounds) const {
  const std::vector<double> values = numbers(key, 3, bounds);
  return {values[0], values[1], values[2]};
}

ConfigMap ConfigMap::map(const std::string& key) const {
  const auto node = impl_->find(key, true);
  const std::string path = impl_->key_path(key);
  // Keys looked for inside what is no mapping are reported as well: one round of editing mends them all.
  if (!node) return ConfigMap(impl_->child(YAML::Node(), impl_->line, path));
  if (!node->IsMap()) impl_->report(*node, path, "must be a mapping");
  return ConfigMap(impl_->child(*node, Impl::line_of(*node), path));
}

std::optional<ConfigMap> ConfigMap::optional_map(const std::string& key) const {
  impl_->used.insert(key);
  if (!has(key)) return std::nullopt;
  return map(key);
}

std::vector<ConfigMap> ConfigMap::maps(const std::string& key, bool required) const {
  std::vector<ConfigMap> maps;
  const auto node = impl_->find(key, required);
  if (!node) return maps;
  if (!node->IsSequence()) {
    impl_->report(*node, impl_->key_path(key), "must be a list");
    return maps;
  }
  for (std::size_t i = 0; i < node->size(); ++i) {
    const std::string item = impl_->key_path(key) + "[" + std::to_string(i) + "]";
    if ((*node)[i].IsMap()) {
      maps.emplace_back(impl_->child((*node)[i], Impl::line_of((*node)[i]), item));
    } else {
      impl_->report((*node)[i], item, "must be a mapping");
    }
  }
  return maps;
}

void ConfigMap::skip(const std::string& key) const { impl_->used.insert(key); }

bool ConfigMap::faulty(const std::string& key) const { return impl_->faulty(impl_->key_path(key)); }

void ConfigMap::fault(const std::string& rule) const { impl_->report(impl_->line, impl_->prefix, rule); }

void ConfigMap::fault(const std::string& key, const std::string& rule) const {
  if (faulty(key)) return;
  const int line = has(key) ? Impl::line_of(const_cast<const YAML::Node&>(impl_->node)[key]) : impl_->line;
  impl_->report(line, impl_->key_path(key), rule);
}

}  // namespace atmos
