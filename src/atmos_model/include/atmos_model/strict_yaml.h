// Strict configuration files: unknown, missing, mistyped and out-of-range keys are all reported at once, each
// with file, line, key and rule. Every configuration of the workspace is read through this.
#pragma once

#include <Eigen/Core>
#include <limits>
#include <memory>
#include <optional>
#include <stdexcept>
#include <string>
#include <vector>

namespace atmos {

// One broken rule. `line` is 1-based, 0 where the file as a whole is meant.
struct ConfigFault {
  std::string file;
  int line = 0;
  std::string key;
  std::string rule;
};

// Thrown at start-up with every fault of a file; what() has one line per fault.
class ConfigError : public std::runtime_error {
 public:
  explicit ConfigError(std::vector<ConfigFault> faults);
  const std::vector<ConfigFault>& faults() const { return faults_; }

 private:
  std::vector<ConfigFault> faults_;
};

// Closed range of a number; `exclusive_min` leaves the lower end out. Not-a-number and infinity are always
// refused.
struct Bounds {
  double min = -std::numeric_limits<double>::infinity();
  double max = std::numeric_limits<double>::infinity();
  bool exclusive_min = false;

  static Bounds any() { return {}; }
  static Bounds positive() { return {0.0, std::numeric_limits<double>::infinity(), true}; }
  static Bounds non_negative() { return {0.0, std::numeric_limits<double>::infinity(), false}; }
  static Bounds between(double min, double max) { return {min, max, false}; }

  bool contains(double value) const;
  std::string text() const;
};

class ConfigMap;

// One loaded file. Readers never throw: a broken rule is recorded and a harmless value returned, so that the
// reading goes on and finds the next one. check() throws ConfigError if anything was recorded or a key was
// never read.
class ConfigFile {
 public:
  explicit ConfigFile(const std::string& path);
  // The same for text that is not on disk; `name` stands for the path in messages.
  static ConfigFile from_text(const std::string& text, const std::string& name);

  ConfigMap root() const;
  const std::string& path() const;
  // A path written in the file, relative to the file's folder unless absolute.
  std::string resolve(const std::string& path) const;
  void check() const;

  struct Impl;

 private:
  ConfigFile() = default;
  std::shared_ptr<Impl> impl_;
};

// A mapping inside a ConfigFile, which must outlive it. A required reader reports a missing key; one with a
// fallback does not. A quoted number or flag is a text, not a number or flag.
class ConfigMap {
 public:
  bool has(const std::string& key) const;
  std::vector<std::string> keys() const;

  double number(const std::string& key, Bounds bounds = {}) const;
  double number(const std::string& key, Bounds bounds, double fallback) const;
  int integer(const std::string& key, int min, int max) const;
  int integer(const std::string& key, int min, int max, int fallback) const;
  bool flag(const std::string& key) const;
  bool flag(const std::string& key, bool fallback) const;
  std::string text(const std::string& key) const;
  std::string text(const std::string& key, const std::string& fallback) const;
  // A text that must be one of `allowed`, which is not empty.
  std::string choice(const std::string& key, const std::vector<std::string>& allowed) const;
  std::string choice(const std::string& key, const std::vector<std::string>& allowed,
                     const std::string& fallback) const;

  // A list of numbers, each within `bounds`; `size` < 0 leaves the length free.
  std::vector<double> numbers(const std::string& key, int size = -1, Bounds bounds = {}) const;
  std::vector<std::string> texts(const std::string& key) const;
  // A list of equally long rows of numbers.
  std::vector<std::vector<double>> rows(const std::string& key, Bounds bounds = {}) const;
  // The same out of the text file that `key` names, relative to this file: numbers separated by blanks, one
  // row a line, `#` starts a comment. Its faults name it and its lines.
  std::vector<std::vector<double>> rows_file(const std::string& key, Bounds bounds = {}) const;
  Eigen::Vector2d vector2(const std::string& key, Bounds bounds = {}) const;
  Eigen::Vector3d vector3(const std::string& key, Bounds bounds = {}) const;

  // A nested mapping. Reported when it is missing or is not a mapping, and so is every required key inside
  // it.
  ConfigMap map(const std::string& key) const;
  // The same, but absent is fine.
  std::optional<ConfigMap> optional_map(const std::string& key) const;
  // A list of mappings; an absent list is reported only when `required`.
  std::vector<ConfigMap> maps(const std::string& key, bool required = true) const;

  // Takes a key and all below it as read: for a part that belongs to someone else, or that a fault made
  // unreadable.
  void skip(const std::string& key) const;
  // Whether `key`, or something inside it, broke a rule, so that the value read is only a placeholder.
  bool faulty(const std::string& key) const;
  // Records a fault of a rule that spans several keys, at this mapping or at one of its keys. A key that is
  // already faulty gets no further fault: the rule would judge a placeholder.
  void fault(const std::string& rule) const;
  void fault(const std::string& key, const std::string& rule) const;

  struct Impl;
  explicit ConfigMap(std::shared_ptr<Impl> impl) : impl_(std::move(impl)) {}

 private:
  std::shared_ptr<Impl> impl_;
};

}  // namespace atmos
