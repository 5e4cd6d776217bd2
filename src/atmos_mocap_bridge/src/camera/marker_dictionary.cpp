#include "marker_dictionary.h"

#include <stdexcept>
#include <utility>
#include <vector>

#include "atmos_mocap_bridge/camera/marker_detector.h"

namespace atmos {

namespace {

const std::pair<const char*, cv::aruco::PREDEFINED_DICTIONARY_NAME> kDictionaries[] = {
    {"4X4_50", cv::aruco::DICT_4X4_50},
    {"4X4_100", cv::aruco::DICT_4X4_100},
    {"4X4_250", cv::aruco::DICT_4X4_250},
    {"5X5_50", cv::aruco::DICT_5X5_50},
    {"5X5_100", cv::aruco::DICT_5X5_100},
    {"5X5_250", cv::aruco::DICT_5X5_250},
    {"6X6_50", cv::aruco::DICT_6X6_50},
    {"6X6_100", cv::aruco::DICT_6X6_100},
    {"6X6_250", cv::aruco::DICT_6X6_250},
    {"ARUCO_ORIGINAL", cv::aruco::DICT_ARUCO_ORIGINAL},
    {"APRILTAG_36h11", cv::aruco::DICT_APRILTAG_36h11}};

}  // namespace

cv::Ptr<cv::aruco::Dictionary> marker_dictionary(const std::string& name) {
  for (const auto& [known, code] : kDictionaries) {
    if (name == known) return cv::aruco::getPredefinedDictionary(code);
  }
  throw std::invalid_argument("no marker dictionary is called " + name);
}

std::vector<std::string> marker_dictionaries() {
  std::vector<std::string> names;
  for (const auto& [name, code] : kDictionaries) names.emplace_back(name);
  return names;
}

}  // namespace atmos
