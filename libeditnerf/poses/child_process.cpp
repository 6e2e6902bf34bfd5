#include "libeditnerf/poses/child_process.h"

#include <fcntl.h>
#include <signal.h>
#include <spawn.h>
#include <sys/wait.h>

#include <cerrno>
#include <chrono>
#include <cstring>
#include <fstream>
#include <thread>

#include "libeditnerf/base/error.h"
#include "libeditnerf/base/interrupt.h"

extern char** environ;

namespace editnerf {
namespace {

constexpr auto kPollInterval = std::chrono::milliseconds(50);
constexpr int kPollsBeforeKill = 60;  // 3 s between asking and forcing

// New complete lines of a file that another process appends to.
class LineFollower {
 public:
  LineFollower(const std::filesystem::path& path, std::function<void(const std::string&)> on_line)
      : on_line_(std::move(on_line)) {
    if (!on_line_) return;
    stream_.open(path, std::ios::binary);
    stream_.seekg(0, std::ios::end);  // what earlier programs wrote
  }
  void Poll() {
    if (!on_line_) return;
    char buffer[4096];
    do {
      stream_.clear();
      stream_.read(buffer, sizeof(buffer));
      partial_.append(buffer, static_cast<size_t>(stream_.gcount()));
      for (size_t end; (end = partial_.find_first_of("\r\n")) != std::string::npos; partial_.erase(0, end + 1)) {
        if (end > 0) on_line_(partial_.substr(0, end));
      }
    } while (stream_.gcount() > 0);
  }

 private:
  std::function<void(const std::string&)> on_line_;
  std::ifstream stream_;
  std::string partial_;
};

pid_t Spawn(const ChildProcess& child) {
  std::vector<char*> argv;
  for (const std::string& argument : child.arguments) argv.push_back(const_cast<char*>(argument.c_str()));
  argv.push_back(nullptr);
  std::vector<std::string> added;
  for (const auto& [name, value] : child.environment) added.push_back(name + "=" + value);
  std::vector<char*> environment;
  for (char** entry = environ; entry != nullptr && *entry != nullptr; ++entry) {
    bool replaced = false;
    for (const auto& variable : child.environment) {
      replaced = replaced || std::strncmp(*entry, (variable.first + "=").c_str(), variable.first.size() + 1) == 0;
    }
    if (!replaced) environment.push_back(*entry);
  }
  for (std::string& entry : added) environment.push_back(entry.data());
  environment.push_back(nullptr);

  posix_spawn_file_actions_t actions;
  posix_spawn_file_actions_init(&actions);
  posix_spawn_file_actions_addopen(&actions, 0, "/dev/null", O_RDONLY, 0);
  posix_spawn_file_actions_addopen(&actions, 1, child.log.c_str(), O_WRONLY | O_CREAT | O_APPEND, 0644);
  posix_spawn_file_actions_adddup2(&actions, 1, 2);
  pid_t pid = 0;
  const int reason = posix_spawnp(&pid, argv[0], &actions, nullptr, argv.data(), environment.data());
  posix_spawn_file_actions_destroy(&actions);
  if (reason != 0) Throw<DataError>("{}: cannot be started: {}", child.arguments[0], std::strerror(reason));
  return pid;
}

// Asks the child to end, forces it after a while, and collects it.
void Stop(pid_t pid) {
  ::kill(pid, SIGTERM);
  int status = 0;
  for (int polls = 0; ::waitpid(pid, &status, WNOHANG) == 0; ++polls) {
    if (polls == kPollsBeforeKill) ::kill(pid, SIGKILL);
    std::this_thread::sleep_for(kPollInterval);
  }
}

}  // namespace

int RunChild(const ChildProcess& child) {
  if (child.arguments.empty()) Throw<ConfigError>("no program to run");
  { std::ofstream create(child.log, std::ios::app); }  // so that the follower finds it
  LineFollower follower(child.log, child.on_line);
  const pid_t pid = Spawn(child);
  int status = 0;
  for (;;) {
    const pid_t done = ::waitpid(pid, &status, WNOHANG);
    if (done == pid) break;
    if (done < 0 && errno != EINTR) {
      Throw<DataError>("{}: lost: {}", child.arguments[0], std::strerror(errno));
    }
    if (InterruptRequested()) {
      Stop(pid);
      Throw<Interrupted>("interrupted while {} was running", child.arguments[0]);
    }
    follower.Poll();
    std::this_thread::sleep_for(kPollInterval);
  }
  follower.Poll();
  // Ctrl-C at a terminal reaches the child as well; it may be gone before this process looks at its own flag.
  if (InterruptRequested() || (WIFSIGNALED(status) && WTERMSIG(status) == SIGINT)) {
    Throw<Interrupted>("interrupted while {} was running", child.arguments[0]);
  }
  return WIFEXITED(status) ? WEXITSTATUS(status) : 128 + WTERMSIG(status);
}

}  // namespace editnerf
