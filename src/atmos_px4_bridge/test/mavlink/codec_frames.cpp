// Prints random frames of every message, in the format of golden_frames.txt, for cross_check/cross_check.js.
#include <cstdio>
#include <cstdlib>

#include "fields.h"

int main(int argc, char** argv) {
  using namespace atmos::mavlink;
  const int count = argc > 1 ? std::atoi(argv[1]) : 10;
  std::mt19937_64 random(20261122);
  u8 sequence = 0;
  for (int i = 0; i < count; ++i) {
    for_each_message([&](auto row) {
      using Message = decltype(row);
      const Message message = test::random_message<Message>(random);
      u8 frame[kMaxFrame];
      const std::size_t size = encode(message, {42, 191}, sequence, frame);
      std::printf("%u %u %s%s\n", Message::kId, sequence++, test::hex(frame, size).c_str(),
                  test::text_of(message).c_str());
    });
  }
  return 0;
}
