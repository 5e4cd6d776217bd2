// Keys of a terminal as a joystick: axes forward, left, turn and one button, the dead man.
#pragma once

#include <limits>
#include <optional>
#include <vector>

namespace atmos {

struct StickReading {
  std::vector<double> axes;
  std::vector<int> buttons;
};

// A terminal says that a key repeats, not that it is held: a key counts for kKey_s, and the dead man, whom
// the space bar switches on, with it. He is switched off by the space bar, by any key without a meaning, and
// when no key has come for kArmed_s (the first repetition of a key comes half a second after it). Times in
// seconds.
class KeyboardStick {
 public:
  static constexpr double kKey_s = 0.25, kArmed_s = 2.0;

  void press(char key, double now_s);
  // The reading to publish; none while the dead man is off, after one that says so.
  std::optional<StickReading> reading(double now_s);
  bool armed(double now_s) const { return armed_ && now_s - key_s_ <= kArmed_s; }

 private:
  bool armed_ = false, told_off_ = true;
  double key_s_ = -std::numeric_limits<double>::infinity();
  double forward_ = 0.0, left_ = 0.0, turn_ = 0.0;
};

}  // namespace atmos
