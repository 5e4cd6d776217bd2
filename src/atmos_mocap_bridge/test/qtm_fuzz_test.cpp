// Broken and malicious byte streams into the session, the server and the decoders: no crash, no hang, bounded
// memory. 20 000 inputs; ATMOS_LONG_TESTS=1: a million.
#include <gtest/gtest.h>

#include <cstdlib>
#include <random>

#include "qtm_link.h"

namespace atmos::qtm::test {
namespace {

constexpr std::size_t kMostMemory = 4 * PacketParser::kMostBytes;

class Fuzzer {
 public:
  explicit Fuzzer(unsigned seed) : random_(seed) {}

  std::size_t below(std::size_t end) {
    return std::uniform_int_distribution<std::size_t>(0, end - 1)(random_);
  }

  // A valid packet of either direction.
  std::string packet() {
    static const char* const kTexts[] = {"QTM RT Interface connected",
                                         "Version set to 1.28",
                                         "Version NOT supported",
                                         "Parameters not available",
                                         "GetParameters General 6D",
                                         "StreamFrames AllFrames 6DRes",
                                         "StreamFrames Frequency:1e300 6D",
                                         "Version 1.999999999999",
                                         "GetCurrentFrame All",
                                         ""};
    switch (below(6)) {
      case 0:
        return encode_text(below(2) == 0 ? PacketType::kCommand : PacketType::kError, kTexts[below(10)]);
      case 1:
        return encode_text(PacketType::kXml, format_parameters(two_bodies().parameters, "1.28"));
      case 2:
        return encode_event(static_cast<Event>(below(20)));
      case 3:
        return encode_no_more_data();
      default:
        return encode_frame(frame_of(below(4), static_cast<std::uint32_t>(below(1000)), below(1000000)),
                            static_cast<unsigned>(below(1 << 13)));
    }
  }

  // A few packets, cut, flipped, repeated or with noise between them.
  std::string stream() {
    std::string out;
    for (std::size_t i = 1 + below(4); i > 0; --i) out += packet();
    for (std::size_t i = below(5); i > 0 && !out.empty(); --i) {
      const std::size_t at = below(out.size());
      switch (below(5)) {
        case 0:
          out[at] = static_cast<char>(below(256));
          break;
        case 1:
          out[at] = static_cast<char>(out[at] ^ (1 << below(8)));
          break;
        case 2:
          out.erase(at, 1 + below(8));
          break;
        case 3:
          out.insert(at, std::string(1 + below(8), static_cast<char>(below(256))));
          break;
        default:
          out.resize(at);
      }
    }
    return out;
  }

  std::mt19937_64& random() { return random_; }

 private:
  std::mt19937_64 random_;
};

TEST(QtmFuzz, NoCrashNoHangBoundedMemory) {
  const int inputs = std::getenv("ATMOS_LONG_TESTS") != nullptr ? 1000000 : 20000;
  Fuzzer fuzzer(20240607);
  std::uint64_t delivered = 0, streaming = 0;
  std::size_t most_memory = 0;
  Session session({"atmos", 2.0, 8.0}, [&](const Frame&, const Body& body) {
    to_pose_frame(body, 0.0);
    ++delivered;
  });
  auto server = std::make_unique<Server>(two_bodies());
  double now = kStart;
  for (int i = 0; i < inputs; ++i) {
    now += 0.1;
    // A cut packet swallows all that follows: without new connections nothing else would be tried.
    if (session.wants_connection(now) || fuzzer.below(3) == 0) {
      session.closed(now);
      session.connected(now);
      // Half of the time the session is led as far as the stream.
      if (fuzzer.below(2) == 0) {
        for (const std::string& good :
             {encode_text(PacketType::kCommand, "QTM RT Interface connected"),
              encode_text(PacketType::kCommand, "Version set to 1.28"),
              encode_text(PacketType::kXml, format_parameters(two_bodies().parameters, "1.28"))})
          session.receive(good.data(), good.size(), now);
      }
    }
    const std::string stream = fuzzer.stream();
    bool alive = session.tick(now);
    for (std::size_t at = 0; alive && at < stream.size();) {
      const std::size_t size = std::min(stream.size() - at, 1 + fuzzer.below(200));
      alive = session.receive(stream.data() + at, size, now);
      at += size;
    }
    streaming += session.state() == Session::State::kStreaming ? 1 : 0;
    ASSERT_LT(session.take_output().size(), kMostMemory);
    most_memory = std::max(most_memory, session.memory());
    if (!alive) session.closed(now);

    if (!server->receive(stream.data(), stream.size())) server = std::make_unique<Server>(two_bodies());
    server->add(frame_of(2, 1, 1));
    ASSERT_LT(server->take_output().size(), kMostMemory);
    Frame frame;
    decode_frame(stream, frame);
    parse_parameters(stream);
  }
  EXPECT_LT(most_memory, kMostMemory);
  EXPECT_GT(delivered, 100u) << "the inputs never came as far as a pose";
  EXPECT_GT(streaming, static_cast<std::uint64_t>(inputs / 100));
  std::printf("%d inputs, %lu poses, %lu with a stream, at most %zu bytes held\n", inputs, delivered,
              streaming, most_memory);
}

}  // namespace
}  // namespace atmos::qtm::test
