// PX4Space's uxrce_dds_client as its serial line shows it: ping, session, readers one by one, clock, lazy
// writers, pings again; with the client library's habits and weaknesses (docs/xrce.md, "Emulator"). Shares no
// code with the endpoint in xrce/. Times are seconds since boot of the emulated autopilot.
#pragma once

#include <array>
#include <cstdint>
#include <deque>
#include <functional>
#include <map>
#include <optional>
#include <string>
#include <vector>

namespace atmos {

class UxrceClient {
 public:
  struct Topic {
    const char* name;  // as in rt/fmu/in/NAME
    const char* type;  // as in px4_msgs::msg::dds_::TYPE_
  };
  struct Config {
    std::vector<Topic> readers;  // in the order of dds_topics.yaml
    int clock_exchanges = 500;   // good ones before the main loop
  };
  enum class Phase {
    kPing,
    kOpening,
    kCreating,
    kClock,
    kRunning,
    kEnded,  // a failed start: PX4Space's module stays down until it is started again
  };
  using Write = std::function<void(const std::uint8_t*, std::size_t)>;
  using Deliver = std::function<void(const std::string&, const std::uint8_t*, std::size_t)>;

  UxrceClient(Config config, Write write, Deliver deliver);

  void receive(const std::uint8_t* data, std::size_t size, double clock_s);
  // At 100 Hz or more.
  void tick(double clock_s);
  // A sample of a topic that PX4 writes. The first one of a topic creates its writer; lost when not running.
  void publish(const Topic& topic, const void* payload, std::size_t size, double clock_s);

  Phase phase() const { return phase_; }
  int readers_alive() const;                            // of which PX4 knows that they exist
  bool stream_destroyed() const { return destroyed_; }  // an acknowledgement moved backwards
  int sessions() const { return sessions_; }
  std::uint64_t samples() const { return samples_; }  // delivered
  // The agent's clock minus ours; known from the end of kClock on.
  double agent_offset_s() const { return offset_s_; }
  double last_round_trip_s() const { return round_trip_s_; }

 private:
  using Bytes = std::vector<std::uint8_t>;
  struct Group {  // created with one message, and waited for for one second
    Bytes submessages;
    std::vector<std::uint16_t> requests;
    bool sent = false;
    double sent_s = 0.0;
  };

  void on_byte(std::uint8_t byte, double clock_s);
  void on_message(const Bytes& message, double clock_s);
  void on_reliable(const Bytes& message, std::uint16_t sequence, double clock_s);
  void read(const Bytes& message, double clock_s);
  void on_status(const std::uint8_t* payload);
  void on_data(const std::uint8_t* payload, std::size_t size);
  void on_acknack(std::uint16_t first, unsigned bits);
  void on_time_reply(const std::uint8_t* payload, double clock_s);
  void send_frame(const Bytes& message);
  void send_ping(std::uint8_t session);
  void send_acknack(std::uint16_t last_announced);
  void begin_creating();
  void add_create(Bytes& out, unsigned number, unsigned kind, const Bytes& representation, unsigned parent);
  void add_read(Bytes& out, unsigned number, unsigned kind, unsigned stream);
  Group topic_group(const Topic& topic, unsigned number, bool reader, int read_before);
  void advance_groups(double clock_s);
  void next_step(double clock_s);
  void ask_time(double clock_s);
  void disconnect();

  Config config_;
  Write write_;
  Deliver deliver_;
  Phase phase_ = Phase::kPing;
  double now_s_ = 0.0, due_s_ = 0.0;
  int attempts_ = 0, sessions_ = 0;

  // Frame under way.
  bool in_frame_ = false, escape_ = false;
  Bytes raw_;

  std::uint16_t request_ = 10;
  std::optional<Group> group_;
  unsigned step_ = 0;  // 0: participant, then readers, then the service
  std::vector<bool> alive_;
  Bytes pending_read_;  // READ_DATA that goes with the next message

  // Reliable stream out: what is not acknowledged; in: what is expected and what came early.
  std::uint16_t out_ = 0, out_acknowledged_ = 0, in_ = 0, best_effort_out_ = 0;
  std::deque<std::pair<std::uint16_t, Bytes>> unacknowledged_;
  std::map<std::uint16_t, Bytes> early_;
  std::optional<std::uint16_t> best_effort_in_;
  double inbound_s_ = 0.0, heartbeat_s_ = 0.0;
  bool destroyed_ = false;

  // Clock.
  int exchanges_ = 0;
  std::optional<double> asked_s_;
  double next_ask_s_ = 0.0, offset_s_ = 0.0, round_trip_s_ = 0.0;

  std::map<std::string, unsigned> writers_;  // name -> number
  double data_s_ = 0.0;                      // newest DATA
  std::optional<double> pinged_s_;
  int missed_pings_ = 0;
  std::uint64_t samples_ = 0;
};

}  // namespace atmos
