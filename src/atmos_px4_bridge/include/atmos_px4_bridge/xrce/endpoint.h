// The agent's end of a DDS-XRCE session with PX4's uxrce_dds_client on a serial line: session, entities,
// reliable and best-effort streams, time replies, pings, pacing. Bytes in, frames out, time as an argument;
// no DDS, no ROS. What breaks such a session, and what is done against it: docs/xrce.md. Times are seconds of
// one clock, that of ROS; PX4's stamps are then of it, too.
#pragma once

#include <array>
#include <deque>
#include <functional>
#include <limits>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "atmos_px4_bridge/xrce/framing.h"
#include "atmos_px4_bridge/xrce/pacer.h"
#include "atmos_px4_bridge/xrce/protocol.h"
#include "atmos_px4_bridge/xrce/topics.h"

namespace atmos::xrce {

struct EndpointCounters {
  std::uint64_t sent = 0, received = 0;    // messages
  std::uint64_t lost = 0;                  // by their sequence numbers
  std::uint64_t malformed = 0;             // messages that could not be read to their end
  std::uint64_t sessions = 0, forced = 0;  // opened by PX4; dropped by us because a topic was missing
  std::uint64_t repeated = 0;              // reliable messages sent again
  std::uint64_t superseded = 0;            // samples replaced by newer ones before they were sent
};

class Endpoint {
 public:
  static constexpr double kQuiet_s = 0.3;    // without a CREATE: PX4 is set up
  static constexpr double kMissing_s = 3.0;  // without a CREATE: what is still missing will not come
  static constexpr double kRepair_s = 0.04;  // between requests for the next message, and heartbeats
  static constexpr double kRemind_s = 0.5;   // the same, long after the last CREATE
  static constexpr double kSettingUp_s = 5.0;
  static constexpr std::size_t kWindow = 4;  // unacknowledged messages that the client can hold

  enum class State {
    kNoSession,
    kSettingUp,  // PX4 creates its entities; nothing is sent but answers
    kReady,      // every wanted topic is there, and PX4 is quiet
    kRefused,    // what PX4 shows contradicts the firmware of the configuration: no sample is sent
  };

  // Where a sample waits for the line. A newer one takes the place of the one that waits; commands queue.
  enum class Slot { kCommand, kSetpoint, kOdometry };
  struct Sample {
    Topic topic;
    Bytes payload;
  };

  using Write = std::function<void(const std::uint8_t*, std::size_t)>;
  struct Listener {
    std::function<void(double)> session;  // PX4 opened a session
    std::function<void(Topic, ByteView, double)> sample;
    std::function<void(double, double)> clock;  // PX4's seconds since boot, ours
    std::function<void(const std::string&)> fault;
  };

  Endpoint(Firmware firmware, double bytes_per_s, Write write, Listener listener);

  void receive(const std::uint8_t* data, std::size_t size, double now_s);
  // Timers and pacing: every millisecond, or as often as time moves.
  void tick(double now_s);
  // The line was opened (again).
  void restart() { deframer_.reset(); }

  State state() const { return state_; }
  // The firmware has shown itself: a vehicle status of the right version and length came in this session.
  bool verified() const { return verified_; }
  // Samples of one message, sent as soon as the line may take them; dropped unless kReady. Set-points also
  // wait for verified().
  void send(Slot slot, std::vector<Sample> samples, double now_s);

  const EndpointCounters& counters() const { return counters_; }
  const FramingCounters& framing() const { return deframer_.counters(); }
  std::uint16_t next_expected() const { return expected_; }

 private:
  struct Entity {
    Topic topic = Topic::kCount;  // kCount: not one of ours
    bool refused = false;
  };
  struct Reader {
    std::uint16_t object = 0, request = 0;
    bool exists = false, reading = false;
  };
  struct Reliable {
    std::uint16_t sequence;
    Bytes message;
  };

  void take_message(ByteView bytes, double now_s);
  void take_reliable(const MessageReader& message, ByteView bytes, double now_s);
  void read_submessages(MessageReader message, double now_s);
  void on_create_client(const SubmessageView& submessage, double now_s);
  void on_create(const SubmessageView& submessage, double now_s);
  std::uint8_t create(std::uint16_t object, PayloadReader& body);
  std::uint8_t create_topic(std::uint16_t object, ByteView representation);
  std::uint8_t create_end(std::uint16_t object, ByteView representation);
  void on_get_info(const SubmessageView& submessage, const MessageHeader& header);
  void on_delete(const SubmessageView& submessage, const MessageHeader& header);
  void on_read_data(const SubmessageView& submessage);
  void on_write_data(const SubmessageView& submessage, double now_s);
  void on_acknack(const SubmessageView& submessage);
  void on_heartbeat(const SubmessageView& submessage);
  void on_timestamp(const SubmessageView& submessage, const MessageHeader& header, double now_s);

  void open_session(std::uint8_t session, double now_s);
  void drop_session();
  void refuse(const std::string& fault);
  bool alive() const { return state_ != State::kNoSession; }
  std::string missing() const;
  void judge_set_up(double now_s);
  void put_reliable(Submessage id, const Bytes& payload);
  void fill_window();
  void acknowledge(bool ask_for_next);
  void put(const Bytes& message);
  void write(const Bytes& frame);
  void flush(double now_s);
  Bytes data_message(const std::vector<Sample>& samples) const;

  static constexpr double kNever = -std::numeric_limits<double>::infinity();
  Firmware firmware_;
  Write write_;
  Listener listener_;
  Deframer deframer_{kClientAddress, kAgentAddress};
  EndpointCounters counters_;
  Pacer pacer_;

  State state_ = State::kNoSession;
  bool verified_ = false;
  int wrong_lengths_ = 0;
  std::uint8_t session_ = 0;
  double now_s_ = kNever;
  double created_s_ = kNever, asked_s_ = kNever, heartbeat_s_ = kNever;
  std::map<std::uint16_t, Entity> entities_;
  std::array<Reader, kTopics> readers_;

  // Reliable messages from PX4.
  std::uint16_t expected_ = 0;
  std::map<std::uint16_t, Bytes> early_;  // ahead of expected_
  std::optional<std::uint16_t> best_effort_in_;
  // Ours to PX4.
  std::uint16_t reliable_out_ = 0, best_effort_out_ = 0;
  std::deque<Reliable> in_flight_;
  std::deque<std::pair<Submessage, Bytes>> waiting_;  // for room in the window

  std::deque<Bytes> control_;  // frames that wait for the line, first of all
  std::deque<std::vector<Sample>> commands_;
  std::vector<Sample> setpoint_, odometry_;
};

}  // namespace atmos::xrce
