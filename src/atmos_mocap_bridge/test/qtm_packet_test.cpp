// Packets of the QTM protocol byte by byte: the bytes are written down from the protocol's documentation, not
// by our encoder.
#include "atmos_mocap_bridge/qtm/packet.h"

#include <gtest/gtest.h>

#include <cmath>
#include <cstring>

#include "atmos_mocap_bridge/qtm/parameters.h"
#include "atmos_mocap_bridge/qtm/pose.h"

namespace atmos::qtm {
namespace {

std::string bytes(std::initializer_list<int> values) {
  std::string out;
  for (const int value : values) out += static_cast<char>(value);
  return out;
}

// 1.0f is 00 00 80 3f, -1.0f is 00 00 80 bf, 100.0f is 00 00 c8 42, 2000.0f is 00 00 fa 44.
const std::string kOne = bytes({0, 0, 0x80, 0x3f}), kMinusOne = bytes({0, 0, 0x80, 0xbf}),
                  kZero = bytes({0, 0, 0, 0}), kHundred = bytes({0, 0, 0xc8, 0x42}),
                  kTwoThousand = bytes({0, 0, 0xfa, 0x44}), kNan = bytes({0, 0, 0xc0, 0x7f}),
                  kHalf = bytes({0, 0, 0, 0x3f});
// Yaw 90 degrees, column by column: (0, 1, 0), (-1, 0, 0), (0, 0, 1).
const std::string kTurned = kZero + kOne + kZero + kMinusOne + kZero + kZero + kZero + kZero + kOne;
const std::string kUnseen = kNan + kNan + kNan + kNan + kNan + kNan + kNan + kNan + kNan + kNan + kNan + kNan;

const std::string kError = bytes({20, 0, 0, 0, 0, 0, 0, 0}) + std::string("Parse error\0", 12);
const std::string kCommand = bytes({28, 0, 0, 0, 1, 0, 0, 0}) + std::string("Version set to 1.18\0", 20);
const std::string kXmlText =
    "<QTM_Parameters_Ver_1.18><The_6D><Bodies>2</Bodies><Body><Name>wall</Name></Body><Body><Name> atmos "
    "</Name></Body></The_6D></QTM_Parameters_Ver_1.18>";
const std::string kXml =
    bytes({static_cast<int>(kXmlText.size()) + 9, 0, 0, 0, 2, 0, 0, 0}) + kXmlText + bytes({0});
const std::string kNoMoreData = bytes({8, 0, 0, 0, 4, 0, 0, 0});
const std::string kC3d = bytes({11, 0, 0, 0, 5, 0, 0, 0, 1, 2, 3});
const std::string kEvent = bytes({9, 0, 0, 0, 6, 0, 0, 0, 12});
const std::string kDiscover = bytes({10, 0, 0, 0, 7, 0, 0, 0, 0x56, 0xd2});
const std::string kQtm = bytes({12, 0, 0, 0, 8, 0, 0, 0, 9, 9, 9, 9});
// Time stamp 1 000 010 000 us, frame 7, one 6D component of two bodies, drop rate 3, out-of-sync rate 5.
const std::string kFrameHeader = bytes({0x10, 0xf1, 0x9a, 0x3b, 0, 0, 0, 0, 7, 0, 0, 0});
const std::string kBodies = bytes({2, 0, 0, 0, 3, 0, 5, 0});
const std::string k6d = bytes({136, 0, 0, 0, 3, 0, 0, 0}) + kFrameHeader + bytes({1, 0, 0, 0}) +
                        bytes({112, 0, 0, 0, 5, 0, 0, 0}) + kBodies + kUnseen + kHundred + kTwoThousand +
                        kZero + kTurned;
const std::string k6dRes = bytes({144, 0, 0, 0, 3, 0, 0, 0}) + kFrameHeader + bytes({1, 0, 0, 0}) +
                           bytes({120, 0, 0, 0, 11, 0, 0, 0}) + kBodies + kUnseen + kNan + kHundred +
                           kTwoThousand + kZero + kTurned + kHalf;
// A component nobody asked for (3D, one marker) before 6DEuler of one body and 6D of one.
const std::string kMixed = bytes({172, 0, 0, 0, 3, 0, 0, 0}) + kFrameHeader + bytes({3, 0, 0, 0}) +
                           bytes({28, 0, 0, 0, 1, 0, 0, 0, 1, 0, 0, 0, 0, 0, 0, 0}) + kOne + kOne + kOne +
                           bytes({40, 0, 0, 0, 6, 0, 0, 0, 1, 0, 0, 0, 0, 0, 0, 0}) + kOne + kOne + kOne +
                           kOne + kOne + kOne + bytes({64, 0, 0, 0, 5, 0, 0, 0, 1, 0, 0, 0, 0, 0, 0, 0}) +
                           kHundred + kTwoThousand + kZero + kTurned + bytes({16, 0, 0, 0, 3, 0, 0, 0}) +
                           bytes({0, 0, 0, 0, 0, 0, 0, 0});

const std::string kStream[] = {kError, kCommand, kXml,      k6d,  k6dRes,
                               kC3d,   kEvent,   kDiscover, kQtm, kNoMoreData};
const PacketType kTypes[] = {PacketType::kError,     PacketType::kCommand,  PacketType::kXml,
                             PacketType::kData,      PacketType::kData,     PacketType::kC3dFile,
                             PacketType::kEvent,     PacketType::kDiscover, PacketType::kQtmFile,
                             PacketType::kNoMoreData};

void expect_second_body(const std::string& packet, bool with_residual) {
  PacketParser parser;
  parser.add(packet.data(), packet.size());
  const auto one = parser.next();
  ASSERT_TRUE(one);
  Frame frame;
  ASSERT_TRUE(decode_frame(one->body, frame));
  EXPECT_EQ(frame.timestamp_us, 1000010000u);
  EXPECT_EQ(frame.number, 7u);
  EXPECT_EQ(frame.drop_rate, 3u);
  EXPECT_EQ(frame.out_of_sync_rate, 5u);
  ASSERT_EQ(frame.bodies.size(), 2u);
  EXPECT_FALSE(to_pose_frame(frame.bodies[0], 1.0).p_WB.allFinite()) << "not seen";
  const PoseFrame pose = to_pose_frame(frame.bodies[1], 1.0);
  EXPECT_TRUE(pose.p_WB.isApprox(Eigen::Vector3d(0.1, 2.0, 0.0), 1e-12));
  EXPECT_LT(
      pose.q_WB.angularDistance(Eigen::Quaterniond(Eigen::AngleAxisd(M_PI / 2.0, Eigen::Vector3d::UnitZ()))),
      1e-7)
      << "columns, not rows";
  if (with_residual)
    EXPECT_EQ(frame.bodies[1].residual_mm, 0.5f);
  else
    EXPECT_TRUE(std::isnan(frame.bodies[1].residual_mm));
}

TEST(QtmPacket, EveryTypeInOnePiece) {
  std::string all;
  for (const std::string& packet : kStream) all += packet;
  PacketParser parser;
  parser.add(all.data(), all.size());
  for (std::size_t i = 0; i < std::size(kStream); ++i) {
    const auto packet = parser.next();
    ASSERT_TRUE(packet) << i;
    EXPECT_EQ(packet->type, kTypes[i]);
    EXPECT_EQ(packet->body, std::string_view(kStream[i]).substr(8));
  }
  EXPECT_FALSE(parser.next());
  EXPECT_FALSE(parser.broken());
}

TEST(QtmPacket, EveryTypeOneByteAtATime) {
  PacketParser parser;
  for (std::size_t i = 0; i < std::size(kStream); ++i) {
    for (std::size_t k = 0; k < kStream[i].size(); ++k) {
      ASSERT_FALSE(parser.next());
      parser.add(&kStream[i][k], 1);
    }
    const auto packet = parser.next();
    ASSERT_TRUE(packet) << i;
    EXPECT_EQ(packet->type, kTypes[i]);
    EXPECT_EQ(packet->body, std::string_view(kStream[i]).substr(8));
  }
}

TEST(QtmPacket, EveryCutBetweenTwoPackets) {
  const std::string two = k6dRes + kEvent;
  for (std::size_t cut = 0; cut <= two.size(); ++cut) {
    PacketParser parser;
    parser.add(two.data(), cut);
    int packets = 0;
    while (parser.next()) ++packets;
    parser.add(two.data() + cut, two.size() - cut);
    while (parser.next()) ++packets;
    EXPECT_EQ(packets, 2) << cut;
  }
}

TEST(QtmPacket, TextsEndAtTheirZero) {
  EXPECT_EQ(decode_text(std::string_view(kError).substr(8)), "Parse error");
  EXPECT_EQ(decode_text(std::string_view(kCommand).substr(8)), "Version set to 1.18");
  EXPECT_EQ(decode_text("no zero"), "no zero");
  EXPECT_EQ(decode_text(""), "");
}

TEST(QtmPacket, Events) {
  EXPECT_EQ(decode_event(std::string_view(kEvent).substr(8)), Event::kShuttingDown);
  EXPECT_FALSE(decode_event(""));
  EXPECT_FALSE(decode_event(std::string_view("\0", 1)));
  EXPECT_FALSE(decode_event("\x7f"));
}

TEST(QtmPacket, BodiesOf6d) { expect_second_body(k6d, false); }
TEST(QtmPacket, BodiesOf6dRes) { expect_second_body(k6dRes, true); }

TEST(QtmPacket, OtherComponentsArePassedOver) {
  Frame frame;
  // Three components are announced and a fourth follows: malformed.
  EXPECT_FALSE(decode_frame(std::string_view(kMixed).substr(8), frame));
  const std::string three = kMixed.substr(8, kMixed.size() - 24);
  ASSERT_TRUE(decode_frame(three, frame));
  ASSERT_TRUE(frame.has_bodies);
  ASSERT_EQ(frame.bodies.size(), 1u);
  EXPECT_EQ(frame.bodies[0].position_mm[1], 2000.0f);
}

TEST(QtmPacket, CutOrInconsistentDataIsMalformed) {
  Frame frame;
  const std::string body = k6dRes.substr(8);
  for (std::size_t size = 0; size < body.size(); ++size)
    EXPECT_FALSE(decode_frame(std::string_view(body).substr(0, size), frame)) << size;
  std::string more_bodies = body;
  more_bodies[24] = 3;
  EXPECT_FALSE(decode_frame(more_bodies, frame));
  std::string most_bodies = body;
  std::memset(&most_bodies[24], 0xff, 4);
  EXPECT_FALSE(decode_frame(most_bodies, frame));
  std::string no_size = body;
  std::memset(&no_size[16], 0, 4);
  EXPECT_FALSE(decode_frame(no_size, frame));
}

TEST(QtmPacket, ImpossibleSizesBreakTheStream) {
  for (const std::string& header : {bytes({7, 0, 0, 0, 1, 0, 0, 0}), bytes({0, 0, 0, 0, 3, 0, 0, 0}),
                                    bytes({0xff, 0xff, 0xff, 0x7f, 3, 0, 0, 0})}) {
    PacketParser parser;
    parser.add(header.data(), header.size());
    EXPECT_FALSE(parser.next());
    EXPECT_TRUE(parser.broken());
    parser.add(kEvent.data(), kEvent.size());
    EXPECT_FALSE(parser.next()) << "a broken stream stays broken";
  }
}

TEST(QtmPacket, TheEncoderWritesTheSameBytes) {
  EXPECT_EQ(encode_text(PacketType::kError, "Parse error"), kError);
  EXPECT_EQ(encode_text(PacketType::kCommand, "Version set to 1.18"), kCommand);
  EXPECT_EQ(encode_event(Event::kShuttingDown), kEvent);
  EXPECT_EQ(encode_no_more_data(), kNoMoreData);
  Frame frame;
  ASSERT_TRUE(decode_frame(std::string_view(k6dRes).substr(8), frame));
  EXPECT_EQ(encode_frame(frame, kComponent6dRes), k6dRes);
  EXPECT_EQ(encode_frame(frame, kComponent6d), k6d);
}

TEST(QtmPose, ThereAndBack) {
  const PoseFrame pose{5.0, {1.2345, -0.5, 0.25}, Eigen::Quaterniond(0.4, -0.3, 0.7, 0.5).normalized()};
  const PoseFrame back = to_pose_frame(to_body(pose), 5.0);
  EXPECT_LT((back.p_WB - pose.p_WB).norm(), 1e-6);
  EXPECT_LT(back.q_WB.angularDistance(pose.q_WB), 1e-6);
  PoseFrame unseen = pose;
  unseen.p_WB.x() = std::nan("");
  EXPECT_FALSE(to_pose_frame(to_body(unseen), 5.0).p_WB.allFinite());
}

TEST(QtmPose, AMirrorOrAStretchIsNoRotation) {
  Body body = to_body({0.0, Eigen::Vector3d::Zero(), Eigen::Quaterniond::Identity()});
  body.rotation[8] = -1.0f;
  EXPECT_FALSE(to_pose_frame(body, 0.0).p_WB.allFinite());
  body.rotation[8] = 1.1f;
  EXPECT_FALSE(to_pose_frame(body, 0.0).p_WB.allFinite());
}

TEST(QtmParameters, NamesInTheirOrder) {
  const auto parameters = parse_parameters(kXmlText);
  ASSERT_TRUE(parameters);
  ASSERT_EQ(parameters->bodies.size(), 2u);
  EXPECT_EQ(parameters->bodies[1].name, "atmos") << "blanks around a name do not count";
  EXPECT_EQ(index_of(*parameters, "ATMOS", 2), 1u);
  EXPECT_FALSE(index_of(*parameters, "atmos", 3)) << "the parameters are not those of such frames";
  EXPECT_FALSE(index_of(*parameters, "snap", 2));
  EXPECT_FALSE(parameters->frequency_hz);
}

TEST(QtmParameters, WhatNewerVersionsAdd) {
  const auto parameters = parse_parameters(
      "<?xml version=\"1.0\"?><QTM_Parameters_Ver_1.28><General><Frequency>100</Frequency></General><The_6D>"
      "<Bodies>3</Bodies><Body><Name>a</Name><Enabled>True</Enabled><Color R=\"1\" G=\"2\" B=\"3\"/>"
      "<MaximumResidual>10</MaximumResidual></Body><Body><Name>b</Name><Enabled>False</Enabled></Body>"
      "<Body><Name>c &amp; d</Name><Points><Point X=\"1\"/></Points></Body></The_6D>"
      "</QTM_Parameters_Ver_1.28>");
  ASSERT_TRUE(parameters);
  EXPECT_EQ(parameters->frequency_hz, 100.0);
  EXPECT_EQ(index_of(*parameters, "c & d", 3), 2u);
  EXPECT_EQ(index_of(*parameters, "c & d", 2), 1u) << "disabled bodies are left out of frames";
}

TEST(QtmParameters, WhatIsNoAnswer) {
  EXPECT_FALSE(parse_parameters(""));
  EXPECT_FALSE(parse_parameters("<QTM_Parameters_Ver_1.18><The_6D>"));
  EXPECT_FALSE(parse_parameters("<Something/>"));
  EXPECT_FALSE(parse_parameters("<QTM_Parameters_Ver_1.18><The_3D/></QTM_Parameters_Ver_1.18>"));
}

TEST(QtmParameters, ThereAndBack) {
  const Parameters written{100.0, {{"a<b>", true}, {"off", false}}};
  const auto read = parse_parameters(format_parameters(written, "1.28"));
  ASSERT_TRUE(read);
  EXPECT_EQ(read->frequency_hz, 100.0);
  ASSERT_EQ(read->bodies.size(), 2u);
  EXPECT_EQ(read->bodies[0].name, "a<b>");
  EXPECT_FALSE(read->bodies[1].enabled);
}

}  // namespace
}  // namespace atmos::qtm
