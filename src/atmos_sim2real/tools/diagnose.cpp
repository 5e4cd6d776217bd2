// diagnose: why recordings differ from the simulation. Writes report.json, report.html, model.yaml, figures/.
#include <malloc.h>
#include <sys/socket.h>
#include <sys/wait.h>
#include <unistd.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <filesystem>
#include <future>
#include <nlohmann/json.hpp>
#include <set>

#include "atmos_model/effects.h"
#include "atmos_sim2real/report.h"
#include "atmos_sim2real/statement.h"
#include "next_experiment.h"
#include "ode_check.h"
#include "recordings.h"

namespace {

namespace fs = std::filesystem;
using namespace atmos;

struct Arguments {
  std::string vehicle, model, out;
  std::vector<std::string> bags, held_out;
};

void say(const std::string& text) {
  std::printf("%s\n", text.c_str());
  std::fflush(stdout);
}

// Held-out recordings must be unseen ones, and nothing counts twice.
void refuse_repeated_bags(const Arguments& arguments) {
  std::set<fs::path> seen;
  for (const auto* list : {&arguments.bags, &arguments.held_out}) {
    for (const std::string& bag : *list) {
      if (!seen.insert(fs::weakly_canonical(bag)).second)
        throw std::invalid_argument(bag + ": is given more than once");
    }
  }
}

// Draws the figures and the page; they are a view of report.json, so that a failure costs only themselves.
// The script is started early, as its libraries take a while to load, and waits for a line.
class Drawing {
 public:
  explicit Drawing(const std::string& out) {
    if (socketpair(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC, 0, ends_) != 0) return;
    child_ = fork();
    if (child_ != 0) return;
    dup2(ends_[0], STDIN_FILENO);
    unsetenv("PYTHONPATH");
    execl("/usr/bin/python3", "python3", REPORT_SCRIPT, out.c_str(), static_cast<char*>(nullptr));
    _exit(127);
  }
  Drawing(const Drawing&) = delete;
  Drawing& operator=(const Drawing&) = delete;
  ~Drawing() { ended(); }

  // Whether it was drawn.
  bool draw() {
    const bool told = child_ > 0 && send(ends_[1], "\n", 1, MSG_NOSIGNAL) == 1;
    return ended() && told;
  }

 private:
  bool ended() {
    for (int& end : ends_) {
      if (end >= 0) close(end);
      end = -1;
    }
    if (child_ <= 0) return false;
    int status = 0;
    const bool waited = waitpid(child_, &status, 0) == child_;
    child_ = 0;
    return waited && WIFEXITED(status) && WEXITSTATUS(status) == 0;
  }

