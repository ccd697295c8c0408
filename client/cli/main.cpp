// isomesh: the command that asks a server for meshes.

#include <csignal>
#include <exception>
#include <iostream>

#include "client/cli/commands.h"
#include "client/cli/interrupt.h"
#include "client/cli/options.h"

int main(int argc, char** argv) {
  using namespace isomesh::cli;
  // A reader of the output that went away is an error of std::cout, and no sudden end.
  std::signal(SIGPIPE, SIG_IGN);
  const Interrupt interrupt;
  try {
    const int status = run(parse_options(argc, argv), interrupt.token());
    std::cout.flush();
    return status == kDone && !std::cout ? kRefused : status;
  } catch (const EarlyExit& exit) {
    (exit.status() == 0 ? std::cout : std::cerr) << exit.what();
    return exit.status();
  } catch (const std::exception& error) {
    std::cerr << "isomesh: " << error.what() << '\n';
    return kRefused;
  }
}
