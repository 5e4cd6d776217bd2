// What the link costs: encoding and decoding the traffic of a flight, and the share of the line it takes.
#include <algorithm>
#include <chrono>
#include <cstdio>
#include <vector>

#include "../test/mavlink/fields.h"

namespace {

using namespace atmos::mavlink;

double seconds() {
  return std::chrono::duration<double>(std::chrono::steady_clock::now().time_since_epoch()).count();
}

// Encodes, parses and decodes messages of a flight in the proportion in which they are sent.
void codec_rate() {
  std::mt19937_64 random(1);
  const Odometry odometry = test::random_message<Odometry>(random);
  const SetAttitudeTarget target = test::random_message<SetAttitudeTarget>(random);
  const HighresImu imu = test::random_message<HighresImu>(random);
  const AttitudeQuaternion attitude = test::random_message<AttitudeQuaternion>(random);
  constexpr int kRounds = 100000, kRepeats = 9, kPerRound = 6;
  std::vector<double> rates;
  double sum = 0.0;
  for (int repeat = 0; repeat < kRepeats; ++repeat) {
    Parser parser;
    std::uint64_t frames = 0;
    const double begin = seconds();
    for (int i = 0; i < kRounds; ++i) {
      u8 bytes[kPerRound * kMaxFrame];
      std::size_t size = 0;
      u8 sequence = static_cast<u8>(i);
      const auto put = [&](const auto& message) {
        size += encode(message, {1, 1}, sequence++, bytes + size);
      };
      put(odometry), put(odometry), put(target), put(imu), put(attitude), put(attitude);
      parser.push(bytes, size);
      while (const auto frame = parser.next()) {
        ++frames;
        if (const auto m = decode<Odometry>(*frame)) sum += m->x;
        if (const auto m = decode<SetAttitudeTarget>(*frame)) sum += m->thrust;
        if (const auto m = decode<HighresImu>(*frame)) sum += m->zgyro;
        if (const auto m = decode<AttitudeQuaternion>(*frame)) sum += m->q1;
      }
    }
    rates.push_back(static_cast<double>(frames) / (seconds() - begin));
  }
  std::sort(rates.begin(), rates.end());
  std::fprintf(stderr, "bench_px4: checksum %g\n", sum);
  std::printf("{\"name\": \"px4/codec_messages_per_s\", \"unit\": \"1/s\", \"median\": %.6g, \"n\": %d}\n",
              rates[rates.size() / 2], kRounds * kPerRound);
}

}  // namespace

int main() {
  codec_rate();
  return 0;
}