  int ends_[2] = {-1, -1};
  pid_t child_ = 0;
};

void print_summary(const Diagnosis& diagnosis, const nlohmann::ordered_json& summary) {
  say("verdict: " + summary["verdict"].get<std::string>());
  if (!diagnosis.where.empty()) say("where: " + text_of(diagnosis.where.front()));
  for (const auto& effect : summary["effects"])
    say("  " + effect["kind"].get<std::string>() + ": " + effect["statement"].get<std::string>());
  const auto& fit = summary["fit"];
  if (fit["nominal"]["position_rms_m"].is_null()) return;
  std::printf("prediction over 5 s (%s): nominal %.1f mm, fitted %.1f mm, noise floor %.1f mm\n",
              fit["on"].get<std::string>().c_str(), 1e3 * fit["nominal"]["position_rms_m"].get<double>(),
              1e3 * fit["fitted"]["position_rms_m"].get<double>(),
              1e3 * fit["noise_floor"]["position_rms_m"].get<double>());
}

// The simulator under model.yaml on the held-out recordings or, without such, on those that were fitted.
nlohmann::ordered_json replayed(const Arguments& arguments, const Vehicle& vehicle,
                                const std::vector<Effect>& known, const std::vector<Effect>& claimed,
                                const std::vector<Flight>& flights, const std::vector<Recording>& held_out) {
  std::vector<Recording> recordings = held_out;
  if (held_out.empty()) {
    for (const Flight& flight : flights) recordings.push_back(flight.recording());
  }
  std::vector<Effect> fitted = known;
  fitted.insert(fitted.end(), claimed.begin(), claimed.end());
  nlohmann::ordered_json check =
      ode_check(recordings, vehicle, arguments.vehicle, known, fitted, arguments.out);
  if (check.contains("skipped"))
    std::fprintf(stderr, "warning: not replayed in the simulator: %s\n",
                 check["skipped"].get<std::string>().c_str());
  else
    check["on"] = held_out.empty() ? "fitted recordings" : kHeldOut;
  return check;
}

// What to fly next, for the claim that these recordings cannot tell from a rival.
void plan_next(const Arguments& arguments, const Diagnosis& diagnosis, const Problem& problem,
               nlohmann::ordered_json& summary) {
  constexpr double kDecides = 3.0;  // nats
  std::optional<NextExperiment> next;
  try {
    next = next_experiment(diagnosis, problem, arguments.vehicle, arguments.out);
  } catch (const std::exception& error) {
    std::fprintf(stderr, "warning: no experiment was planned: %s\n", error.what());
  }
  if (!next || next->expected_nats < kDecides) return;
  write_text(arguments.out + "/next_experiment.yaml", setpoint_file(next->manoeuvre));
  nlohmann::ordered_json& effect = summary["effects"][place_in_report(diagnosis, next->claim)];
  effect["next_experiment"] = "To tell " + effect["kind"].get<std::string>() + " from " + next->rival +
                              ", fly next_experiment.yaml (" + next->manoeuvre.description +
                              "): in simulation it decides by " + short_number(next->expected_nats) +
                              " nats.";
}

void run(const Arguments& arguments) {
  refuse_repeated_bags(arguments);
  const Vehicle vehicle = load_vehicle(arguments.vehicle);
  const std::vector<Effect> known = read_model(arguments.model, vehicle);
  std::vector<Flight> flights;
  for (const std::string& bag : arguments.bags) {
    say("reading " + bag);
    flights.emplace_back(read_answering(bag, vehicle));
  }
  std::vector<Recording> held_out;
  for (const std::string& bag : arguments.held_out) {
    say("reading " + bag + " (held out)");
    held_out.push_back(read_answering(bag, vehicle));
  }
  const std::string out = arguments.out + "/";
  fs::create_directories(out);

  SearchOptions options;
  options.progress = say;
  Diagnosis diagnosis = diagnose(vehicle, known, flights, options);
  const Problem problem{&vehicle, known, &flights};
  Drawing drawing(arguments.out);
  say("replaying in the simulator");
  auto ode_check = std::async(std::launch::async, [&] {
    return replayed(arguments, vehicle, known, claimed_effects(diagnosis), flights, held_out);
  });
  say("predicting open loop");
  const Proof proof = held_out.empty() ? prove_on_blocks(problem, diagnosis.search.final)
                                       : prove_held_out(problem, diagnosis.search.final, held_out);
  judge_by(proof, diagnosis);

  nlohmann::ordered_json summary = report(diagnosis, problem, proof);
  plan_next(arguments, diagnosis, problem, summary);
  summary["ode_check"] = ode_check.get();
  write_text(out + "model.yaml", write_model(claimed_effects(diagnosis)));
  write_text(out + "plots.json", plot_data(diagnosis, problem, proof).dump());
  write_text(out + "report.json", summary.dump(1) + "\n");
  say("drawing the report");
  if (!drawing.draw())
    std::fprintf(stderr, "warning: the figures and report.html could not be drawn; report.json stands\n");
  print_summary(diagnosis, summary);
  say("written: " + out + "report.json, report.html, model.yaml, figures/");
}

}  // namespace

int main(int argc, char** argv) {
  Arguments arguments;
  CLI::App app("Finds what the simulation leaves out of recordings, names it, fits it and proves it.");
  app.add_option("bags", arguments.bags, "recordings to explain (ROS 1 bags)")->required();
  app.add_option("--vehicle", arguments.vehicle, "vehicle file")->required();
  app.add_option("--out", arguments.out, "folder to write into")->required();
  app.add_option("--holdout", arguments.held_out, "recordings used for proof alone, never to fit or select");
  app.add_option("--model", arguments.model, "model.yaml taken as part of the nominal model");
  try {
    app.parse(argc, argv);
  } catch (const CLI::ParseError& error) {
    return app.exit(error) == 0 ? 0 : 2;
  }
  // Columns come and go by the thousand: their memory is kept instead of asked for anew each time.
  mallopt(M_MMAP_MAX, 0);
  mallopt(M_TRIM_THRESHOLD, 1 << 30);
  return with_clear_errors([&] { run(arguments); });
}
