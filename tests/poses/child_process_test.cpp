#include "libeditnerf/poses/child_process.h"

#include <filesystem>
#include <string>
#include <vector>

#include "libeditnerf/base/error.h"
#include "libeditnerf/base/interrupt.h"
#include "tests/catch.h"
#include "tests/imaging/messages.h"
#include "tests/imaging/scratch_folder.h"

using namespace editnerf;

TEST_CASE("a child process gets its arguments unharmed and reports its exit code") {
  const ScratchFolder folder;
  ChildProcess child;
  child.arguments = {"/bin/sh", "-c", "echo \"$1\"; echo $EDITNERF_TEST_VALUE >&2; exit 3", "sh",
                     "a b; $(rm -rf c) 'd'"};
  child.environment = {{"EDITNERF_TEST_VALUE", "seen"}};
  child.log = folder / "log.txt";
  std::vector<std::string> lines;
  child.on_line = [&](const std::string& line) { lines.push_back(line); };
  WriteText(child.log, "from before\n");
  CHECK(RunChild(child) == 3);
  CHECK(lines == std::vector<std::string>{"a b; $(rm -rf c) 'd'", "seen"});
  CHECK_THAT(ReadText(child.log), StartsWithText("from before\n"));
  child.arguments = {"/bin/sh", "-c", "kill -9 $$"};
  CHECK(RunChild(child) == 137);
}

TEST_CASE("a program that is not there is named") {
  const ScratchFolder folder;
  ChildProcess child;
  child.arguments = {"editnerf-no-such-program"};
  child.log = folder / "log.txt";
  CHECK(MessageOf<DataError>([&] { RunChild(child); }) ==
        "editnerf-no-such-program: cannot be started: No such file or directory");
}

TEST_CASE("an interrupt request ends the child") {
  const ScratchFolder folder;
  ChildProcess child;
  child.arguments = {"/bin/sh", "-c", "echo $$; exec sleep 600"};
  child.log = folder / "log.txt";
  child.on_line = [](const std::string&) { RequestInterrupt(); };
  const std::string message = MessageOf<Interrupted>([&] { RunChild(child); });
  ClearInterrupt();
  CHECK(message == "interrupted while /bin/sh was running");
  const std::string pid = ReadText(child.log);
  CHECK_FALSE(std::filesystem::exists("/proc/" + pid.substr(0, pid.find('\n'))));
}
