// What isomeshd does when it does not serve: tokens, its configuration, and what installing needs.
#pragma once

#include <memory>

namespace CLI {
class App;
}

namespace isomesh {

struct Options;

// The subcommands of `cli`, which must outlive it, as `options` must.
class Commands {
 public:
  Commands(CLI::App& cli, const Options& options);
  ~Commands();
  Commands(const Commands&) = delete;
  Commands& operator=(const Commands&) = delete;

  // Whether one of them was asked for, after `cli` has parsed.
  bool asked() const;

  // Runs it, and returns the status to end with: 1 where it did what it could, and has told what is
  // lost. Throws what it throws: Error.
  int run();

 private:
  struct State;
  std::unique_ptr<State> state_;
};

}  // namespace isomesh
