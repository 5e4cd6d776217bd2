// The session against a server, in simulated time: the way to the stream, and everything that can go wrong on
// it.
#include "atmos_mocap_bridge/qtm/session.h"

#include <gtest/gtest.h>

#include "qtm_link.h"

namespace atmos::qtm::test {
namespace {

using State = Session::State;

TEST(QtmSession, FromTheWelcomeToThePoses) {
  for (const std::size_t chunk : {std::size_t{1}, std::size_t{1} << 16}) {
    Link link(two_bodies());
    link.chunk = chunk;
    EXPECT_TRUE(link.session.wants_connection(link.now));
    link.connect();
    EXPECT_EQ(link.session.state(), State::kStreaming);
    EXPECT_EQ(link.session.version(), "1.28");
    EXPECT_EQ(link.session.parameters().frequency_hz, 100.0);
    EXPECT_TRUE(link.server->streaming());
    for (std::uint32_t k = 0; k < 10; ++k) {
      link.server->add(frame_of(2, k, 10000 * k));
      link.talk();
    }
    ASSERT_EQ(link.received.size(), 10u);
    EXPECT_NEAR(link.received[9].pose.p_WB.x(), 1.0, 1e-6) << "the second body is ours";
    EXPECT_NEAR(link.received[9].pose.p_WB.y(), 0.09, 1e-6);
    EXPECT_NEAR(link.received[9].pose.stamp_s, 0.09, 1e-12);
    EXPECT_TRUE(link.session.body_known());
    EXPECT_EQ(link.session.counters().skipped, 0u);
  }
}

TEST(QtmSession, TakesTheNewestVersionTheServerKnows) {
  for (int minor = kOldestMinor; minor <= kNewestMinor; ++minor) {
    ServerSettings settings = two_bodies();
    settings.newest_minor = minor;
    Link link(settings);
    link.connect();
    EXPECT_EQ(link.session.state(), State::kStreaming);
    EXPECT_EQ(link.session.version(), "1." + std::to_string(minor));
  }
}

TEST(QtmSession, AServerThatIsTooOldIsLeftAlone) {
  ServerSettings settings = two_bodies();
  settings.newest_minor = 17;
  Link link(settings);
  link.connect();
  EXPECT_EQ(link.session.state(), State::kOffline);
  EXPECT_NE(link.session.last_problem().find("version"), std::string::npos);
  EXPECT_FALSE(link.session.wants_connection(link.now)) << "not at once again";
}

TEST(QtmSession, WhoeverElseListensThereIsNoQtm) {
  Link link(two_bodies());
  link.session.connected(link.now);
  const std::string hello = encode_text(PacketType::kCommand, "SSH-2.0");
  EXPECT_FALSE(link.session.receive(hello.data(), hello.size(), link.now));
  link.session.closed(link.now);
  link.session.connected(link.now);
  EXPECT_FALSE(link.session.receive("SSH-2.0-OpenSSH\r\n", 17, link.now));
  EXPECT_EQ(link.session.counters().hang_ups, 2u);
  EXPECT_EQ(link.session.last_problem(), "the server sent what is no packet");
}

TEST(QtmSession, TooManyClients) {
  Link link(two_bodies());
  link.session.connected(link.now);
  const std::string refusal =
      encode_text(PacketType::kError, "Connection refused. Max number of clients reached.");
  EXPECT_FALSE(link.session.receive(refusal.data(), refusal.size(), link.now));
  EXPECT_NE(link.session.last_problem().find("Max number"), std::string::npos);
}

TEST(QtmSession, UnseenBodiesAreDelivered) {
  Link link(two_bodies());
  link.connect();
  Frame frame = frame_of(2, 1, 10000);
  frame.bodies[1].position_mm.fill(std::numeric_limits<float>::quiet_NaN());
  frame.bodies[1].rotation.fill(std::numeric_limits<float>::quiet_NaN());
  link.server->add(frame);
  link.talk();
  ASSERT_EQ(link.received.size(), 1u);
  EXPECT_FALSE(link.received[0].pose.p_WB.allFinite());
  EXPECT_EQ(link.session.counters().unseen, 1u);
}

TEST(QtmSession, ABodyThatQtmDoesNotKnowIsAskedForAgainAndFound) {
  ServerSettings settings = two_bodies();
  settings.parameters.bodies.pop_back();
  Link link(settings);
  link.connect();
  EXPECT_EQ(link.session.state(), State::kStreaming);
  link.server->add(frame_of(1, 0, 0));
  link.talk();
  EXPECT_FALSE(link.session.body_known());
  EXPECT_EQ(link.session.counters().without_body, 1u);
  // Somebody adds it in QTM while we stream.
  const std::string xml = encode_text(PacketType::kXml, format_parameters(two_bodies().parameters, "1.28"));
  ASSERT_TRUE(link.session.receive(xml.data(), xml.size(), link.now));
  link.server->add(frame_of(2, 1, 10000));
  link.talk();
  EXPECT_TRUE(link.session.body_known());
  EXPECT_EQ(link.received.size(), 1u);
}

TEST(QtmSession, FramesThatDoNotFitTheParametersMakeItAskAgainButNotAtEveryFrame) {
  Link link(two_bodies());
  link.connect();
  for (std::uint32_t k = 0; k < 300; ++k) {
    link.now += 0.01;
    const std::string data = encode_frame(frame_of(3, k, 10000 * k), kComponent6dRes);
    ASSERT_TRUE(link.session.receive(data.data(), data.size(), link.now));
  }
  EXPECT_TRUE(link.received.empty());
  const std::string asked = link.session.take_output();
  std::size_t count = 0;
  for (std::size_t at = 0; (at = asked.find("GetParameters", at)) != std::string::npos; ++at) ++count;
  EXPECT_GE(count, 2u);
  EXPECT_LE(count, 3u);
}

TEST(QtmSession, ParametersThatAreNotThereYetAreAskedForAgain) {
  Link link(two_bodies());
  link.session.connected(link.now);
  const auto hear = [&](const std::string& packet) {
    return link.session.receive(packet.data(), packet.size(), link.now);
  };
  ASSERT_TRUE(hear(encode_text(PacketType::kCommand, "QTM RT Interface connected")));
  ASSERT_TRUE(hear(encode_text(PacketType::kCommand, "Version set to 1.28")));
  link.session.take_output();
  ASSERT_TRUE(hear(encode_text(PacketType::kError, "Parameters not available")));
  EXPECT_EQ(link.session.state(), State::kParameters);
  link.now += 0.5;
  EXPECT_TRUE(link.session.tick(link.now));
  EXPECT_EQ(link.session.take_output(), "");
  link.now += 0.6;
  EXPECT_TRUE(link.session.tick(link.now));
  EXPECT_NE(link.session.take_output().find("GetParameters"), std::string::npos);
  ASSERT_TRUE(hear(encode_text(PacketType::kXml, format_parameters(two_bodies().parameters, "1.28"))));
  EXPECT_EQ(link.session.state(), State::kStreaming);
}

TEST(QtmSession, ASilentServerIsAskedAndThenGivenUp) {
  Link link(two_bodies());
  link.connect();
  link.now += 1.9;
  EXPECT_TRUE(link.session.tick(link.now));
  EXPECT_EQ(link.session.take_output(), "");
  link.now += 0.2;
  EXPECT_TRUE(link.session.tick(link.now));
  EXPECT_NE(link.session.take_output().find("GetState"), std::string::npos);
  link.now += 2.1;
  EXPECT_FALSE(link.session.tick(link.now));
  link.disconnect();
  EXPECT_EQ(link.session.last_problem(), "the server is silent");
}

TEST(QtmSession, WithoutAMeasurementTheConnectionIsKept) {
  Link link(two_bodies());
  link.connect();
  for (int k = 0; k < 1000; ++k) {
    link.now += 0.1;
    link.step();
  }
  EXPECT_EQ(link.session.counters().connections, 1u);
  EXPECT_EQ(link.session.state(), State::kStreaming);
}

TEST(QtmSession, HangsUpWhenQtmShutsDownAndComesBackLater) {
  Link link(two_bodies());
  link.connect();
  link.server->add(Event::kShuttingDown);
  link.talk();
  EXPECT_EQ(link.session.state(), State::kOffline);
  EXPECT_EQ(link.session.last_problem(), "QTM shuts down");
  link.now += 0.6;
  link.step();
  EXPECT_EQ(link.session.state(), State::kStreaming);
  EXPECT_EQ(link.session.counters().connections, 2u);
}

TEST(QtmSession, OtherEventsChangeNothingOrAskForTheParametersAgain) {
  for (int code = 1; code <= 16; ++code) {
    const auto event = static_cast<Event>(code);
    if (event == Event::kShuttingDown) continue;
    Link link(two_bodies());
    link.connect();
    link.server->add(event);
    link.talk();
    EXPECT_EQ(link.session.state(), State::kStreaming) << code;
    link.server->add(frame_of(2, 0, 0));
    link.talk();
    EXPECT_EQ(link.received.size(), 1u) << code;
  }
}

TEST(QtmSession, AServerThatGoesAwayInTheMiddleOfAPacket) {
  Link link(two_bodies());
  link.connect();
  const std::string data = encode_frame(frame_of(2, 5, 50000), kComponent6dRes);
  ASSERT_TRUE(link.session.receive(data.data(), data.size() / 2, link.now));
  link.disconnect();
  link.now += 0.6;
  link.step();
  ASSERT_EQ(link.session.state(), State::kStreaming) << "half a packet of the old connection is forgotten";
  link.server->add(frame_of(2, 0, 0));
  link.talk();
  EXPECT_EQ(link.received.size(), 1u);
  EXPECT_EQ(link.session.counters().malformed, 0u);
}

TEST(QtmSession, TheAttemptsToConnectGrowRareAndFramesMakeThemFrequentAgain) {
  Link link(two_bodies());
  std::vector<double> attempts;
  for (int k = 0; k < 4000; ++k, link.now += 0.01) {
    if (!link.session.wants_connection(link.now)) continue;
    attempts.push_back(link.now - kStart);
    link.session.connection_failed(link.now);
  }
  ASSERT_GE(attempts.size(), 7u);
  const double expected[] = {0.0, 0.5, 1.5, 3.5, 7.5, 15.5, 23.5};
  for (std::size_t i = 0; i < std::size(expected); ++i) EXPECT_NEAR(attempts[i], expected[i], 0.1);
  link.now += 10.0;
  link.connect();
  link.server->add(frame_of(2, 0, 0));
  link.talk();
  link.disconnect();
  link.now += 0.51;
  EXPECT_TRUE(link.session.wants_connection(link.now));
}

TEST(QtmSession, MalformedDataIsCountedAndTheNextFrameTaken) {
  Link link(two_bodies());
  link.connect();
  std::string data = encode_frame(frame_of(2, 0, 0), kComponent6dRes);
  data[32] = 9;  // body count
  ASSERT_TRUE(link.session.receive(data.data(), data.size(), link.now));
  EXPECT_EQ(link.session.counters().malformed, 1u);
  link.server->add(frame_of(2, 4, 40000));
  link.talk();
  EXPECT_EQ(link.received.size(), 1u);
}

TEST(QtmSession, SkippedFramesAreCounted) {
  Link link(two_bodies());
  link.connect();
  for (const std::uint32_t number : {10u, 11u, 14u, 15u}) link.server->add(frame_of(2, number, number));
  link.talk();
  EXPECT_EQ(link.received.size(), 4u);
  EXPECT_EQ(link.session.counters().skipped, 2u);
}

TEST(QtmServer, AnswersAnyClient) {
  Server server(two_bodies());
  const auto ask = [&](const std::string& command) {
    server.take_output();
    const std::string packet = encode_text(PacketType::kCommand, command);
    EXPECT_TRUE(server.receive(packet.data(), packet.size()));
    return server.take_output();
  };
  EXPECT_EQ(server.take_output(), encode_text(PacketType::kCommand, "QTM RT Interface connected"));
  EXPECT_EQ(ask("Version"), encode_text(PacketType::kCommand, "Version is 1.1"));
  EXPECT_EQ(ask("version 1.20"), encode_text(PacketType::kCommand, "Version set to 1.20"));
  EXPECT_EQ(ask("Version 1.29"), encode_text(PacketType::kError, "Version NOT supported"));
  EXPECT_EQ(ask("Version x"), encode_text(PacketType::kError, "Version NOT supported"));
  EXPECT_EQ(ask("ByteOrder"), encode_text(PacketType::kCommand, "Byte order is little endian"));
  EXPECT_EQ(ask("GetState"), encode_event(Event::kRtFromFileStarted));
  EXPECT_NE(ask("GetParameters 6D").find("<Name>atmos</Name>"), std::string::npos);
  EXPECT_EQ(ask("GetParameters Skeleton"), encode_text(PacketType::kError, "Parameters not available"));
  EXPECT_EQ(ask("Start"), encode_text(PacketType::kError, "You must be master to issue this command"));
  for (const char* nonsense :
       {"", "Dance", "StreamFrames", "StreamFrames AllFrames", "StreamFrames AllFrames 3D",
        "StreamFrames Frequency:0 6D", "StreamFrames FrequencyDivisor:-1 6D"})
    EXPECT_EQ(ask(nonsense), encode_text(PacketType::kError, "Parse error")) << nonsense;
  EXPECT_FALSE(server.streaming());
}

TEST(QtmServer, StreamsAtTheRateAskedFor) {
  const auto frames_at = [](const std::string& rate) {
    Server server(two_bodies());
    server.take_output();
    const std::string packet = encode_text(PacketType::kCommand, "StreamFrames " + rate + " 6D");
    server.receive(packet.data(), packet.size());
    int frames = 0;
    for (std::uint32_t k = 0; k < 1000; ++k) {
      server.add(frame_of(2, k, 10000 * k));
      frames += server.take_output().empty() ? 0 : 1;
    }
    return frames;
  };
  EXPECT_EQ(frames_at("AllFrames"), 1000);
  EXPECT_EQ(frames_at("FrequencyDivisor:4"), 250);
  EXPECT_NEAR(frames_at("Frequency:30"), 300, 1);
  EXPECT_EQ(frames_at("Frequency:500"), 1000);
  EXPECT_EQ(frames_at("Stop"), 0);
}

TEST(QtmServer, OneFrameOnRequest) {
  Server server(two_bodies());
  server.take_output();
  const std::string packet = encode_text(PacketType::kCommand, "GetCurrentFrame 6D 6DEuler");
  server.receive(packet.data(), packet.size());
  server.add(frame_of(2, 3, 30000));
  Frame frame;
  const std::string answer = server.take_output();
  ASSERT_TRUE(decode_frame(std::string_view(answer).substr(8), frame));
  EXPECT_EQ(frame.number, 3u);
  server.add(frame_of(2, 4, 40000));
  EXPECT_EQ(server.take_output(), "");
}

}  // namespace
}  // namespace atmos::qtm::test
