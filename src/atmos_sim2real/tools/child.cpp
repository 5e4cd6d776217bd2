#include "child.h"

#include <fcntl.h>
#include <sys/wait.h>
#include <unistd.h>

#include <fstream>
#include <stdexcept>

namespace atmos {

namespace fs = std::filesystem;

fs::path simulator_tool(const std::string& name) {
  std::error_code none;
  const fs::path self = fs::read_symlink("/proc/self/exe", none);
  return self.parent_path().parent_path() / "atmos_sim" / name;
}

pid_t start_child(const std::vector<std::string>& command, const std::string& log) {
  std::vector<char*> arguments;
  for (const std::string& word : command) arguments.push_back(const_cast<char*>(word.c_str()));
  arguments.push_back(nullptr);
  const pid_t child = fork();
  if (child == 0) {
    const int out = open(log.c_str(), O_WRONLY | O_CREAT | O_TRUNC, 0644);
    if (out >= 0) {
      dup2(out, STDOUT_FILENO);
      dup2(out, STDERR_FILENO);
    }
    execv(arguments[0], arguments.data());
    _exit(127);
  }
  return child;
}

void run_child(const std::vector<std::string>& command, const std::string& log) {
  const pid_t child = start_child(command, log);
  int status = 0;
  if (child > 0 && waitpid(child, &status, 0) == child && WIFEXITED(status) && WEXITSTATUS(status) == 0)
    return;
  std::ifstream said(log);
  std::string why;
  std::getline(said, why);
  throw std::runtime_error(command.front() + ": " + (why.empty() ? "did not end in good order" : why));
}

}  // namespace atmos
