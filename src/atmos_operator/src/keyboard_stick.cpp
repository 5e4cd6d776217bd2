#include "atmos_operator/keyboard_stick.h"

namespace atmos {

void KeyboardStick::press(char key, double now_s) {
  const bool was_armed = armed(now_s);
  key_s_ = now_s;
  forward_ = left_ = turn_ = 0.0;
  armed_ = was_armed;
  switch (key) {
    case ' ':
      armed_ = !was_armed;
      break;
    case 'w':
      forward_ = 1.0;
      break;
    case 's':
      forward_ = -1.0;
      break;
    case 'a':
      left_ = 1.0;
      break;
    case 'd':
      left_ = -1.0;
      break;
    case 'q':
      turn_ = 1.0;
      break;
    case 'e':
      turn_ = -1.0;
      break;
    default:
      armed_ = false;
  }
}

std::optional<StickReading> KeyboardStick::reading(double now_s) {
  const bool on = armed(now_s), moves = forward_ != 0.0 || left_ != 0.0 || turn_ != 0.0;
  if (!on && told_off_) return std::nullopt;
  told_off_ = !on;
  if (on && moves && now_s - key_s_ <= kKey_s) return StickReading{{forward_, left_, turn_}, {1}};
  return StickReading{{0.0, 0.0, 0.0}, {0}};
}

}  // namespace atmos
