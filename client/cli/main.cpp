// isomesh: the command-line client.

#include <csignal>
#include <exception>
#include <iostream>

#include <poll.h>
#include <unistd.h>

#include "base/descriptor.h"
#include "client/cli/commands.h"
#include "client/cli/interrupt.h"
#include "client/cli/options.h"

namespace {

// True if the reader of the output has ended, for example `head`. That is not an error to report.
bool reader_has_left() {
  pollfd output{.fd = STDOUT_FILENO, .events = POLLOUT, .revents = 0};
  return ::poll(&output, 1, 0) == 1 && (output.revents & POLLERR) != 0;
}

}  // namespace

int main(int argc, char** argv) {
  using namespace isomesh::cli;
  isomesh::hold_standard_descriptors();
  // If the reader of the output ends, writing fails instead of ending the process.
  std::signal(SIGPIPE, SIG_IGN);
  // The same for a file beyond `ulimit -f`, so that the unfinished file is removed.
  std::signal(SIGXFSZ, SIG_IGN);
  const Interrupt interrupt;
  int status = kRefused;
  try {
    status = run(parse_options(argc, argv), interrupt.token());
  } catch (const EarlyExit& exit) {
    (exit.status() == 0 ? std::cout : std::cerr) << exit.what();
    status = exit.status();
  } catch (const std::exception& error) {
    std::cerr << "isomesh: " << error.what() << '\n';
  }
  std::cout.flush();
  interrupt.end_by_signal();
  if (std::cout || status != kDone) return status;
  if (!reader_has_left()) std::cerr << "isomesh: standard output cannot be written to\n";
  return kRefused;
}
