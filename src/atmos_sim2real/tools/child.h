// Programs of the simulator as child processes.
#pragma once

#include <sys/types.h>

#include <filesystem>
#include <string>
#include <vector>

namespace atmos {

// A tool of atmos_sim beside this program: <lib>/atmos_sim2real/<this>, <lib>/atmos_sim/<name>.
std::filesystem::path simulator_tool(const std::string& name);

// Starts a program whose output goes to `log`; its process id, or less than 0.
pid_t start_child(const std::vector<std::string>& command, const std::string& log);

// Runs a program to its end; its output goes to `log`. Throws std::runtime_error with the first line of its
// output when it fails.
void run_child(const std::vector<std::string>& command, const std::string& log);

}  // namespace atmos
