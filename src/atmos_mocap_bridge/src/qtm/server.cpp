#include "atmos_mocap_bridge/qtm/server.h"

#include <algorithm>
#include <cctype>
#include <cstdlib>
#include <sstream>
#include <utility>
#include <vector>

namespace atmos::qtm {

namespace {

constexpr const char* kMasterOnly[] = {"releasecontrol", "new",  "close",         "start",        "stop",
                                       "load",           "save", "loadproject",   "setqtmevent",  "trig",
                                       "reprocess",      "led",  "getcapturec3d", "getcaptureqtm"};

std::vector<std::string> words_of(const std::string& text) {
  std::string lower = text;
  std::transform(lower.begin(), lower.end(), lower.begin(),
                 [](unsigned char c) { return static_cast<char>(std::tolower(c)); });
  std::istringstream stream(lower);
  std::vector<std::string> words;
  for (std::string word; stream >> word;) words.push_back(word);
  return words;
}

unsigned components_of(const std::vector<std::string>& words, std::size_t from) {
  unsigned components = 0;
  for (std::size_t i = from; i < words.size(); ++i) {
    if (words[i] == "6d" || words[i] == "all") components |= kComponent6d;
    if (words[i] == "6dres") components |= kComponent6dRes;
    if (words[i] == "6deuler") components |= kComponent6dEuler;
    if (words[i] == "6deulerres") components |= kComponent6dEulerRes;
  }
  return components;
}

}  // namespace

Server::Server(const ServerSettings& settings) : settings_(settings) { say("QTM RT Interface connected"); }

std::string Server::take_output() { return std::exchange(output_, {}); }
void Server::say(std::string_view text) { output_ += encode_text(PacketType::kCommand, text); }
void Server::complain(std::string_view text) { output_ += encode_text(PacketType::kError, text); }

bool Server::receive(const char* data, std::size_t size) {
  parser_.add(data, size);
  while (const auto packet = parser_.next()) {
    if (packet->type == PacketType::kCommand)
      answer(std::string(decode_text(packet->body)));
    else
      complain("Parse error");
  }
  return !parser_.broken();
}

void Server::answer(const std::string& command) {
  const std::vector<std::string> words = words_of(command);
  const std::string name = words.empty() ? "" : words[0];
  if (name == "version") {
    if (words.size() == 1) return say("Version is " + version_);
    int minor = -1;
    if (words[1].rfind("1.", 0) == 0) minor = std::atoi(words[1].c_str() + 2);
    if (minor < 1 || minor > settings_.newest_minor) return complain("Version NOT supported");
    version_ = "1." + std::to_string(minor);
    return say("Version set to " + version_);
  }
  if (name == "qtmversion") return say("QTM Version is 2024.1 (ATMOS emulator)");
  if (name == "byteorder") return say("Byte order is little endian");
  if (name == "getstate" || name == "getlastevent") {
    output_ += encode_event(state_);
    return;
  }
  if (name == "getparameters") {
    const bool six_d = std::any_of(words.begin() + 1, words.end(),
                                   [](const std::string& word) { return word == "6d" || word == "all"; });
    if (!six_d) return complain("Parameters not available");
    output_ += encode_text(PacketType::kXml, format_parameters(settings_.parameters, version_));
    return;
  }
  if (name == "getcurrentframe") {
    single_components_ = components_of(words, 1);
    if (single_components_ == 0) complain("Parse error");
    return;
  }
  if (name == "streamframes" && words.size() > 1) return stream(words[1], components_of(words, 2));
  if (name == "takecontrol") return say("Client control disabled in QTM");
  if (std::find(std::begin(kMasterOnly), std::end(kMasterOnly), name) != std::end(kMasterOnly))
    return complain("You must be master to issue this command");
  complain("Parse error");
}

void Server::stream(const std::string& rate, unsigned components) {
  if (rate == "stop") {
    streaming_ = false;
    return;
  }
  double divisor = 0.0;
  const auto number = [&rate] { return std::atof(rate.c_str() + rate.find(':') + 1); };
  if (rate == "allframes") divisor = 1.0;
  if (rate.rfind("frequencydivisor:", 0) == 0) divisor = number();
  if (rate.rfind("frequency:", 0) == 0 && number() > 0.0)
    divisor = std::max(1.0, settings_.parameters.frequency_hz.value_or(100.0) / number());
  if (!(divisor >= 1.0) || components == 0) return complain("Parse error");
  divisor_ = divisor;
  due_ = 1.0;
  components_ = components;
  streaming_ = true;
}

void Server::add(const Frame& frame) {
  if (single_components_ != 0) output_ += encode_frame(frame, std::exchange(single_components_, 0u));
  if (!streaming_) return;
  due_ -= 1.0;
  if (due_ > 0.0) return;
  due_ += divisor_;
  output_ += encode_frame(frame, components_);
}

void Server::add(Event event) {
  if (event != Event::kCameraSettingsChanged && event != Event::kShuttingDown &&
      event != Event::kCaptureSaved)
    state_ = event;
  output_ += encode_event(event);
}

}  // namespace atmos::qtm
