// The 6D parameters of QTM: which body stands where in a frame.
#pragma once

#include <optional>
#include <string>
#include <string_view>
#include <vector>

namespace atmos::qtm {

struct BodyParameters {
  std::string name;
  bool enabled = true;  // protocol 1.20 and later may say no
};

struct Parameters {
  std::optional<double> frequency_hz;  // of the capture, where the answer has general parameters
  std::vector<BodyParameters> bodies;
};

// Reads the answer to `GetParameters General 6D`; nothing: not such an answer. Element names do not depend on
// the protocol's version, but their case does.
std::optional<Parameters> parse_parameters(std::string_view xml);

// Where `name` (case counts not) stands in a frame of `body_count` bodies; nothing: not there, or the
// parameters do not belong to such frames. QTM leaves disabled bodies out of its frames.
std::optional<std::size_t> index_of(const Parameters& parameters, const std::string& name,
                                    std::size_t body_count);

// The answer of a server with these parameters, for protocol `version` ("1.28").
std::string format_parameters(const Parameters& parameters, const std::string& version);

}  // namespace atmos::qtm
