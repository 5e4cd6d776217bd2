// Which configuration files a run uses, with their content and digests: what a recording keeps of them.
#pragma once

#include <map>
#include <string>
#include <vector>

namespace atmos {

struct ConfigurationFile {
  std::string path;
  std::vector<std::string> used_by;  // parameters, and names of files, that name it; ascending
  std::string sha256;                // hexadecimal
  std::string content;
};

struct RunConfiguration {
  std::vector<ConfigurationFile> files;  // in the order of their paths
  std::string digest;                    // over used_by and sha256 of all files, not over where they are
};

// Hexadecimal SHA-256 of `text`.
std::string sha256(const std::string& text);

// Every YAML file that a parameter (name -> value) names, and every file that one of those names relative to
// itself (a scenario its vehicle and floor, a controller its model), each once. What is no readable file, or
// no YAML, is passed over: most parameters name no file.
RunConfiguration collect_configuration(const std::map<std::string, std::string>& parameters);

}  // namespace atmos
