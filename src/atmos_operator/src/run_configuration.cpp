#include "atmos_operator/run_configuration.h"

#include <openssl/evp.h>
#include <yaml-cpp/yaml.h>

#include <algorithm>
#include <array>
#include <cstdio>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <set>

namespace atmos {

namespace {

namespace fs = std::filesystem;

constexpr std::uintmax_t kLargest = 4u << 20;  // bytes: larger is data, not configuration

using Users = std::map<fs::path, std::set<std::string>>;

bool is_file(const fs::path& path) {
  std::error_code error;
  return fs::is_regular_file(path, error) && fs::file_size(path, error) <= kLargest && !error;
}

bool is_yaml(const fs::path& path) { return path.extension() == ".yaml" || path.extension() == ".yml"; }

std::string read(const fs::path& path) {
  std::ifstream file(path, std::ios::binary);
  return {std::istreambuf_iterator<char>(file), {}};
}

// The files that the scalars below `node` name, seen from `folder`.
void find_names(const YAML::Node& node, const fs::path& folder, std::set<fs::path>& found) {
  if (node.IsScalar()) {
    const fs::path name(node.Scalar());
    if (name.has_extension() && is_file(folder / name)) found.insert(fs::weakly_canonical(folder / name));
    return;
  }
  for (const auto& entry : node) find_names(node.IsMap() ? entry.second : entry, folder, found);
}

void add(const fs::path& path, const std::string& user, Users& users) {
  const bool known = users.count(path) > 0;
  users[path].insert(user);
  if (known || !is_yaml(path)) return;
  std::set<fs::path> named;
  try {
    find_names(YAML::Load(read(path)), path.parent_path(), named);
  } catch (const YAML::Exception&) {
    return;  // kept as it is: it has no names to follow
  }
  for (const fs::path& other : named) add(other, path.filename(), users);
}

}  // namespace

std::string sha256(const std::string& text) {
  std::array<unsigned char, EVP_MAX_MD_SIZE> bytes;
  unsigned int size = 0;
  EVP_Digest(text.data(), text.size(), bytes.data(), &size, EVP_sha256(), nullptr);
  std::string hexadecimal;
  for (unsigned int i = 0; i < size; ++i) {
    std::array<char, 3> pair;
    std::snprintf(pair.data(), pair.size(), "%02x", bytes[i]);
    hexadecimal += pair.data();
  }
  return hexadecimal;
}

RunConfiguration collect_configuration(const std::map<std::string, std::string>& parameters) {
  Users users;
  for (const auto& [name, value] : parameters) {
    const fs::path path(value);
    if (path.is_absolute() && is_yaml(path) && is_file(path)) add(fs::weakly_canonical(path), name, users);
  }
  RunConfiguration configuration;
  std::string digested;
  for (const auto& [path, names] : users) {
    const std::string content = read(path);
    configuration.files.push_back({path, {names.begin(), names.end()}, sha256(content), content});
  }
  std::vector<std::string> lines;
  for (const ConfigurationFile& file : configuration.files) {
    std::string line;
    for (const std::string& name : file.used_by) line += name + "\n";
    lines.push_back(line + file.sha256 + "\n");
  }
  std::sort(lines.begin(), lines.end());
  for (const std::string& line : lines) digested += line;
  configuration.digest = sha256(digested);
  return configuration;
}

}  // namespace atmos
