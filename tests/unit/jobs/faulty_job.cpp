// Stands in for the daemon's own program where a job goes wrong: does what the iso-value says.
#include "tests/unit/jobs/faulty_job.h"

#include <csignal>
#include <cstdlib>
#include <string>
#include <string_view>

#include <unistd.h>

#include "server/jobs/making/job_message.h"
#include "server/process/child.h"

namespace {

using namespace isomesh;
using namespace isomesh::jobs;

std::string read_line() {
  std::string line;
  for (char letter = 0; letter != '\n'; line += letter) {
    if (::read(process::kChildDescriptor, &letter, 1) != 1) std::_Exit(EXIT_SUCCESS);
  }
  return line;
}

void say(std::string_view message) {
  while (!message.empty()) {
    const ssize_t count = ::write(process::kChildDescriptor, message.data(), message.size());
    if (count < 0) std::_Exit(EXIT_FAILURE);
    message.remove_prefix(static_cast<std::size_t>(count));
  }
}

void die() {
  ::kill(::getpid(), SIGKILL);
  ::pause();
}

JobAnswer empty_answer(JobOrder::Work work) {
  if (work == JobOrder::Work::kMesh) return MadeMesh{};
  return CountedSurface{};
}

void work(const JobOrder& order) {
  if (order.iso == test::kNeverBegins) std::_Exit(EXIT_SUCCESS);
  say(to_line(JobProgress{.stage = Stage::kEncode, .share = 0.5, .timing = {}}));
  if (order.iso == test::kKilled) die();
  if (order.iso == test::kExits) std::_Exit(3);
  if (order.iso == test::kRunsOutOfTime) std::raise(SIGXCPU);
  if (order.iso == test::kIsDeaf) ::sleep(3600);
  if (order.iso == test::kTalksNonsense) say("nonsense\n");
  if (order.iso == test::kHasNoRoom) {
    return say(to_line(JobAnswer(Error(ErrorCode::kOutOfSpace, "the disk has no room"))));
  }
  if (order.iso == test::kMakesAnotherFile) say(to_line(JobPiece{.file = 1, .bytes = 1}));
  if (order.iso == test::kDiesInAFile) {
    say(to_line(JobPiece{.file = 0, .bytes = 1000}) + "some");
    die();
  }
  while (order.iso == test::kTalksForEver)
    say("and so on, and on, and on, and on, and on, and on, and ");
  const bool is_mesh = order.work == JobOrder::Work::kMesh;
  const bool is_other = order.iso == test::kAnswersAnotherOrder;
  say(to_line(empty_answer(is_mesh != is_other ? JobOrder::Work::kMesh : JobOrder::Work::kCount)));
}

}  // namespace

int main() {
  setup_from(read_line());
  for (;;) {
    if (const auto order = order_from(read_line())) work(*order);
  }
}
