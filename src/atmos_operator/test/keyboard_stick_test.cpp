#include "atmos_operator/keyboard_stick.h"

#include <gtest/gtest.h>

namespace atmos {
namespace {

constexpr double kStart = 1234.5;

TEST(KeyboardStick, SaysNothingBeforeTheSpaceBar) {
  KeyboardStick stick;
  stick.press('w', kStart);
  EXPECT_FALSE(stick.armed(kStart));
  EXPECT_FALSE(stick.reading(kStart));
}

TEST(KeyboardStick, HoldsTheDeadManWhileAKeyRepeats) {
  KeyboardStick stick;
  stick.press(' ', kStart);
  // The space bar alone moves nothing, and lets the dead man be seen released.
  EXPECT_EQ(stick.reading(kStart)->buttons, std::vector<int>{0});
  for (double t = 0.1; t < 1.0; t += 0.03) {
    stick.press('w', kStart + t);
    const auto reading = stick.reading(kStart + t + 0.02);
    EXPECT_EQ(reading->buttons, std::vector<int>{1});
    EXPECT_EQ(reading->axes, (std::vector<double>{1.0, 0.0, 0.0}));
  }
  const auto later = stick.reading(kStart + 1.0 + KeyboardStick::kKey_s + 0.01);
  EXPECT_EQ(later->buttons, std::vector<int>{0});
  EXPECT_EQ(later->axes, (std::vector<double>{0.0, 0.0, 0.0}));
}

TEST(KeyboardStick, EveryKeyHasItsAxisAndSign) {
  const std::vector<std::pair<char, std::vector<double>>> keys = {{'w', {1, 0, 0}}, {'s', {-1, 0, 0}},
                                                                  {'a', {0, 1, 0}}, {'d', {0, -1, 0}},
                                                                  {'q', {0, 0, 1}}, {'e', {0, 0, -1}}};
  KeyboardStick stick;
  stick.press(' ', kStart);
  for (const auto& [key, axes] : keys) {
    stick.press(key, kStart + 0.1);
    EXPECT_EQ(stick.reading(kStart + 0.1)->axes, axes) << key;
  }
}

TEST(KeyboardStick, IsSwitchedOffBySpaceByAnotherKeyAndBySilence) {
  for (const char key : {' ', 'x', '\x1b'}) {
    KeyboardStick stick;
    stick.press(' ', kStart);
    stick.press('w', kStart + 0.1);
    EXPECT_EQ(stick.reading(kStart + 0.1)->buttons, std::vector<int>{1});
    stick.press(key, kStart + 0.2);
    EXPECT_EQ(stick.reading(kStart + 0.2)->buttons, std::vector<int>{0});
    EXPECT_FALSE(stick.reading(kStart + 0.3)) << "says once that it is off";
    stick.press('w', kStart + 0.4);
    EXPECT_FALSE(stick.reading(kStart + 0.4));
  }
  KeyboardStick stick;
  stick.press(' ', kStart);
  EXPECT_TRUE(stick.armed(kStart + KeyboardStick::kArmed_s));
  EXPECT_FALSE(stick.armed(kStart + KeyboardStick::kArmed_s + 0.01));
  stick.press('w', kStart + 3.0);
  EXPECT_FALSE(stick.armed(kStart + 3.0)) << "a key does not switch it on again";
}

}  // namespace
}  // namespace atmos
