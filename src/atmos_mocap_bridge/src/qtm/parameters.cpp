#include "atmos_mocap_bridge/qtm/parameters.h"

#include <strings.h>
#include <tinyxml2.h>

#include <algorithm>

namespace atmos::qtm {

namespace {

using tinyxml2::XMLElement;

bool same(const char* a, const char* b) { return strcasecmp(a, b) == 0; }

const XMLElement* child(const XMLElement& parent, const char* name) {
  for (const XMLElement* element = parent.FirstChildElement(); element != nullptr;
       element = element->NextSiblingElement()) {
    if (same(element->Name(), name)) return element;
  }
  return nullptr;
}

std::string trimmed(const char* text) {
  const std::string all = text == nullptr ? "" : text;
  const auto first = all.find_first_not_of(" \t\r\n");
  if (first == std::string::npos) return "";
  return all.substr(first, all.find_last_not_of(" \t\r\n") - first + 1);
}

void add(tinyxml2::XMLPrinter& printer, const char* name, const std::string& text) {
  printer.OpenElement(name);
  printer.PushText(text.c_str());
  printer.CloseElement();
}

}  // namespace

std::optional<Parameters> parse_parameters(std::string_view xml) {
  tinyxml2::XMLDocument document;
  if (document.Parse(xml.data(), xml.size()) != tinyxml2::XML_SUCCESS) return std::nullopt;
  const XMLElement* const root = document.RootElement();
  constexpr std::string_view kRoot = "QTM_Parameters";
  if (root == nullptr || strncasecmp(root->Name(), kRoot.data(), kRoot.size()) != 0) return std::nullopt;

  Parameters parameters;
  if (const XMLElement* const general = child(*root, "General")) {
    const XMLElement* const frequency = child(*general, "Frequency");
    double value = 0.0;
    if (frequency != nullptr && frequency->QueryDoubleText(&value) == tinyxml2::XML_SUCCESS)
      parameters.frequency_hz = value;
  }
  const XMLElement* const six_d = child(*root, "The_6D");
  if (six_d == nullptr) return std::nullopt;
  for (const XMLElement* body = six_d->FirstChildElement(); body != nullptr;
       body = body->NextSiblingElement()) {
    if (!same(body->Name(), "Body")) continue;
    BodyParameters entry;
    if (const XMLElement* const name = child(*body, "Name")) entry.name = trimmed(name->GetText());
    if (const XMLElement* const enabled = child(*body, "Enabled"))
      entry.enabled = !same(trimmed(enabled->GetText()).c_str(), "false");
    parameters.bodies.push_back(entry);
  }
  return parameters;
}

std::optional<std::size_t> index_of(const Parameters& parameters, const std::string& name,
                                    std::size_t body_count) {
  const auto enabled =
      static_cast<std::size_t>(std::count_if(parameters.bodies.begin(), parameters.bodies.end(),
                                             [](const BodyParameters& body) { return body.enabled; }));
  const bool all = body_count == parameters.bodies.size();
  if (!all && body_count != enabled) return std::nullopt;
  std::size_t index = 0;
  for (const BodyParameters& body : parameters.bodies) {
    if (!all && !body.enabled) continue;
    if (same(body.name.c_str(), name.c_str())) return index;
    ++index;
  }
  return std::nullopt;
}

std::string format_parameters(const Parameters& parameters, const std::string& version) {
  tinyxml2::XMLPrinter printer(nullptr, true);
  const std::string root = "QTM_Parameters_Ver_" + version;  // the printer keeps the pointer only
  printer.OpenElement(root.c_str());
  if (parameters.frequency_hz) {
    printer.OpenElement("General");
    add(printer, "Frequency", std::to_string(static_cast<int>(*parameters.frequency_hz)));
    printer.CloseElement();
  }
  printer.OpenElement("The_6D");
  add(printer, "Bodies", std::to_string(parameters.bodies.size()));
  for (const BodyParameters& body : parameters.bodies) {
    printer.OpenElement("Body");
    add(printer, "Name", body.name);
    add(printer, "Enabled", body.enabled ? "true" : "false");
    printer.CloseElement();
  }
  printer.CloseElement();
  printer.CloseElement();
  return printer.CStr();
}

}  // namespace atmos::qtm
