// atmos_sim_grid: flies the runs of a grid in parallel processes. Its journal holds one line per finished run
// and is all that a resumed call needs: after a kill at any moment, runs are neither lost nor done twice.
#include <fcntl.h>
#include <signal.h>
#include <sys/file.h>
#include <sys/prctl.h>
#include <sys/wait.h>
#include <unistd.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <cstdio>
#include <filesystem>
#include <fstream>
#include <map>
#include <stdexcept>

#include "atmos_sim/run_grid.h"
#include "bag_of_flight.h"

namespace {

using namespace atmos;
namespace fs = std::filesystem;

// One write appends the whole line: a kill leaves all of it or none, or a tail that finished_runs() cuts off.
void append(int journal, const std::string& line) {
  const std::string text = line + "\n";
  if (::write(journal, text.data(), text.size()) != static_cast<ssize_t>(text.size()))
    throw std::runtime_error("the journal cannot be written");
}

// Runs k with k % jobs == job that are not finished; in a process of its own.
void work(const RunGrid& grid, const std::vector<int>& runs, std::size_t job, std::size_t jobs, int journal,
          const std::string& out, const std::set<int>& bags) {
  const BagWriter write = [](const std::string& path, const Scenario& scenario, const PilotedFlight& flight,
                             double start_s) {
    const std::string part = path + ".part";
    write_bag(part, scenario, flight, start_s, "atmos");
    fs::rename(part, path);  // a bag that has its name is whole
  };
  for (std::size_t i = job; i < runs.size(); i += jobs) {
    const std::string bag =
        bags.count(runs[i]) != 0 ? out + "/bags/run_" + std::to_string(runs[i]) + ".bag" : "";
    append(journal, fly_run(grid, runs[i], bag, write));
  }
}

void show_progress(std::size_t done, std::size_t total) {
  constexpr std::size_t kWidth = 40;
  const std::size_t filled = total == 0 ? kWidth : kWidth * done / total;
  std::fprintf(stderr, "\r[%s%s] %zu / %zu runs", std::string(filled, '#').c_str(),
               std::string(kWidth - filled, '.').c_str(), done, total);
  std::fflush(stderr);
}

// The rows in the order of their runs.
void write_table(const std::string& journal, const std::string& path) {
  std::ifstream in(journal);
  std::string header, line;
  std::getline(in, header);
  std::map<int, std::string> rows;
  while (std::getline(in, line)) rows[std::stoi(line)] = line;
  std::ofstream out(path + ".part");
  out << header << "\n";
  for (const auto& [run, row] : rows) out << row << "\n";
  if (!out.flush()) throw std::runtime_error(path + ": cannot be written");
  fs::rename(path + ".part", path);
}

int fly(const RunGrid& grid, const std::string& out, std::size_t jobs, const std::set<int>& bags) {
  fs::create_directories(out + "/bags");
  const std::string path = out + "/journal.csv";
  const int journal = ::open(path.c_str(), O_RDWR | O_CREAT | O_APPEND, 0644);
  if (journal < 0) throw std::runtime_error(path + ": cannot be written");
  // Workers inherit the lock: as long as one of an earlier call is alive, nobody else may start.
  if (::flock(journal, LOCK_EX | LOCK_NB) != 0) throw std::runtime_error(out + " is in use by another call");
  const std::set<int> finished = finished_runs(path, grid);
  if (fs::file_size(path) == 0) append(journal, table_header(grid));
  std::vector<int> open_runs;
  for (int run = 0; run < grid.size(); ++run) {
    if (finished.count(run) == 0) open_runs.push_back(run);
  }
  if (!finished.empty()) std::printf("resuming: %zu of %d runs are done\n", finished.size(), grid.size());
  std::fflush(stdout);

  std::size_t alive = 0;
  const pid_t parent = ::getpid();
  for (std::size_t job = 0; job < std::min(jobs, open_runs.size()); ++job) {
    const pid_t child = ::fork();
    if (child < 0) throw std::runtime_error("no process can be started");
    if (child == 0) {
      ::prctl(PR_SET_PDEATHSIG, SIGKILL);
      if (::getppid() != parent) ::_exit(1);
      try {
        work(grid, open_runs, job, jobs, journal, out, bags);
        ::_exit(0);
      } catch (const std::exception& error) {
        std::fprintf(stderr, "\n%s\n", error.what());
        ::_exit(1);
      }
    }
    ++alive;
  }
  bool failed = false;
  std::ptrdiff_t shown = -1;  // lines of the journal at the last redraw: a log keeps no repetitions
  while (alive > 0) {
    int status = 0;
    while (alive > 0 && ::waitpid(-1, &status, WNOHANG) > 0) {
      --alive;
      failed |= !WIFEXITED(status) || WEXITSTATUS(status) != 0;
    }
    std::ifstream in(path);
    const auto lines = std::count(std::istreambuf_iterator<char>(in), {}, '\n');
    if (lines != shown) {
      show_progress(static_cast<std::size_t>(std::max<std::ptrdiff_t>(lines - 1, 0)),
                    static_cast<std::size_t>(grid.size()));
      shown = lines;
    }
    if (alive > 0) ::usleep(100000);
  }
  std::fprintf(stderr, "\n");
  if (failed) return 1;
  write_table(path, out + "/table.csv");
  std::printf("%d runs: %s/table.csv\n", grid.size(), out.c_str());
  return 0;
}

}  // namespace

int main(int argc, char** argv) {
  std::string grid_path, out;
  std::size_t jobs = 2;
  std::vector<int> bags;
  CLI::App app("Flies every run of a grid in closed loop without ROS; call it again to resume.");
  app.add_option("grid", grid_path, "grid file")->required();
  app.add_option("--out", out, "folder for journal.csv, table.csv and bags/")->required();
  app.add_option("--jobs", jobs, "processes")->capture_default_str()->check(CLI::Range(1, 256));
  app.add_option("--bags", bags, "numbers of the runs whose bags are wanted")->delimiter(',');
  try {
    app.parse(argc, argv);
  } catch (const CLI::ParseError& error) {
    return app.exit(error) == 0 ? 0 : 2;
  }
  try {
    return fly(load_grid(grid_path), out, jobs, {bags.begin(), bags.end()});
  } catch (const ConfigError& error) {
    std::fprintf(stderr, "%s\n", error.what());
    return 2;
  } catch (const std::exception& error) {
    std::fprintf(stderr, "atmos_sim_grid: %s\n", error.what());
    return 1;
  }
}
